"""The guide: the one trajectory in force, and the manoeuvres that replace it."""

import math
from typing import NamedTuple

import numpy as np

from sitl.control.guidance import STRAIGHT, Steering
from sitl.control.reference import Reference, Trajectory, rest_at
from sitl.frames import heading, standing, wrap_pi
from sitl.navigation import NavState
from sitl.onboard.circles import Circle, orbit, turns_at_rest
from sitl.onboard.parameters import Parameters
from sitl.onboard.timing import HEADING_RAD_S2
from sitl.onboard.trajectory import COAST_S, Limits, Motion, at, plan, stopping, to_point
from sitl.quaternion import Vec3

_NEAR_M, _NEAR_M_S = 2.0, 2.0  # a reference further from the vehicle than this is not where to go on from
_RENEW_S = 2.0  # an orbit without end is prolonged so long before its trajectory ends
_FACE_PER_S = 5.0  # heading rate for a heading error, near the bearing to face
_FACE_S, _STILL_RAD_S = 0.1, 0.01
_FOLLOW_ALL = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
_FOLLOW_NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Fix(NamedTuple):
    """The vehicle at one instant, as the onboard logic sees it."""

    now_us: int
    nav: NavState
    feet_down: int

    @classmethod
    def at_rest(cls, now_us: int, heading_rad: float) -> "Fix":
        """Standing at the start point."""
        zero = (0.0, 0.0, 0.0)
        return cls(now_us, NavState(*zero, *zero, *standing(heading_rad, 0.5 * math.pi), *zero), 4)

    @property
    def t_s(self) -> float:
        return self.now_us * 1e-6

    @property
    def position_N(self) -> Vec3:
        return self.nav.north_m, self.nav.east_m, self.nav.down_m

    @property
    def speed_m_s(self) -> float:
        return math.hypot(self.nav.v_north_m_s, self.nav.v_east_m_s, self.nav.v_down_m_s)

    @property
    def heading_rad(self) -> float:
        n = self.nav
        return heading(n.qw, n.qx, n.qy, n.qz)


class Guide:
    """Owns the trajectory and which of its derivatives bind (`follow`, in Guidance's order).

    standing: the vehicle is on the ground, its motors idling or off; a trajectory then starts at rest where it stands.
    """

    def __init__(self, parameters: Parameters, heading_rad: float) -> None:
        self._p = parameters
        self.trajectory: Trajectory = rest_at(0.0, 0.0, 0.0, heading_rad)
        self.follow = _FOLLOW_ALL
        self.steering = STRAIGHT
        self.faced = False  # the heading is `face`'s, not the trajectory's own
        self.standing = True
        self.done_s = 0.0  # when the trajectory has done what it is for
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
        """Where a new trajectory starts: on the old one if the vehicle is near it, else at the vehicle.

        What the old one let go of (a position, or a velocity too) starts at the vehicle in any case.
        """
        if self.standing:
            return Motion(fix.position_N, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), fix.heading_rad)
        r, n = self.reference(fix), fix.nav
        old, velocity = Motion.of(r), (n.v_north_m_s, n.v_east_m_s, n.v_down_m_s)
        p = _chosen(self.follow[:3], old.position_N, fix.position_N)
        v = _chosen(self.follow[3:], old.velocity_N, velocity)
        if math.dist(p, fix.position_N) < _NEAR_M and math.dist(v, velocity) < _NEAR_M_S:
            return old._replace(position_N=p, velocity_N=v)
        return Motion(fix.position_N, velocity, (0.0, 0.0, 0.0), r.heading_rad, r.heading_rate_rad_s)

    def put(
        self,
        trajectory: Trajectory,
        follow: tuple[float, float, float, float, float, float] = _FOLLOW_ALL,
        done_s: float | None = None,
    ) -> None:
        """Put a trajectory in force. done_s: when it has done what it is for; None: at its end."""
        self.trajectory, self.follow, self.steering = trajectory, follow, STRAIGHT
        self.faced = False
        self.done_s = trajectory.end_s if done_s is None else done_s

    def rest_here(self, fix: Fix) -> None:
        """Stand still where the vehicle is."""
        self.put(rest_at(*fix.position_N, fix.heading_rad))

    def steer(self, fix: Fix, steering: Steering) -> None:
        """Fly an attitude or body rates; no trajectory binds."""
        self.put(rest_at(*fix.position_N, fix.heading_rad), _FOLLOW_NOTHING)
        self.steering = steering

    def stop(self, fix: Fix) -> None:
        """Come to rest smoothly; standing, stay."""
        self.rest_here(fix) if self.standing else self.put(stopping(fix.t_s, self.motion(fix), self.limits()))

    def go(
        self,
        fix: Fix,
        point_N: Vec3,
        heading_rad: float | None = None,
        speed_m_s: float | None = None,
        arrival_N: Vec3 = (0.0, 0.0, 0.0),
    ) -> None:
        """Fly to a point; heading None: stop turning. It is done on arrival, also if it passes the point."""
        path = to_point(fix.t_s, self.motion(fix), point_N, heading_rad, self.limits(speed_m_s), arrival_N)
        self.put(path, done_s=path.end_s - COAST_S if any(arrival_N) else None)

    def reach(
        self,
        fix: Fix,
        point_N: tuple[float | None, float | None, float | None],
        heading_rad: float | None,
        speed_m_s: float | None,
    ) -> None:
        """Fly to a point; a coordinate that is None stays where a smooth stop leads."""
        halt = stopping(fix.t_s, self.motion(fix), self.limits())
        end = at(halt, halt.end_s)
        north, east, down = point_N
        target = (
            end.north_m if north is None else north,
            end.east_m if east is None else east,
            end.down_m if down is None else down,
        )
        self.go(fix, target, heading_rad, speed_m_s)

    def rise(self, fix: Fix, down_m: float, heading_rad: float | None = None) -> None:
        """Straight up, or down, to a height, coming to rest over the ground on the way."""
        self.put(plan(fix.t_s, self.motion(fix), self.limits(), down_m=down_m, heading_rad=heading_rad))

    def over(self, fix: Fix, north_m: float, east_m: float) -> None:
        """Level to above a place."""
        self.put(plan(fix.t_s, self.motion(fix), self.limits(), level_N=(north_m, east_m)))

    def turn(self, fix: Fix, heading_rad: float, way: int = 0, rate_rad_s: float | None = None) -> None:
        """To a heading, on the spot: way 0 the short way round, 1 clockwise, −1 anticlockwise."""
        limits = self.limits()
        if rate_rad_s is not None:
            limits = limits._replace(heading_rad_s=min(rate_rad_s, limits.heading_rad_s))
        self.put(plan(fix.t_s, self.motion(fix), limits, heading_rad=heading_rad, way=way))

    def sink(self, fix: Fix, speed_m_s: float, floor_down_m: float) -> None:
        """Descend straight down at up to `speed_m_s` to `floor_down_m`, which may lie below the ground."""
        limits = self.limits()._replace(descent_m_s=speed_m_s)
        self.put(plan(fix.t_s, self.motion(fix), limits, down_m=floor_down_m))

    def turns(self, fix: Fix, circle: Circle, turns: float) -> None:
        """Turns around a circle, from its point where the reference stands."""
        r = self.reference(fix)
        angle = circle.angle((r.north_m, r.east_m, r.down_m))
        self.put(turns_at_rest(fix.t_s, circle, angle, turns, r.heading_rad, self.limits()))

    def orbit(self, fix: Fix, circle: Circle, rate_rad_s: float, total_rad: float = math.inf) -> None:
        """An orbit at a constant angular rate, from its point where the reference rests."""
        self._orbit(fix, circle, rate_rad_s, total_rad, moving=False)

    def keep_orbiting(self, fix: Fix, circle: Circle, rate_rad_s: float) -> None:
        """Prolong an orbit without end in time."""
        if fix.t_s > self.renewal_s:
            self._orbit(fix, circle, rate_rad_s, math.inf, moving=True)

    @property
    def renewal_s(self) -> float:
        """When an orbit without end is to be prolonged."""
        return self.trajectory.end_s - _RENEW_S

    def _orbit(self, fix: Fix, circle: Circle, rate_rad_s: float, total_rad: float, moving: bool) -> None:
        r, limits = self.reference(fix), self.limits()
        angle = circle.angle((r.north_m, r.east_m, r.down_m))
        path = orbit(fix.t_s, circle, angle, rate_rad_s, r.heading_rad, limits, moving=moving, total_rad=total_rad)
        if moving:  # the heading turns on
            path.coefficients[:, 3, 0] += r.heading_rate_rad_s * (path.start_s - fix.t_s)
            path.coefficients[:, 3, 1] = r.heading_rate_rad_s
        self.put(path)

    def face(self, fix: Fix, bearing_rad: float | None) -> None:
        """Turn toward a bearing, whatever heading the trajectory has of its own; to be renewed every tick.

        None: turn no further, after which it needs no renewing.
        """
        r, wanted = self.reference(fix), 0.0
        if bearing_rad is not None:
            error = wrap_pi(bearing_rad - r.heading_rad)
            most = min(self.limits().heading_rad_s, _FACE_PER_S * abs(error), math.sqrt(HEADING_RAD_S2 * abs(error)))
            wanted = math.copysign(most, error)
        spin = max(-HEADING_RAD_S2, min(HEADING_RAD_S2, (wanted - r.heading_rate_rad_s) / _FACE_S))
        self.faced = bearing_rad is not None or abs(r.heading_rate_rad_s) > _STILL_RAD_S
        rate, spin = (r.heading_rate_rad_s, spin) if self.faced else (0.0, 0.0)
        t = self.trajectory
        if fix.t_s >= t.end_s:
            t = rest_at(r.north_m, r.east_m, r.down_m, 0.0)._replace(start_s=np.array([fix.t_s]), end_s=math.inf)
        coefficients = t.coefficients.copy()
        since = fix.t_s - t.start_s
        coefficients[:, 3, 0] = r.heading_rad - since * (rate - 0.5 * since * spin)
        coefficients[:, 3, 1] = rate - since * spin
        coefficients[:, 3, 2] = 0.5 * spin
        coefficients[:, 3, 3:] = 0.0
        self.trajectory = t._replace(coefficients=coefficients)

    def done(self, fix: Fix) -> bool:
        """Whether the trajectory has done what it is for."""
        return fix.t_s >= self.done_s


def _chosen(flags: tuple[float, ...], one: Vec3, other: Vec3) -> Vec3:
    """Per axis `one` where the flag is set, else `other`."""
    return (
        one[0] if flags[0] else other[0],
        one[1] if flags[1] else other[1],
        one[2] if flags[2] else other[2],
    )
