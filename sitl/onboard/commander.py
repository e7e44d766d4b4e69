"""The commander: arming, modes and what happens when something goes missing.

Which modes can be entered and which follow stands in two tables, ENTRY and AFTER (transitions).
"""

import math
from collections.abc import Callable

from sitl.control.guidance import Effort, Guidance
from sitl.control.reference import rest_at
from sitl.geodesy import GeoPoint
from sitl.navigation import NavState
from sitl.onboard import arming, ground
from sitl.onboard.events import EventLog
from sitl.onboard.executor import Executor, Progress
from sitl.onboard.following import Following
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.homing import Homing, Stage
from sitl.onboard.landing import Landing
from sitl.onboard.mission import LEAST_HEIGHT_M, Mission, MissionState
from sitl.onboard.modes import ACCEPTED, EventKind, Landed, Mode, Outcome, Severity, Verdict
from sitl.onboard.offboard import Offboard
from sitl.onboard.parameters import Parameters
from sitl.onboard.places import Places
from sitl.onboard.sticks import Sticks
from sitl.onboard.takeoff import Takeoff
from sitl.onboard.transitions import AFTER, ENTRY, LOSSES, Happening, after
from sitl.quaternion import Vec3

__all__ = ["AFTER", "ENTRY", "Commander", "Happening"]


class Commander:
    """Decides; the cascade flies. `tick` turns the present mode into guidance every 20 ms and after each request."""

    def __init__(
        self,
        parameters: Parameters,
        mission: Mission,
        offboard: Offboard,
        events: EventLog,
        origin: GeoPoint,
        heading_rad: float,
    ) -> None:
        self._p, self._mission, self._offboard, self._events = parameters, mission, offboard, events
        self.mode = Mode.HOLD
        self.armed = False
        self.failsafe = ""
        self.changed = True
        self.home_heading_rad = heading_rad
        self._places = Places(origin)
        self._guide = Guide(parameters, heading_rad)
        self._landing = Landing(parameters, self._guide)
        self._takeoff = Takeoff(parameters, self._guide, self._places)
        self._following = Following(offboard, self._guide)
        self._homing = Homing(parameters, self._guide, self._landing, self._places)
        self._sticks = Sticks(parameters)
        self._executor = Executor(mission, parameters, events, self._guide, self._places, self.set_home)
        self._terminated = False
        self._contact = ground.Contact(Effort.OFF, Landed.ON_GROUND)
        self._tilt = ground.Tilt()
        self._fix = Fix.at_rest(0, heading_rad)
        self._stations_lost = False
        self.guidance = self._guidance()

    # what others may know

    @property
    def origin(self) -> GeoPoint:
        return self._places.origin

    @property
    def home(self) -> GeoPoint:
        return self._places.home

    @property
    def home_N(self) -> Vec3:
        return self._places.home_N

    @property
    def standing(self) -> bool:
        """On the ground with motors idling or off."""
        return self._contact.standing

    @property
    def landed(self) -> Landed:
        return self._contact.landed

    @property
    def tipped_over(self) -> bool:
        return self._tilt.tipped_over

    @tipped_over.setter
    def tipped_over(self, lies: bool) -> None:
        self._tilt = ground.Tilt(lies)

    # the present

    def observe(self, now_us: int, nav: NavState, feet_down: int) -> None:
        """The vehicle as it is now; requests are judged by it."""
        self._fix = Fix(now_us, nav, feet_down)

    def tick(self, now_us: int, nav: NavState, feet_down: int) -> Guidance:
        """Decide for the next control steps."""
        self.observe(now_us, nav, feet_down)
        self.changed = False
        self._watch_tilt()
        if self.armed:
            self._MODES[self.mode](self)
            self._watch_ground()
        elif self.landed is not Landed.ON_GROUND and (feet_down > 0 or self.tipped_over):
            self._now_in(self._contact._replace(landed=Landed.ON_GROUND))
        self.guidance = self._guidance()
        return self.guidance

    def _guidance(self) -> Guidance:
        aloft = 0.0 if self._fix.feet_down > 0 else 1.0
        return Guidance(int(self._contact.effort), self._guide.trajectory, *self._guide.follow, aloft)

    # requests

    def ready_to_arm(self) -> Outcome:
        """Pre-arm checks; the reason names the first that fails."""
        if self.armed:
            return ACCEPTED
        fix = self._fix
        on_feet, moving = fix.feet_down > 0, fix.speed_m_s > arming.MOVING_M_S
        landing = self.mode in (Mode.LAND, Mode.RETURN)
        return arming.check(arming.Condition(self.tipped_over, on_feet, moving, self._terminated, landing))

    def arm(self, force: bool = False) -> Outcome:
        if self.armed:
            return ACCEPTED
        ready = self.ready_to_arm()
        if not ready.ok and (not force or self._terminated):
            self._tell(Severity.CRITICAL, f"arming refused: {ready.reason}")
            return ready
        self.armed, self.failsafe, self.changed = True, "", True
        self._now_in(ground.Contact(Effort.IDLE if self._fix.feet_down > 0 else Effort.FLY, self.landed))
        self._guide.rest_here(self._fix)
        self._events.add(EventKind.ARMED, Severity.INFO, "armed", 1)
        self._begin(self.mode)
        return ACCEPTED

    def disarm(self, force: bool = False) -> Outcome:
        if not self.armed:
            return ACCEPTED
        if not self.standing and not force:
            self._tell(Severity.CRITICAL, "disarming refused: in the air")
            return Outcome(Verdict.TEMPORARILY_REJECTED, "disarming refused: in the air")
        self._disarm()
        return ACCEPTED

    def set_mode(self, mode: Mode) -> Outcome:
        """Enter a mode, if what ENTRY asks of it holds."""
        for condition in ENTRY[mode]:
            reason = _CONDITIONS[condition](self)
            if reason:
                self._tell(Severity.WARNING, f"{mode.value} refused: {reason}")
                return Outcome(Verdict.DENIED if mode is Mode.OFFBOARD else Verdict.TEMPORARILY_REJECTED, reason)
        self._switch(mode)
        return ACCEPTED

    def takeoff(self, altitude_amsl_m: float | None = None, heading_rad: float | None = None) -> Outcome:
        """Climb to an altitude (None: MIS_TAKEOFF_ALT above home), now or as soon as armed."""
        outcome = self._takeoff.ask(altitude_amsl_m, heading_rad)
        if not outcome.ok:
            self._tell(Severity.WARNING, outcome.reason)
            return outcome
        self._switch(Mode.TAKEOFF)
        return ACCEPTED

    def land(self) -> Outcome:
        return self.set_mode(Mode.LAND)

    def return_home(self) -> Outcome:
        return self.set_mode(Mode.RETURN)

    def hold(self) -> Outcome:
        return self.set_mode(Mode.HOLD)

    def start_mission(self, first: int = 0) -> Outcome:
        outcome = self._mission.set_current(first) if self._mission.items else ACCEPTED
        if not outcome.ok:
            self._tell(Severity.WARNING, f"mission refused: {outcome.reason}")
            return outcome
        return self.set_mode(Mode.MISSION)

    def reposition(
        self,
        north_m: float | None,
        east_m: float | None,
        down_m: float | None,
        heading_rad: float | None = None,
        speed_m_s: float | None = None,
    ) -> Outcome:
        """Fly to a point and hold there. None or NaN keeps that coordinate, as far as a smooth stop allows."""
        if not self.armed or self.standing:
            return Outcome(Verdict.TEMPORARILY_REJECTED, "reposition refused: not flying")
        values = [None if v is None or math.isnan(v) else v for v in (north_m, east_m, down_m, heading_rad, speed_m_s)]
        if any(v is not None and abs(v) > 1e5 for v in values[:3]):  # also if infinite
            return Outcome(Verdict.DENIED, "reposition refused: further than 100 km")
        if values[2] is not None and values[2] > -LEAST_HEIGHT_M:
            return Outcome(Verdict.DENIED, f"reposition refused: lower than {LEAST_HEIGHT_M:g} m above the ground")
        self._switch(Mode.HOLD)
        if any(v is not None for v in values[:4]):
            north, east, down, heading, speed = values
            self._guide.reach(self._fix, (north, east, down), heading, speed)
        return ACCEPTED

    def change_speed(self, speed_m_s: float) -> Outcome:
        """Cruise speed until the mode is left."""
        if not (math.isfinite(speed_m_s) and 0.0 < speed_m_s <= self._p["MPC_XY_VEL_MAX"]):
            reason = f"speed must be above 0 and at most MPC_XY_VEL_MAX, {self._p['MPC_XY_VEL_MAX']:g} m/s"
            return Outcome(Verdict.DENIED, reason)
        self._guide.speed_m_s = speed_m_s
        return ACCEPTED

    def set_home(self, point: GeoPoint | None, heading_rad: float | None = None) -> Outcome:
        """Home at a point, or where the vehicle is (None)."""
        outcome = self._places.move_home(self._places.global_of(self._fix.position_N) if point is None else point)
        if not outcome.ok:
            return outcome
        self.home_heading_rad = (
            self._fix.heading_rad if heading_rad is None or not math.isfinite(heading_rad) else heading_rad
        )
        self._events.add(EventKind.HOME, Severity.INFO, "home moved")
        return ACCEPTED

    def manual(self, x: float, y: float, z: float, r: float) -> None:
        """Sticks, −1 … 1: forward, right, up, clockwise; they fly in Position mode."""
        self._sticks.submit((x, y, z, r), self._fix.now_us)

    def terminate(self) -> Outcome:
        """Stop the motors for good, wherever the vehicle is."""
        self._terminated = True
        self._tell(Severity.EMERGENCY, "flight terminated")
        if self.armed:
            self._disarm()
        self.failsafe = "flight terminated"
        return ACCEPTED

    def link_lost(self, lost: bool) -> None:
        """Told by the link when all ground stations fall silent (wall time), and when one is back."""
        if lost and not self._stations_lost and self.armed:
            self._happened(Happening.STATIONS_LOST)
        elif not lost and self.failsafe == Happening.STATIONS_LOST.value:
            self.failsafe = ""
        self._stations_lost = lost

    def reboot(self) -> Outcome:
        """Whether a reboot may go ahead."""
        return Outcome(Verdict.TEMPORARILY_REJECTED, "reboot refused: armed") if self.armed else ACCEPTED

    def restart(self, heading_rad: float) -> None:
        """As after power-on: disarmed in Hold at the start point; home, plan and parameters stay."""
        self.mode, self.armed, self.failsafe = Mode.HOLD, False, ""
        self._terminated, self.changed, self.tipped_over = False, True, False
        self._contact = ground.Contact(Effort.OFF, Landed.ON_GROUND)
        self._fix = Fix.at_rest(self._fix.now_us, heading_rad)
        self._takeoff.forget()
        self._sticks.centre()
        self._guide.standing, self._guide.speed_m_s = True, None
        self._guide.put(rest_at(0.0, 0.0, 0.0, heading_rad))
        self.guidance = self._guidance()

    # modes

    def _switch(self, mode: Mode) -> None:
        self.changed = True
        if mode is not self.mode:
            if self.mode is Mode.MISSION:
                self._executor.leave()
            self._guide.speed_m_s = None
            self.mode = mode
            self.failsafe = ""
            self._events.add(EventKind.MODE, Severity.INFO, mode.value)
        if self.armed:
            self._begin(mode)

    def _begin(self, mode: Mode) -> None:
        """Put the first trajectory of a mode in force."""
        fix, guide = self._fix, self._guide
        if self.standing:
            self._contact = self._contact._replace(down_since_us=None)
        if mode in (Mode.HOLD, Mode.POSITION):
            guide.stop(fix)
            self._sticks.centre()
        elif mode is Mode.TAKEOFF:
            self._takeoff.start(fix)
        elif mode is Mode.LAND:
            self._landing.start(fix)
        elif mode is Mode.RETURN:
            self._homing.start(fix)
        elif mode is Mode.MISSION:
            self._executor.start(fix)
        elif mode is Mode.OFFBOARD:
            self._following.start()

    def _tick_position(self) -> None:
        if self._sticks.lost(self._fix.now_us):
            self._happened(Happening.STICKS_LOST)
        elif self._sticks.deflected or not self.standing:
            self._sticks.tick(self._fix, self._guide)

    def _tick_takeoff(self) -> None:
        if self._guide.done(self._fix) and not self.standing:
            self._happened(Happening.HEIGHT_REACHED)

    def _tick_mission(self) -> None:
        progress = self._executor.tick(self._fix)
        if progress is Progress.COMPLETE and not (self.standing and self._executor.landing):
            self._happened(Happening.MISSION_COMPLETE)
        elif progress is Progress.RETURN:
            self._happened(Happening.RETURN_ITEM)

    def _tick_offboard(self) -> None:
        if self._offboard.lost(self._fix.now_us):
            self._happened(Happening.TARGETS_LOST)
        else:
            self._following.tick(self._fix)

    _MODES: dict[Mode, Callable[["Commander"], None]] = {  # noqa: RUF012
        Mode.HOLD: lambda self: None,
        Mode.POSITION: _tick_position,
        Mode.TAKEOFF: _tick_takeoff,
        Mode.LAND: lambda self: self._landing.tick(self._fix),
        Mode.RETURN: lambda self: self._homing.tick(self._fix),
        Mode.MISSION: _tick_mission,
        Mode.OFFBOARD: _tick_offboard,
    }

    def _happened(self, happening: Happening) -> None:
        """Go where AFTER points."""
        follows = after(self.mode, happening, self._p)
        if follows is None:
            return
        loss = happening in LOSSES
        self._tell(Severity.WARNING if loss else Severity.INFO, f"{happening.value}: {follows.value}")
        self._switch(follows)
        if loss:
            self.failsafe = happening.value

    # ground and attitude

    def _watch_ground(self) -> None:
        """Decide between idling on the ground and flying; disarm after a landing."""
        fix, stood = self._fix, self.standing
        high = fix.nav.down_m < -ground.NEAR_GROUND_M and not fix.feet_down
        if high and self.landed is Landed.IN_AIR and not self._is_landing() and self.mode is not Mode.TAKEOFF:
            return  # nothing that the reference could change
        r = self._guide.reference(fix)
        intent = ground.Intent(self.mode is Mode.TAKEOFF, self._is_landing())
        self._now_in(ground.contact(self._contact, fix.now_us, fix.nav, fix.feet_down, r, intent))
        if not stood:
            if self.standing and intent.landing:
                self._guide.put(rest_at(fix.nav.north_m, fix.nav.east_m, 0.0, r.heading_rad))
            return
        finished = intent.landing or (self.mode is Mode.MISSION and self._mission.state is MissionState.COMPLETE)
        if self.standing and finished and self._contact.standing_s(fix.now_us) >= self._p["COM_DISARM_LAND"]:
            self._disarm()

    def _now_in(self, contact: ground.Contact) -> None:
        landed, self._contact = self.landed, contact
        self._guide.standing = contact.standing
        if contact.landed is not landed:
            self._events.add(EventKind.LANDED, Severity.INFO, contact.landed.value)

    def _is_landing(self) -> bool:
        return (
            self.mode is Mode.LAND
            or (self.mode is Mode.RETURN and self._homing.stage is Stage.LAND)
            or (self.mode is Mode.MISSION and self._executor.landing)
        )

    def _watch_tilt(self) -> None:
        """Notice a vehicle that lies on the ground, and stop its motors."""
        fix, before = self._fix, self.tipped_over
        self._tilt = ground.tilt(self._tilt, fix.now_us, fix.nav, fix.feet_down)
        if self.tipped_over and not before:
            self._tell(Severity.CRITICAL, "the vehicle has tipped over: motors stopped")
            if self.armed:
                self._disarm()

    def _disarm(self) -> None:
        self.armed = False
        self.changed = True
        landed = Landed.ON_GROUND if self._fix.feet_down or self.tipped_over else self.landed
        self._now_in(ground.Contact(Effort.OFF, landed))
        self._guide.rest_here(self._fix)
        self._events.add(EventKind.ARMED, Severity.INFO, "disarmed", 0)
        self._happened(Happening.DISARMED)
        self.failsafe = ""

    def _tell(self, severity: Severity, text: str) -> None:
        self._events.tell(severity, text)


_CONDITIONS: dict[str, Callable[[Commander], str]] = {
    "has_mission": lambda c: "" if c._mission.items else "there is no mission",
    "streaming": lambda c: (
        "" if c._offboard.streaming(c._fix.now_us) else "no stream of targets above 2 Hz in the last second"
    ),
}
