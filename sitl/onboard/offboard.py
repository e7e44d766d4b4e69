"""Targets streamed from outside: their age, and the smooth reference made of them."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.control.reference import DEGREE, Trajectory
from sitl.onboard.modes import ACCEPTED, Outcome, Verdict
from sitl.onboard.parameters import Parameters
from sitl.quaternion import Quat, Vec3

_STAMP_WINDOW_US = 1_000_000  # a stamp further than this from now is not of the vehicle's clock
_REORDERED_US = 200_000  # a stamp older than the newest by no more comes from the same clock, late
_CARRY_S = 0.2  # a target is carried forward by this much at most
_SPACING_S = (0.005, 0.2)  # of two targets whose accelerations tell a jerk
_JERK_MAX = 20.0  # m/s³
_MOST = 1e6  # m, m/s, m/s²
_ALL = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
_NONE: Vec3 = (math.nan, math.nan, math.nan)


def _or_zero(x: float) -> float:
    return 0.0 if math.isnan(x) else x


def _jerk(x: float) -> float:
    """Within bounds; none where an acceleration is missing."""
    if -_JERK_MAX <= x <= _JERK_MAX:
        return x
    return 0.0 if math.isnan(x) else math.copysign(_JERK_MAX, x)


class OffboardTarget(NamedTuple):
    """Where to be and how to move, in N and SI. NaN on an axis: that quantity does not bind there.

    stamp_us: the instant on the vehicle's clock for which the target holds; None: unknown.
    """

    stamp_us: int | None
    position_N: Vec3 = _NONE
    velocity_N: Vec3 = _NONE
    acceleration_N: Vec3 = _NONE
    heading_rad: float = math.nan
    heading_rate_rad_s: float = math.nan


class AttitudeTarget(NamedTuple):
    """How to hold the body and how hard to push.

    q_NB: None where only the rates bind. rates_B [rad/s]: beside an attitude, how it turns.
    thrust: 0 … 1, a share of the largest.
    """

    q_NB: Quat | None
    rates_B: Vec3
    thrust: float


class Foreseen:
    """Targets known ahead, each of which arrives at the instant that it is stamped with and is followed to the next.

    stamps_us: (n,) ascending, instants at which the onboard logic ticks. position_N, velocity_N, acceleration_N:
    (n, 3), all finite. heading_rad: of all of them; NaN: they tell none. The first's jerk is taken to be zero.
    """

    def __init__(
        self,
        stamps_us: NDArray[np.int64],
        position_N: NDArray[np.float64],
        velocity_N: NDArray[np.float64],
        acceleration_N: NDArray[np.float64],
        heading_rad: float,
    ) -> None:
        spacing_s = np.diff(stamps_us)[:, np.newaxis] * 1e-6
        jerk = np.zeros_like(position_N)
        jerk[1:] = np.clip(np.diff(acceleration_N, axis=0) / spacing_s, -_JERK_MAX, _JERK_MAX)
        jerk[1:][((spacing_s < _SPACING_S[0]) | (spacing_s > _SPACING_S[1]))[:, 0]] = 0.0
        c = np.zeros((stamps_us.size, 4, DEGREE + 1))
        c[:, :3, 0], c[:, :3, 1], c[:, :3, 2], c[:, :3, 3] = position_N, velocity_N, acceleration_N / 2.0, jerk / 6.0
        self._start_s: NDArray[np.float64] = (stamps_us * 1e-6).astype(np.float64)
        self._coefficients, self._heading_rad = c, heading_rad
        self.until_s = float(self._start_s[-1]) + _CARRY_S

    @property
    def headed(self) -> bool:
        return not math.isnan(self._heading_rad)

    def trajectory(self, heading_rad: float) -> Trajectory:
        """What `Offboard.trajectory` makes of each, one after the other. heading_rad: the one in force."""
        c = self._coefficients.copy()
        c[:, 3, 0] = self._heading_rad if self.headed else heading_rad
        return Trajectory(self._start_s, c, self.until_s)


class Offboard:
    """The newest target, whether they keep coming, and the trajectory they make.

    `trajectory` and `follow` change with every target; `number` counts them. The newest is in `target` or, where it
    tells an attitude, in `attitude`. objection(point_N, what): why a position may not be flown to, or nothing.
    thrust_full_N, thrust_hover_N: the largest thrust, and the one that carries the vehicle.
    """

    def __init__(
        self,
        parameters: Parameters,
        objection: Callable[[Vec3, str], str],
        thrust_full_N: float,
        thrust_hover_N: float,
    ) -> None:
        self._parameters, self._objection = parameters, objection
        self.thrust_full_N, self.thrust_hover_N = thrust_full_N, thrust_hover_N
        self._arrived_us: int | None = None
        self.target: OffboardTarget | None = None
        self.attitude: AttitudeTarget | None = None
        self.foreseen: Foreseen | None = None  # followed in place of what arrives
        self.number = 0
        self._stamp_us = 0
        self._stamped = False  # the stamp is the target's own
        self._held: list[float | None] = [None, None, None]
        self._jerk: Vec3 = (0.0, 0.0, 0.0)

    def enter(self) -> None:
        """Offboard flight begins: axes that no target binds are held where the vehicle is now."""
        self._held = [None, None, None]

    def submit(self, target: OffboardTarget, now_us: int) -> Outcome:
        """Take a target that arrives now. Refused when it is infinite somewhere or binds nothing.

        One that was overtaken on its way, by a target with a later stamp, shows that the stream lives and is left out.
        """
        fault = self._fault(target)
        if fault:
            return Outcome(Verdict.DENIED, fault)
        self._arrived_us = now_us
        stamp = target.stamp_us
        stamped = stamp is not None and abs(now_us - stamp) <= _STAMP_WINDOW_US
        if stamp is None or not stamped:
            stamp = now_us
        elif self._stamped and 0 < self._stamp_us - stamp <= _REORDERED_US:
            return ACCEPTED
        self._jerk = self._estimated_jerk(target, stamp)
        self.target, self._stamp_us, self._stamped = target, stamp, stamped
        self.attitude = None
        self.number += 1
        return ACCEPTED

    def _fault(self, target: OffboardTarget) -> str:
        """Why a target can't be taken, or nothing."""
        numbers = (*target.position_N, *target.velocity_N, *target.acceleration_N)
        turning = target.heading_rad, target.heading_rate_rad_s
        if not sum(map(abs, numbers)) < _MOST:  # all of them there and small: nothing else to ask
            if any(map(math.isinf, numbers)):
                return "offboard target is infinite"
            if all(map(math.isnan, (*numbers, *turning))):
                return "offboard target ignores everything"
            if any(abs(x) > _MOST for x in numbers):
                return "offboard target is further than 1000 km or faster than sense"
        if any(map(math.isinf, turning)):
            return "offboard target is infinite"
        return self._objection(target.position_N, "offboard target")

    def submit_attitude(self, target: AttitudeTarget, now_us: int) -> Outcome:
        """Take an attitude or body rates with a thrust. Refused when a number is missing or out of range."""
        length = math.hypot(*target.q_NB) if target.q_NB is not None else 1.0
        if not all(map(math.isfinite, (length, *target.rates_B, target.thrust))):
            return Outcome(Verdict.DENIED, "attitude target is not finite")
        if not 0.5 < length < 2.0:
            return Outcome(Verdict.DENIED, "attitude target: the quaternion has no direction")
        if not 0.0 <= target.thrust <= 1.0:
            return Outcome(Verdict.DENIED, "attitude target: the thrust must be 0 … 1")
        if target.q_NB is not None:
            w, x, y, z = (component / length for component in target.q_NB)
            target = target._replace(q_NB=(w, x, y, z))
        self._arrived_us = now_us
        self.target, self.attitude = None, target
        self.number += 1
        return ACCEPTED

    def _estimated_jerk(self, target: OffboardTarget, stamp_us: int) -> Vec3:
        last = self.target
        spacing = (stamp_us - self._stamp_us) * 1e-6
        if last is None or not _SPACING_S[0] <= spacing <= _SPACING_S[1]:
            return (0.0, 0.0, 0.0)
        (a_n, a_e, a_d), (b_n, b_e, b_d) = last.acceleration_N, target.acceleration_N
        return _jerk((b_n - a_n) / spacing), _jerk((b_e - a_e) / spacing), _jerk((b_d - a_d) / spacing)

    def age_s(self, now_us: int) -> float:
        """Simulation time since the newest target arrived; inf if none ever did."""
        return math.inf if self._arrived_us is None else (now_us - self._arrived_us) * 1e-6

    def lost(self, now_us: int) -> bool:
        """Whether no target has come for COM_OF_LOSS_T. It ends Offboard flight, and bars its beginning.

        PX4 asks no more for the beginning either (its documents speak of a stream of a second; its offboardCheck
        of one target younger than COM_OF_LOSS_T), and MAVSDK relies on that: it sets the mode right after its first
        target. It is safe: the stream must live on or the same failsafe acts within COM_OF_LOSS_T.
        """
        if self.foreseen is not None:
            return now_us * 1e-6 > self.foreseen.until_s
        return self.age_s(now_us) > self._parameters["COM_OF_LOSS_T"]

    @property
    def moving(self) -> bool:
        """Whether the newest target carries a velocity or an acceleration, so that its trajectory ends in motion."""
        t = self.target
        return t is not None and any(
            _or_zero(x) != 0.0 for x in (*t.velocity_N, *t.acceleration_N, t.heading_rate_rad_s)
        )

    def trajectory(self, now_us: int, heading_rad: float, position_N: Vec3) -> Trajectory:
        """The newest target as a trajectory: x = p + v τ + a τ²/2 + j τ³/6 with τ the time since its stamp.

        It is carried forward by its age, 0.2 s at most, and then goes on for 0.2 s.
        heading_rad, position_N: those in force now. A target without heading keeps the one, turning from it at its
        rate. An axis without position starts at the other, and one without anything holds it for as long as no
        target binds it.
        """
        target = self.target
        if target is None:
            raise ValueError("there is no offboard target yet")
        now, stamp = now_us * 1e-6, max(self._stamp_us * 1e-6, now_us * 1e-6 - _CARRY_S)
        if stamp <= now and self.places:
            return self._told(target, stamp, now + _CARRY_S)
        c: list[tuple[float, ...]] = []
        start = min(stamp, now)
        early = stamp - start  # a stamp ahead of now: begin now, on the same polynomial
        age = now - start
        for i in range(3):
            p, v, a = target.position_N[i], _or_zero(target.velocity_N[i]), _or_zero(target.acceleration_N[i])
            j = self._jerk[i] if early <= _CARRY_S else 0.0
            if self._free(i):
                held = self._held[i]
                self._held[i] = p = position_N[i] if held is None else held
            else:
                self._held[i] = None
            if math.isnan(p):  # not followed: told from where the vehicle is now
                p = position_N[i] - age * (v + age * (a / 2.0 + age * j / 6.0))
                p += early * (v - early * (a / 2.0 - early * j / 6.0))
            x = p - early * (v - early * (a / 2.0 - early * j / 6.0))
            c.append((x, v - early * (a - early * j / 2.0), (a - early * j) / 2.0, j / 6.0, 0.0, 0.0))
        rate = _or_zero(target.heading_rate_rad_s)
        told = not math.isnan(target.heading_rad)
        heading = target.heading_rad - early * rate if told else heading_rad - age * rate
        c.append((heading, rate, 0.0, 0.0, 0.0, 0.0))
        return Trajectory(np.array([start]), np.array([c]), max(stamp, now) + _CARRY_S)

    def _told(self, t: OffboardTarget, start_s: float, end_s: float) -> Trajectory:
        """That of a target which tells its place and is not ahead of its time: nothing has to be made up for it."""
        self._held = [None, None, None]
        (north, east, down), (j_n, j_e, j_d) = t.position_N, self._jerk
        motion = t.velocity_N + t.acceleration_N
        v_n, v_e, v_d, a_n, a_e, a_d = map(_or_zero, motion) if math.isnan(sum(motion)) else motion
        c = (
            north, v_n, a_n / 2.0, j_n / 6.0, 0.0, 0.0,
            east, v_e, a_e / 2.0, j_e / 6.0, 0.0, 0.0,
            down, v_d, a_d / 2.0, j_d / 6.0, 0.0, 0.0,
            t.heading_rad, _or_zero(t.heading_rate_rad_s), 0.0, 0.0, 0.0, 0.0,
        )  # fmt: skip
        return Trajectory(np.array((start_s,)), np.array(c).reshape(1, 4, DEGREE + 1), end_s)

    @property
    def places(self) -> bool:
        """Whether the newest target tells a position and a heading, so that none in force matter to its trajectory."""
        t = self.target
        return t is not None and not math.isnan(sum(t.position_N) + t.heading_rad)

    def _free(self, axis: int) -> bool:
        """Whether the newest target binds nothing on an axis."""
        t, nan = self.target, math.isnan
        return t is None or (nan(t.position_N[axis]) and nan(t.velocity_N[axis]) and nan(t.acceleration_N[axis]))

    def follow(self) -> tuple[float, float, float, float, float, float]:
        """Guidance's follow flags: position then velocity, per axis.

        An axis with a position, or held for want of anything else, follows position and velocity; one with a velocity
        alone lets go of the position; one with an acceleration alone lets go of both.
        """
        target = self.target
        if target is None or not math.isnan(sum(target.position_N)):
            return _ALL
        positions = [0.0 if math.isnan(p) and not self._free(i) else 1.0 for i, p in enumerate(target.position_N)]
        velocities = [
            0.0 if p == 0.0 and math.isnan(v) else 1.0 for p, v in zip(positions, target.velocity_N, strict=True)
        ]
        return (positions[0], positions[1], positions[2], velocities[0], velocities[1], velocities[2])
