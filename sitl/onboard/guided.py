"""What is flown in Hold and Orbit on request: to a point, a turn, circles, a wait, an orbit.

A request is a row of steps, flown one after the other; the vehicle holds where the last one ends. Each request
replaces the one before. `task` shows the requester how far the one that was taken last has come.
"""

import math
from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

from sitl.onboard.calm import FOREVER, Wait
from sitl.onboard.circles import Circle, orbit_speed
from sitl.onboard.gaze import Gaze, Look
from sitl.onboard.geofence import Geofence
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.mission_items import LEAST_HEIGHT_M
from sitl.onboard.modes import ACCEPTED, Mode, Outcome, Verdict
from sitl.quaternion import Vec3

_FAR_M = 1e5
_RADIUS_M = (0.5, 1000.0)
_DEFAULT_RADIUS_M = 2.0
_FENCE_SAMPLES = 32  # points of a circle that are looked at


class Task:
    """A request under way. `progress` 0 … 1; it ends done, or interrupted by whatever else the vehicle is told."""

    class State(Enum):
        RUNNING = "running"
        DONE = "done"
        INTERRUPTED = "interrupted"

    def __init__(self) -> None:
        self.state = Task.State.RUNNING
        self.progress = 0.0

    def interrupt(self) -> None:
        if self.state is Task.State.RUNNING:
            self.state = Task.State.INTERRUPTED


class Step(NamedTuple):
    """One step: what begins it, and how long to stay then; None: as long as the guide takes."""

    begin: Callable[[Fix], None]
    stay_s: float | None = None


class Orbiting(NamedTuple):
    """ORBIT_EXECUTION_STATUS."""

    circle: Circle
    clockwise: bool


class Guided:
    """Flies requests with `guide`. `enter` switches the vehicle's mode, `flying` tells whether it is in the air."""

    def __init__(
        self,
        guide: Guide,
        geofence: Geofence,
        gaze: Gaze,
        enter: Callable[[Mode], None],
        flying: Callable[[], bool],
    ) -> None:
        self._guide, self._geofence, self._gaze = guide, geofence, gaze
        self._enter, self._flying = enter, flying
        self._fix = Fix.at_rest(0, 0.0)
        self._steps: list[Step] = []
        self._count = 1
        self._begun_s = 0.0
        self._until_s: float | None = None
        self.task: Task | None = None
        self.orbiting: Orbiting | None = None
        self._rate_rad_s = 0.0  # of an orbit without end

    def observe(self, fix: Fix) -> None:
        self._fix = fix

    def leave(self) -> None:
        """The mode was left, or another request begins."""
        if self.task is not None:
            self.task.interrupt()
        self.task = self.orbiting = None
        self._steps = []
        self._rate_rad_s = 0.0

    def _start(self, mode: Mode, steps: list[Step]) -> None:
        self._enter(mode)  # which ends whatever was flown before
        self.task, self._steps, self._count = Task(), steps, len(steps)
        self._next(self._fix)

    def _next(self, fix: Fix) -> None:
        step = self._steps[0]
        step.begin(fix)
        self._begun_s = fix.t_s
        self._until_s = None if step.stay_s is None else fix.t_s + step.stay_s

    def tick(self, fix: Fix) -> None:
        guide = self._guide
        if self._rate_rad_s and len(self._steps) == 1 and self.orbiting is not None:
            guide.keep_orbiting(fix, self.orbiting.circle, self._rate_rad_s)
        if not self._steps:
            return
        end_s = guide.done_s if self._until_s is None else self._until_s
        if self.task is not None:
            share = 1.0 if end_s <= self._begun_s else min(1.0, (fix.t_s - self._begun_s) / (end_s - self._begun_s))
            self.task.progress = (self._count - len(self._steps) + share) / self._count
        if fix.t_s < end_s or (self._rate_rad_s and len(self._steps) == 1):
            return
        self._steps.pop(0)
        if self._steps:
            self._next(fix)
        else:
            self._finish()

    def waits(self) -> Wait:
        """For the end of the present step; for nothing where none is under way."""
        if not self._steps:
            return FOREVER
        if self._rate_rad_s and len(self._steps) == 1:
            return Wait(self._guide.renewal_s)
        return Wait(self._guide.done_s if self._until_s is None else self._until_s)

    def _finish(self) -> None:
        if self.task is not None:
            self.task.state, self.task.progress = Task.State.DONE, 1.0
        self.task = None
        self.orbiting = None

    # --- requests

    def _refusal(self, what: str, *points_N: tuple[float, float, float]) -> Outcome | None:
        """Why the vehicle can't go to some points; NaN: that coordinate is kept."""
        if not self._flying():
            return Outcome(Verdict.TEMPORARILY_REJECTED, f"{what} refused: not flying")
        for point in points_N:
            if any(abs(x) > _FAR_M for x in point):  # also if infinite
                return Outcome(Verdict.DENIED, f"{what} refused: further than 100 km")
            if point[2] > -LEAST_HEIGHT_M:
                return Outcome(Verdict.DENIED, f"{what} refused: lower than {LEAST_HEIGHT_M:g} m above the ground")
            objection = self._geofence.objection(point, "it")
            if objection:
                return Outcome(Verdict.DENIED, f"{what} refused: {objection}")
        return None

    def _here(self, point_N: tuple[float, float, float]) -> Vec3:
        """The point, where it is open the one where the vehicle is."""
        north, east, down = (
            here if math.isnan(x) else x for x, here in zip(point_N, self._fix.position_N, strict=True)
        )
        return north, east, down

    def reposition(
        self,
        point_N: tuple[float, float, float],
        heading_rad: float | None = None,
        speed_m_s: float | None = None,
        stay_s: float | None = None,
    ) -> Outcome:
        """Fly to a point and hold there. NaN keeps that coordinate, as far as a smooth stop allows.

        With `stay_s` the task goes on for so long at the point.
        """
        refusal = self._refusal("reposition", point_N)
        if refusal is not None:
            return refusal
        north, east, down = (None if math.isnan(x) else x for x in point_N)
        steps = [Step(lambda fix: self._guide.reach(fix, (north, east, down), heading_rad, speed_m_s))]
        if stay_s is not None:
            steps.append(Step(lambda fix: None, stay_s))
        self._start(Mode.HOLD, steps)
        return ACCEPTED

    def turn(self, heading_rad: float, way: int, rate_rad_s: float | None) -> Outcome:
        """Turn on the spot: way 0 the short way round, 1 clockwise, −1 anticlockwise."""
        refusal = self._refusal("turn")
        if refusal is not None:
            return refusal
        self._start(Mode.HOLD, [Step(lambda fix: self._guide.turn(fix, heading_rad, way, rate_rad_s))])
        return ACCEPTED

    def _circle(self, what: str, centre_N: tuple[float, float, float], radius_m: float) -> Circle | Outcome:
        """A circle that may be flown, or why not. Radius NaN or 0: the default."""
        radius = abs(radius_m) if radius_m and not math.isnan(radius_m) else _DEFAULT_RADIUS_M
        if not _RADIUS_M[0] <= radius <= _RADIUS_M[1]:
            return Outcome(Verdict.DENIED, f"{what} refused: radius outside {_RADIUS_M[0]:g} … {_RADIUS_M[1]:g} m")
        circle = Circle(self._here(centre_N), radius)
        around = (circle.point(2.0 * math.pi * k / _FENCE_SAMPLES) for k in range(_FENCE_SAMPLES))
        return self._refusal(what, *around) or circle

    def turns(self, centre_N: tuple[float, float, float], radius_m: float, turns: float) -> Outcome:
        """So many turns around a centre, to and from rest; a negative radius: anticlockwise."""
        circle = self._circle("loiter", centre_N, radius_m)
        if isinstance(circle, Outcome):
            return circle
        signed = math.copysign(turns, radius_m)
        steps = [
            Step(lambda fix: self._guide.go(fix, circle.entry(fix.position_N))),
            Step(lambda fix: self._guide.turns(fix, circle, signed)),
        ]
        self._start(Mode.HOLD, steps)
        return ACCEPTED

    def orbit(
        self,
        centre_N: tuple[float, float, float],
        radius_m: float,
        speed_m_s: float | None,
        look: Look,
        total_rad: float,
    ) -> Outcome:
        """Orbit a centre at constant speed; total_rad inf: without end. A negative radius: anticlockwise."""
        circle = self._circle("orbit", centre_N, radius_m)
        if isinstance(circle, Outcome):
            return circle
        speed = orbit_speed(circle, self._guide.limits(speed_m_s))
        rate = math.copysign(speed / circle.radius_m, radius_m if not math.isnan(radius_m) else 1.0)
        steps = [
            Step(lambda fix: self._guide.go(fix, circle.entry(fix.position_N))),
            Step(lambda fix: self._guide.orbit(fix, circle, rate, total_rad)),
        ]
        self._start(Mode.ORBIT, steps)
        self._gaze.at(look, circle.centre_N)
        self.orbiting = Orbiting(circle, rate > 0.0)
        self._rate_rad_s = rate if math.isinf(total_rad) else 0.0
        return ACCEPTED
