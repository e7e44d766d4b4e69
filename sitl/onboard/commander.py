"""The commander: arming, modes and what happens when something goes missing.

Which modes can be entered and which follow stands in two tables, ENTRY and AFTER (transitions). What is flown in each
mode is the matter of its own class; the commander puts it in force and ends it.
"""

import math
from collections.abc import Callable

from sitl.control.guidance import Guidance
from sitl.control.reference import rest_at
from sitl.geodesy import GeoPoint
from sitl.navigation import NavState
from sitl.onboard import arming
from sitl.onboard.calm import FOREVER, Calm, before_us
from sitl.onboard.events import EventLog
from sitl.onboard.flight import FACING, Flight
from sitl.onboard.footing import Footing
from sitl.onboard.gaze import Gaze, Look
from sitl.onboard.guide import Fix
from sitl.onboard.guided import Guided
from sitl.onboard.mission import MissionState
from sitl.onboard.modes import ACCEPTED, EventKind, Landed, Mode, Outcome, Severity, Verdict
from sitl.onboard.offboard import Offboard
from sitl.onboard.parameters import Parameters
from sitl.onboard.plans import Plans
from sitl.onboard.transitions import AFTER, ENTRY, LOSSES, Happening, after
from sitl.onboard.watch import Watch
from sitl.quaternion import Vec3

__all__ = ["AFTER", "ENTRY", "Commander", "Happening"]

_ASKED_WRONGLY = (Mode.OFFBOARD, Mode.ORBIT)  # a refusal is the request's fault, not the moment's


class Commander:
    """Decides; the cascade flies. `tick` turns the present mode into guidance every 20 ms and after each request."""

    def __init__(
        self,
        parameters: Parameters,
        plans: Plans,
        offboard: Offboard,
        events: EventLog,
        heading_rad: float,
    ) -> None:
        mission, places = plans.mission, plans.places
        self._p, self._mission, self._offboard, self._events = parameters, mission, offboard, events
        self._places, self.geofence = places, plans.geofence
        self.mode = Mode.HOLD
        self.armed = False
        self.failsafe = ""
        self.changed = True
        self.home_heading_rad = heading_rad
        self._flight = Flight(
            parameters,
            plans,
            offboard,
            events,
            heading_rad,
            enter=self._switch,
            flying=lambda: self.armed and not self.standing,
            set_home=self.set_home,
        )
        self._guide = self._flight.guide
        self._footing = Footing(self._guide, events)
        self._watch = Watch(parameters, plans, events, self._happened)
        self._terminated = False
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
    def guided(self) -> Guided:
        """What can be flown on request in Hold and Orbit."""
        return self._flight.guided

    @property
    def gaze(self) -> Gaze:
        return self._flight.gaze

    @property
    def standing(self) -> bool:
        """On the ground with motors idling or off."""
        return self._footing.standing

    @property
    def landed(self) -> Landed:
        return self._footing.landed

    @property
    def tipped_over(self) -> bool:
        return self._footing.tipped_over

    # the present

    def observe(self, now_us: int, nav: NavState, feet_down: int) -> None:
        """The vehicle as it is now; requests are judged by it."""
        self._fix = Fix(now_us, nav, feet_down)
        self.guided.observe(self._fix)

    def tick(self, now_us: int, nav: NavState, feet_down: int) -> Guidance:
        """Decide for the next control steps."""
        self.observe(now_us, nav, feet_down)
        self.changed = False
        self._watch_tilt()
        self._watch.mission(self._fix, self.armed and self.mode is Mode.MISSION)
        if self.armed:
            happening = self._flight.tick(self.mode, self._fix)
            if happening is not None:
                self._happened(happening)
            self._flight.face(self.mode, self._fix)
            self._watch_ground()
            if self._watch.fence(self._fix, not self.standing):
                self.terminate()
        else:
            self._footing.rest(feet_down)
        self.guidance = self._guidance()
        return self.guidance

    def calm(self) -> Calm | None:
        """What the ticks after the last one wait for, requests apart; None: the next may change something."""
        mode, intent = self.mode, self._flight.intent(self.mode)
        ground = self._footing.waits(self.armed, intent)
        if self.changed or ground is None or (self.armed and self._watch.fenced):
            return None
        wait = self._flight.waits(mode, self._fix) if self.armed else FOREVER
        if wait is None:
            return None
        until_us = before_us(wait.until_s)
        if self.armed and self.standing and self._finished(intent.landing):
            stands_s = self._footing.standing_s(self._fix.now_us)
            until_us = min(until_us, before_us(self._fix.t_s + self._p["COM_DISARM_LAND"] - stands_s))
        return Calm(until_us, ground, wait.near_N, wait.near_m)

    def battery_lasts(self, remaining: float) -> float:
        """How full the battery is when `watch_battery` may next do something."""
        return self._watch.battery_lasts(remaining)

    def _guidance(self) -> Guidance:
        guide, aloft = self._guide, 0.0 if self._fix.feet_down > 0 else 1.0
        return Guidance(int(self._footing.effort), guide.trajectory, *guide.follow, aloft, guide.steering)

    # requests

    def ready_to_arm(self) -> Outcome:
        """Pre-arm checks; the reason names the first that fails."""
        if self.armed:
            return ACCEPTED
        fix = self._fix
        on_feet, moving = fix.feet_down > 0, fix.speed_m_s > arming.MOVING_M_S
        landing = self.mode in (Mode.LAND, Mode.RETURN)
        violation = self.geofence.violation(fix.position_N)
        outside = violation.reason if violation else ""
        return arming.check(arming.Condition(self.tipped_over, on_feet, moving, self._terminated, landing, outside))

    def arm(self, force: bool = False) -> Outcome:
        if self.armed:
            return ACCEPTED
        ready = self.ready_to_arm()
        if not ready.ok and (not force or self._terminated):
            self._tell(Severity.CRITICAL, f"arming refused: {ready.reason}")
            return ready
        self.armed, self.failsafe, self.changed = True, "", True
        self._footing.run(self._fix.feet_down)
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
                return Outcome(Verdict.DENIED if mode in _ASKED_WRONGLY else Verdict.TEMPORARILY_REJECTED, reason)
        if mode is not Mode.ORBIT:  # which is flown already
            self._switch(mode)
        return ACCEPTED

    def takeoff(self, altitude_amsl_m: float | None = None, heading_rad: float | None = None) -> Outcome:
        """Climb to an altitude (None: MIS_TAKEOFF_ALT above home), now or as soon as armed."""
        outcome = self._flight.takeoff.ask(altitude_amsl_m, heading_rad)
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

    def change_speed(self, speed_m_s: float) -> Outcome:
        """Cruise speed until the mode is left."""
        if not (math.isfinite(speed_m_s) and 0.0 < speed_m_s <= self._p["MPC_XY_VEL_MAX"]):
            reason = f"speed must be above 0 and at most MPC_XY_VEL_MAX, {self._p['MPC_XY_VEL_MAX']:g} m/s"
            return Outcome(Verdict.DENIED, reason)
        self._guide.speed_m_s = speed_m_s
        return ACCEPTED

    def face(self, point_N: Vec3) -> Outcome:
        """Turn toward a place, and keep facing it until the mode changes."""
        if self.mode not in FACING:
            return Outcome(Verdict.TEMPORARILY_REJECTED, f"there is nothing to face in {self.mode.value}")
        self.gaze.at(Look.POINT, point_N)
        return ACCEPTED

    def set_home(self, point: GeoPoint | None, heading_rad: float | None = None) -> Outcome:
        """Home at a point, or where the vehicle is (None)."""
        point = self._places.global_of(self._fix.position_N) if point is None else point
        objection = self.geofence.shut_out(point)
        outcome = Outcome(Verdict.DENIED, f"home {objection}") if objection else self._places.move_home(point)
        if not outcome.ok:
            return outcome
        self.home_heading_rad = (
            self._fix.heading_rad if heading_rad is None or not math.isfinite(heading_rad) else heading_rad
        )
        self._events.add(EventKind.HOME, Severity.INFO, "home moved")
        return ACCEPTED

    def manual(self, x: float, y: float, z: float, r: float) -> None:
        """Sticks, −1 … 1: forward, right, up, clockwise; they fly in Position mode."""
        self._flight.sticks.submit((x, y, z, r), self._fix.now_us)

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
        self._terminated, self.changed = False, True
        self._footing.restart()
        self._watch.restart()
        self._fix = Fix.at_rest(self._fix.now_us, heading_rad)
        self._flight.restart(heading_rad)
        self.guidance = self._guidance()

    # modes

    def _switch(self, mode: Mode) -> None:
        self.changed = True
        self.guided.leave()
        if mode is not self.mode:
            self._flight.leave(self.mode, mode)
            self.mode = mode
            self.failsafe = ""
            self._events.add(EventKind.MODE, Severity.INFO, mode.value)
        if self.armed:
            self._begin(mode)

    def _begin(self, mode: Mode) -> None:
        self._footing.stand_anew()
        self._flight.begin(mode, self._fix)

    def _happened(self, happening: Happening, detail: str = "") -> None:
        """Go where AFTER points; with a detail it is told even where it points nowhere."""
        follows = after(self.mode, happening, self._p)
        loss = happening in LOSSES
        parts = [happening.value, detail, follows.value if follows else ""]
        if follows is not None or detail:
            self._tell(Severity.WARNING if loss else Severity.INFO, ": ".join(part for part in parts if part))
        if follows is None:
            return
        self._switch(follows)
        if loss:
            self.failsafe = happening.value

    # what is watched in every mode

    def _watch_ground(self) -> None:
        """Decide between idling on the ground and flying; disarm after a landing."""
        fix, intent = self._fix, self._flight.intent(self.mode)
        if self._footing.watch(fix, intent) and intent.landing:
            heading = self._guide.reference(fix).heading_rad
            self._guide.put(rest_at(fix.nav.north_m, fix.nav.east_m, 0.0, heading))
        if not (self.standing and self._finished(intent.landing)):
            return
        if self._footing.standing_s(fix.now_us) >= self._p["COM_DISARM_LAND"]:
            self._disarm()

    def _finished(self, landing: bool) -> bool:
        """Whether a vehicle that has come to stand has nothing more to do in the air."""
        return landing or (self.mode is Mode.MISSION and self._mission.state is MissionState.COMPLETE)

    def _watch_tilt(self) -> None:
        """Stop the motors of a vehicle that lies on the ground."""
        if self._footing.watch_tilt(self._fix):
            self._tell(Severity.CRITICAL, "the vehicle has tipped over: motors stopped")
            if self.armed:
                self._disarm()

    def watch_battery(self, remaining: float) -> None:
        """Told by the vehicle how full its battery is, 0 … 1."""
        self._watch.battery(remaining, self.armed)

    def _disarm(self) -> None:
        self.armed = False
        self.changed = True
        self._footing.stop(self._fix.feet_down)
        self._guide.rest_here(self._fix)
        self._events.add(EventKind.ARMED, Severity.INFO, "disarmed", 0)
        self.guided.leave()
        self._happened(Happening.DISARMED)
        self.failsafe = ""

    def _tell(self, severity: Severity, text: str) -> None:
        self._events.tell(severity, text)


_CONDITIONS: dict[str, Callable[[Commander], str]] = {
    "has_mission": lambda c: "" if c._mission.items else "there is no mission",
    "mission_inside": lambda c: c._watch.mission_objection(c._fix),
    "asked_to_orbit": lambda c: "" if c.mode is Mode.ORBIT else "it takes a centre and a radius: command DO_ORBIT",
    "targets_alive": lambda c: (
        f"no target in the last {c._p['COM_OF_LOSS_T']:g} s" if c._offboard.lost(c._fix.now_us) else ""
    ),
}
