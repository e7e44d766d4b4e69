"""The guide: the one trajectory in force, and the manoeuvres that replace it."""

import math
from typing import NamedTuple

from sitl.control.reference import Reference, Trajectory, rest_at
from sitl.frames import heading
from sitl.navigation import NavState
from sitl.onboard.parameters import Parameters
from sitl.onboard.trajectory import Limits, Motion, at, circle, stopping, to_point
from sitl.quaternion import Vec3

_NEAR_M, _NEAR_M_S = 2.0, 2.0  # a reference further from the vehicle than this is not where to go on from
_FOLLOW_ALL = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)


class Fix(NamedTuple):
    """The vehicle at one instant, as the onboard logic sees it."""

    now_us: int
    nav: NavState
    feet_down: int

    @property
    def t_s(self) -> float:
        return self.now_us * 1e-6

    @property
    def position_N(self) -> Vec3:
        return self.nav.north_m, self.nav.east_m, self.nav.down_m

    @property
    def heading_rad(self) -> float:
        n = self.nav
        return heading(n.qw, n.qx, n.qy, n.qz)


class Guide:
    """Owns the trajectory and which of its derivatives bind (`follow`, in Guidance's order)."""

    def __init__(self, parameters: Parameters, heading_rad: float) -> None:
        self._p = parameters
        self.trajectory: Trajectory = rest_at(0.0, 0.0, 0.0, heading_rad)
        self.follow = _FOLLOW_ALL
        self.speed_m_s: float | None = None  # asked for in flight; None: MPC_XY_CRUISE

    def limits(self, speed_m_s: float | None = None) -> Limits:
        p = self._p
        speed = speed_m_s or self.speed_m_s or p["MPC_XY_CRUISE"]
        return Limits(
            min(speed, p["MPC_XY_VEL_MAX"]),
            p["MPC_Z_V_AUTO_UP"],
            p["MPC_Z_V_AUTO_DN"],
            p["MPC_ACC_HOR"],
            p["MPC_ACC_UP_MAX"],
            p["MPC_ACC_DOWN_MAX"],
            p["MPC_JERK_AUTO"],
            math.radians(p["MPC_YAWRAUTO_MAX"]),
        )

    def reference(self, fix: Fix) -> Reference:
        return at(self.trajectory, fix.t_s)

    def motion(self, fix: Fix) -> Motion:
        """Where a new trajectory starts: on the old one if the vehicle is near it, else at the vehicle."""
        r, n = self.reference(fix), fix.nav
        if all(self.follow[:3]):
            off = math.dist((r.north_m, r.east_m, r.down_m), fix.position_N)
            slip = math.dist((r.v_north_m_s, r.v_east_m_s, r.v_down_m_s), (n.v_north_m_s, n.v_east_m_s, n.v_down_m_s))
            if off < _NEAR_M and slip < _NEAR_M_S:
                return Motion.of(r)
        velocity = (n.v_north_m_s, n.v_east_m_s, n.v_down_m_s)
        return Motion(fix.position_N, velocity, (0.0, 0.0, 0.0), r.heading_rad, r.heading_rate_rad_s)

    def put(self, trajectory: Trajectory, follow: tuple[float, ...] = _FOLLOW_ALL) -> None:
        self.trajectory = trajectory
        self.follow = follow  # type: ignore[assignment]

    def rest_here(self, fix: Fix) -> None:
        """Stand still where the vehicle is."""
        self.put(rest_at(*fix.position_N, fix.heading_rad))

    def stop(self, fix: Fix) -> None:
        """Come to rest smoothly."""
        self.put(stopping(fix.t_s, self.motion(fix), self.limits()))

    def go(
        self,
        fix: Fix,
        point_N: Vec3,
        heading_rad: float | None = None,
        speed_m_s: float | None = None,
        arrival_N: Vec3 = (0.0, 0.0, 0.0),
    ) -> None:
        """Fly to a point; heading None: keep the one in force."""
        start = self.motion(fix)
        course = start.heading_rad if heading_rad is None else heading_rad
        self.put(to_point(fix.t_s, start, point_N, course, self.limits(speed_m_s), arrival_N))

    def sink(self, fix: Fix, speed_m_s: float, floor_down_m: float) -> None:
        """Descend straight down at up to `speed_m_s` to `floor_down_m`, which may lie below the ground."""
        start = self.motion(fix)
        limits = self.limits()._replace(descent_m_s=speed_m_s)
        point = (start.position_N[0], start.position_N[1], floor_down_m)
        if math.hypot(*start.velocity_N[:2]) > 0.1:  # brake on the way down
            halted = stopping(fix.t_s, start, limits)
            end = at(halted, halted.end_s)
            point = (end.north_m, end.east_m, floor_down_m)
        self.put(to_point(fix.t_s, start, point, start.heading_rad, limits))

    def orbit(self, fix: Fix, centre_N: Vec3, radius_m: float, turns: float) -> None:
        """Turns around a centre, from the point of the circle where the reference stands."""
        r = self.reference(fix)
        angle = math.atan2(r.east_m - centre_N[1], r.north_m - centre_N[0])
        self.put(circle(fix.t_s, centre_N, radius_m, angle, turns, r.heading_rad, self.limits()))

    def done(self, fix: Fix) -> bool:
        """Whether the trajectory has come to its end."""
        return fix.t_s >= self.trajectory.end_s
