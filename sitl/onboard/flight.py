"""What is flown in each mode: how it begins, how it goes on, and what ends it from within."""

from collections.abc import Callable

from sitl.control.reference import rest_at
from sitl.geodesy import GeoPoint
from sitl.onboard import ground
from sitl.onboard.calm import Wait
from sitl.onboard.events import EventLog
from sitl.onboard.executor import Executor, Progress
from sitl.onboard.following import Following
from sitl.onboard.gaze import Gaze, Look
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.guided import Guided
from sitl.onboard.homing import Homing, Stage
from sitl.onboard.landing import Landing
from sitl.onboard.modes import Mode, Outcome
from sitl.onboard.offboard import Offboard
from sitl.onboard.parameters import Parameters
from sitl.onboard.plans import Plans
from sitl.onboard.sticks import Sticks
from sitl.onboard.takeoff import Takeoff
from sitl.onboard.transitions import Happening

_KEEP_GAZE = {(Mode.TAKEOFF, Mode.HOLD)}
FACING = (Mode.TAKEOFF, Mode.HOLD, Mode.ORBIT, Mode.MISSION)
"""Modes in which the gaze counts; in the others the heading is somebody else's."""


class Flight:
    """Puts trajectories in force with `guide`, whichever mode it is told to fly."""

    def __init__(
        self,
        parameters: Parameters,
        plans: Plans,
        offboard: Offboard,
        events: EventLog,
        heading_rad: float,
        enter: Callable[[Mode], None],
        flying: Callable[[], bool],
        set_home: Callable[[GeoPoint | None], Outcome],
    ) -> None:
        guide = self.guide = Guide(parameters, heading_rad)
        self.gaze = Gaze()
        self.guided = Guided(guide, plans.geofence, self.gaze, enter, flying)
        self.takeoff = Takeoff(parameters, guide, plans.places, plans.geofence)
        self.sticks = Sticks(parameters)
        self._offboard, self._following = offboard, Following(offboard, guide)
        self._landing = Landing(parameters, guide)
        self._homing = Homing(parameters, guide, self._landing, plans)
        self._executor = Executor(plans.mission, parameters, events, guide, plans.places, self.gaze, set_home)

    def restart(self, heading_rad: float) -> None:
        """As after power-on."""
        self.takeoff.forget()
        self.sticks.centre()
        self.guided.leave()
        self.gaze.forget()
        self.guide.speed_m_s = None
        self.guide.put(rest_at(0.0, 0.0, 0.0, heading_rad))

    def leave(self, mode: Mode, follows: Mode) -> None:
        """One mode makes way for another."""
        if mode is Mode.MISSION:
            self._executor.leave()
        if (mode, follows) not in _KEEP_GAZE:
            self.gaze.forget()
        self.guide.speed_m_s = None

    def begin(self, mode: Mode, fix: Fix) -> None:
        """Put the first trajectory of a mode in force."""
        if mode in (Mode.HOLD, Mode.POSITION, Mode.ORBIT):
            self.guide.stop(fix)
            self.sticks.centre()
        elif mode is Mode.TAKEOFF:
            self.takeoff.start(fix)
        elif mode is Mode.LAND:
            self._landing.start(fix)
        elif mode is Mode.RETURN:
            self._homing.start(fix)
        elif mode is Mode.MISSION:
            self._executor.start(fix)
        elif mode is Mode.OFFBOARD:
            self._following.start()

    def tick(self, mode: Mode, fix: Fix) -> Happening | None:
        """Go on; what ends the mode, if something does."""
        return self._MODES[mode](self, fix)

    def face(self, mode: Mode, fix: Fix) -> None:
        """Turn to what is to be faced, once the mode has had its say."""
        if self._faces(mode):
            bearing = self.gaze.bearing(self.guide.reference(fix))
            if bearing is not None or self.guide.faced:
                self.guide.face(fix, bearing)

    def _faces(self, mode: Mode) -> bool:
        """Whether the heading is not the trajectory's own, or may cease to be."""
        turned = self.guide.faced or self.gaze.look is not Look.AHEAD
        return turned and mode in FACING and not self.guide.standing

    def landing(self, mode: Mode) -> bool:
        """Whether the mode is bringing the vehicle down."""
        return (
            mode is Mode.LAND
            or (mode is Mode.RETURN and self._homing.stage is Stage.LAND)
            or (mode is Mode.MISSION and self._executor.landing)
        )

    def intent(self, mode: Mode) -> ground.Intent:
        """What the mode is about, as ground contact is judged by it."""
        lifting = self._following.lifting if mode is Mode.OFFBOARD else None
        return ground.Intent(mode is Mode.TAKEOFF, self.landing(mode), lifting)

    def _position(self, fix: Fix) -> Happening | None:
        if self.sticks.lost(fix.now_us):
            return Happening.STICKS_LOST
        if self.sticks.deflected or not self.guide.standing:
            self.sticks.tick(fix, self.guide)
        return None

    def _takeoff(self, fix: Fix) -> Happening | None:
        return Happening.HEIGHT_REACHED if self.guide.done(fix) and not self.guide.standing else None

    def _mission(self, fix: Fix) -> Happening | None:
        progress = self._executor.tick(fix)
        if progress is Progress.COMPLETE and not (self.guide.standing and self._executor.landing):
            return Happening.MISSION_COMPLETE
        return Happening.RETURN_ITEM if progress is Progress.RETURN else None

    def _orbit(self, fix: Fix) -> Happening | None:
        self.guided.tick(fix)
        return Happening.ORBIT_COMPLETE if self.guided.orbiting is None else None

    def _offboard_targets(self, fix: Fix) -> Happening | None:
        if self._offboard.lost(fix.now_us):
            return Happening.TARGETS_LOST
        self._following.tick(fix)
        return None

    def waits(self, mode: Mode, fix: Fix) -> Wait | None:
        """What the mode waits for with the trajectory in force; None: it may put another in force at any tick."""
        if self._faces(mode):
            return None
        waits = self._WAITS.get(mode)
        return waits(self, fix) if waits is not None else None

    _WAITS: dict[Mode, Callable[["Flight", Fix], Wait | None]] = {  # noqa: RUF012
        Mode.HOLD: lambda self, fix: self.guided.waits(),
        Mode.ORBIT: lambda self, fix: self.guided.waits(),
        Mode.TAKEOFF: lambda self, fix: Wait(self.guide.done_s),
        Mode.LAND: lambda self, fix: self._landing.waits(),
        Mode.RETURN: lambda self, fix: self._homing.waits(),
        Mode.MISSION: lambda self, fix: self._executor.waits(fix),
        Mode.OFFBOARD: lambda self, fix: self._following.waits(),
    }

    _MODES: dict[Mode, Callable[["Flight", Fix], Happening | None]] = {  # noqa: RUF012
        Mode.HOLD: lambda self, fix: self.guided.tick(fix),
        Mode.ORBIT: _orbit,
        Mode.POSITION: _position,
        Mode.TAKEOFF: _takeoff,
        Mode.LAND: lambda self, fix: self._landing.tick(fix),
        Mode.RETURN: lambda self, fix: self._homing.tick(fix),
        Mode.MISSION: _mission,
        Mode.OFFBOARD: _offboard_targets,
    }
