"""The commander: arming, modes and what happens when something goes missing.

Modes and how they are entered and left stand in two tables. ENTRY says what must hold for a mode to be taken on
request. AFTER says which mode follows when something ends the present one:

    Takeoff ── height reached ─▶ Hold          Offboard ── targets lost ─▶ by COM_OBL_RC_ACT
    Mission ── complete ───────▶ Hold          Position ── sticks lost ──▶ Hold
    Mission ── return item ────▶ Return        any in the air ── ground stations lost ─▶ by NAV_DLL_ACT
    Land, Return, Mission ── landed and disarmed ─▶ Hold
"""

import math
from collections.abc import Callable
from enum import Enum

from sitl.control.guidance import Effort, Guidance
from sitl.control.reference import rest_at
from sitl.geodesy import GeoPoint, to_global, to_local
from sitl.navigation import NavState
from sitl.onboard import arming
from sitl.onboard.events import EventLog
from sitl.onboard.executor import Executor, Places, Progress
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.landing import Landing
from sitl.onboard.mission import Mission, MissionState
from sitl.onboard.modes import ACCEPTED, EventKind, Landed, Mode, Outcome, Severity, Verdict
from sitl.onboard.offboard import Offboard
from sitl.onboard.parameters import Parameters
from sitl.onboard.sticks import Sticks
from sitl.onboard.trajectory import at
from sitl.quaternion import Vec3


class Happening(Enum):
    """What can end a mode from within."""

    HEIGHT_REACHED = "take-off height reached"
    MISSION_COMPLETE = "mission complete"
    RETURN_ITEM = "mission returns home"
    DISARMED = "landed and disarmed"
    TARGETS_LOST = "offboard targets lost"
    STICKS_LOST = "stick input lost"
    STATIONS_LOST = "ground stations lost"


ENTRY: dict[Mode, tuple[str, ...]] = {
    Mode.POSITION: (),
    Mode.TAKEOFF: (),
    Mode.HOLD: (),
    Mode.MISSION: ("has_mission",),
    Mode.RETURN: (),
    Mode.LAND: (),
    Mode.OFFBOARD: ("streaming",),
}

_BY_LOSS_ACTION = {0: Mode.HOLD, 1: Mode.LAND, 2: Mode.RETURN}  # COM_OBL_RC_ACT
_BY_LINK_ACTION = {1: Mode.HOLD, 2: Mode.RETURN, 3: Mode.LAND}  # NAV_DLL_ACT
AFTER: dict[tuple[Mode, Happening], Mode | str] = {
    (Mode.TAKEOFF, Happening.HEIGHT_REACHED): Mode.HOLD,
    (Mode.MISSION, Happening.MISSION_COMPLETE): Mode.HOLD,
    (Mode.MISSION, Happening.RETURN_ITEM): Mode.RETURN,
    (Mode.MISSION, Happening.DISARMED): Mode.HOLD,
    (Mode.LAND, Happening.DISARMED): Mode.HOLD,
    (Mode.RETURN, Happening.DISARMED): Mode.HOLD,
    (Mode.OFFBOARD, Happening.TARGETS_LOST): "COM_OBL_RC_ACT",
    (Mode.POSITION, Happening.STICKS_LOST): Mode.HOLD,
    **{(mode, Happening.STATIONS_LOST): "NAV_DLL_ACT" for mode in Mode if mode not in (Mode.LAND, Mode.RETURN)},
}

_LIFT_M, _LIFT_M_S = 0.03, 0.001  # a reference this far above the ground, or rising so fast, means to fly
_TOUCH_M, _TOUCH_M_S = 0.02, 0.3
_REST_S = 0.4  # a reference that rests on the ground so long, with the vehicle just above it, lets it down
_NEAR_GROUND_M = 0.6
_TIPPED = -0.5  # nose's down component above which the vehicle is 60° or more from upright
_TIPPED_S = 0.3
_CARRY_S = 0.2  # after a target's age passes this, offboard flight comes to rest until the next one
_RETURN_CLOSE_M = 1.0  # a return from closer than this does not climb first


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
        self.landed = Landed.ON_GROUND
        self.failsafe = ""
        self.tipped_over = False
        self.changed = True
        self.home_heading_rad = heading_rad
        self._places = Places(origin)
        self._guide = Guide(parameters, heading_rad)
        self._landing = Landing(parameters, self._guide)
        self._sticks = Sticks(parameters)
        self._executor = Executor(mission, parameters, events, self._guide, self._places, self._mission_home)
        self._terminated = False
        self._effort = Effort.OFF
        self._fix = Fix(0, NavState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 4)
        self._down_since_us: int | None = None  # standing with idling motors
        self._rest_since_us: int | None = None  # the reference rests on the ground, the vehicle just above
        self._tipped_since_us: int | None = None
        self._offboard_seen = -1
        self._takeoff_height: tuple[float | None, float | None] = (None, None)  # AMSL, heading
        self._return_stage = 0
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
        return self._effort != Effort.FLY

    # the present

    def observe(self, now_us: int, nav: NavState, feet_down: int) -> None:
        """The vehicle as it is now; requests are judged by it."""
        self._fix = Fix(now_us, nav, feet_down)

    def tick(self, now_us: int, nav: NavState, feet_down: int) -> Guidance:
        """Decide for the next control steps."""
        self.observe(now_us, nav, feet_down)
        self.changed = False
        self._watch_attitude()
        if self.armed:
            self._MODES[self.mode](self)
            self._watch_ground()
        self.guidance = self._guidance()
        return self.guidance

    def _guidance(self) -> Guidance:
        return Guidance(int(self._effort), self._guide.trajectory, *self._guide.follow)

    # requests

    def ready_to_arm(self) -> Outcome:
        """Pre-arm checks; the reason names the first that fails."""
        n = self._fix.nav
        moving = math.hypot(n.v_north_m_s, n.v_east_m_s, n.v_down_m_s) > 0.5
        on_feet = self._fix.feet_down > 0
        return arming.check(arming.Condition(self.tipped_over, on_feet or self.armed, moving and not self.armed,
                                             self._terminated))  # fmt: skip

    def arm(self, force: bool = False) -> Outcome:
        if self.armed:
            return ACCEPTED
        ready = self.ready_to_arm()
        if not ready.ok and (not force or self._terminated):
            self._tell(Severity.CRITICAL, f"arming refused: {ready.reason}")
            return ready
        self.armed, self.failsafe, self.changed = True, "", True
        self._effort = Effort.IDLE if self._fix.feet_down > 0 else Effort.FLY
        self._down_since_us = None
        self._offboard_seen = -1
        self._guide.rest_here(self._fix)
        self._events.add(EventKind.ARMED, Severity.INFO, "armed", 1)
        self._begin(self.mode)
        return ACCEPTED

    def disarm(self, force: bool = False) -> Outcome:
        if not self.armed:
            return ACCEPTED
        if not self.standing and not force:
            reason = "disarming refused: in the air"
            self._tell(Severity.CRITICAL, reason)
            return Outcome(Verdict.TEMPORARILY_REJECTED, reason)
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
        if altitude_amsl_m is not None and not math.isfinite(altitude_amsl_m):
            altitude_amsl_m = None
        if altitude_amsl_m is not None and not 0.2 <= altitude_amsl_m - self.origin.alt_amsl_m <= 1000.0:
            low, high = self.origin.alt_amsl_m + 0.2, self.origin.alt_amsl_m + 1000.0
            reason = f"take-off altitude {altitude_amsl_m:.1f} m AMSL is outside {low:.1f} … {high:.1f}"
            self._tell(Severity.WARNING, reason)
            return Outcome(Verdict.DENIED, reason)
        self._takeoff_height = (altitude_amsl_m, heading_rad)
        self._switch(Mode.TAKEOFF)
        return ACCEPTED

    def land(self) -> Outcome:
        return self.set_mode(Mode.LAND)

    def return_home(self) -> Outcome:
        return self.set_mode(Mode.RETURN)

    def hold(self) -> Outcome:
        return self.set_mode(Mode.HOLD)

    def start_mission(self, first: int = 0) -> Outcome:
        if not self._mission.items:
            return self.set_mode(Mode.MISSION)
        outcome = self._mission.set_current(first)
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
        """Fly to a point and hold there. None or NaN keeps that coordinate."""
        if not self.armed or self.standing:
            return Outcome(Verdict.TEMPORARILY_REJECTED, "reposition refused: not flying")
        values = [None if v is None or math.isnan(v) else v for v in (north_m, east_m, down_m, heading_rad, speed_m_s)]
        if any(v is not None and abs(v) > 1e5 for v in values[:3]):
            return Outcome(Verdict.DENIED, "reposition refused: further than 100 km")
        self._switch(Mode.HOLD)
        end = at(self._guide.trajectory, self._guide.trajectory.end_s)
        point = [e if v is None else v for v, e in zip(values, (end.north_m, end.east_m, end.down_m), strict=False)]
        if any(v is not None for v in values[:4]):
            speed = values[4] if values[4] is not None and values[4] > 0.0 else None
            self._guide.go(self._fix, (point[0], point[1], min(point[2], -0.1)), values[3], speed)
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
        if point is None:
            n = self._fix.nav
            lat, lon = to_global(self.origin, n.north_m, n.east_m)
            point = GeoPoint(lat, lon, self.origin.alt_amsl_m - n.down_m)
        elif not (abs(point.lat_deg) <= 90.0 and abs(point.lon_deg) <= 180.0 and abs(point.alt_amsl_m) < 1e5):
            return Outcome(Verdict.DENIED, "home is not a place on Earth")
        north, east = to_local(self.origin, point.lat_deg, point.lon_deg)
        if math.hypot(north, east) > 1e5:
            return Outcome(Verdict.DENIED, "home is further than 100 km from the start point")
        self._places.home = point
        self._places.home_N = (north, east, self.origin.alt_amsl_m - point.alt_amsl_m)
        self.home_heading_rad = self._fix.heading_rad if heading_rad is None else heading_rad
        self._events.add(EventKind.HOME, Severity.INFO, "home moved")
        return ACCEPTED

    def manual(self, x: float, y: float, z: float, r: float) -> None:
        """Sticks, −1 … 1: forward, right, up, clockwise; they fly in Position mode."""
        self._sticks.submit((x, y, z, r), self._fix.now_us)

    def terminate(self) -> Outcome:
        """Stop the motors for good, wherever the vehicle is."""
        self._terminated = True
        self.failsafe = "flight terminated"
        self._tell(Severity.EMERGENCY, "flight terminated")
        if self.armed:
            self._disarm()
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
        if self.armed:
            return Outcome(Verdict.TEMPORARILY_REJECTED, "reboot refused: armed")
        return ACCEPTED

    def restart(self, heading_rad: float) -> None:
        """As after power-on: disarmed in Hold at the start point; home, plan and parameters stay."""
        self.mode, self.armed, self.failsafe = Mode.HOLD, False, ""
        self.tipped_over = self._terminated = False
        self._effort, self.landed, self.changed = Effort.OFF, Landed.ON_GROUND, True
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
        if mode in (Mode.HOLD, Mode.POSITION):
            if not self.standing:
                guide.stop(fix)
            self._sticks.centre()
        elif mode is Mode.TAKEOFF:
            altitude, heading_rad = self._takeoff_height
            if altitude is None:
                altitude = self.home.alt_amsl_m + self._p["MIS_TAKEOFF_ALT"]
            down = self.origin.alt_amsl_m - altitude
            r = guide.reference(fix)
            guide.go(fix, (r.north_m, r.east_m, down), heading_rad)
        elif mode is Mode.LAND:
            self._landing.start(fix)
        elif mode is Mode.RETURN:
            self._begin_return(fix)
        elif mode is Mode.MISSION:
            self._executor.start(fix)
        elif mode is Mode.OFFBOARD:
            self._offboard_seen = -1

    def _begin_return(self, fix: Fix) -> None:
        home = self.home_N
        away = math.dist(home[:2], fix.position_N[:2])
        height = min(fix.nav.down_m, home[2] - self._p["RTL_RETURN_ALT"])
        if self.standing or away < _RETURN_CLOSE_M:
            self._return_stage = 2
            self._landing.start(fix)
            return
        self._return_stage = 0
        self._guide.go(fix, (fix.nav.north_m, fix.nav.east_m, height))

    def _tick_hold(self) -> None:
        pass

    def _tick_position(self) -> None:
        if self._sticks.lost(self._fix.now_us):
            self._happened(Happening.STICKS_LOST)
        elif self._sticks.deflected or not self.standing:
            self._sticks.tick(self._fix, self._guide)

    def _tick_takeoff(self) -> None:
        if self._guide.done(self._fix) and not self.standing:
            self._happened(Happening.HEIGHT_REACHED)

    def _tick_land(self) -> None:
        self._landing.tick(self._fix)

    def _tick_return(self) -> None:
        fix, guide = self._fix, self._guide
        if self._return_stage == 2:
            self._landing.tick(fix)
        elif guide.done(fix):
            self._return_stage += 1
            if self._return_stage == 1:
                end = guide.reference(fix)
                guide.go(fix, (self.home_N[0], self.home_N[1], end.down_m))
            else:
                self._landing.start(fix)

    def _tick_mission(self) -> None:
        progress = self._executor.tick(self._fix, self.standing)
        if progress is Progress.COMPLETE and not (self.standing and self._executor.landing):
            self._happened(Happening.MISSION_COMPLETE)
        elif progress is Progress.RETURN:
            self._happened(Happening.RETURN_ITEM)

    def _tick_offboard(self) -> None:
        fix, offboard = self._fix, self._offboard
        if offboard.lost(fix.now_us):
            self._happened(Happening.TARGETS_LOST)
        elif offboard.number != self._offboard_seen:
            self._offboard_seen = offboard.number
            kept = self._guide.reference(fix).heading_rad
            self._guide.put(offboard.trajectory(fix.now_us, kept, fix.position_N), offboard.follow())
        elif self._guide.done(fix) and offboard.age_s(fix.now_us) > _CARRY_S and offboard.moving:
            self._guide.stop(fix._replace(now_us=round(self._guide.trajectory.end_s * 1e6) - 1))

    _MODES: dict[Mode, Callable[["Commander"], None]] = {  # noqa: RUF012
        Mode.HOLD: _tick_hold,
        Mode.POSITION: _tick_position,
        Mode.TAKEOFF: _tick_takeoff,
        Mode.LAND: _tick_land,
        Mode.RETURN: _tick_return,
        Mode.MISSION: _tick_mission,
        Mode.OFFBOARD: _tick_offboard,
    }

    def _happened(self, happening: Happening) -> None:
        """Go where AFTER points."""
        follows = AFTER.get((self.mode, happening))
        if follows is None:
            return
        loss = happening in (Happening.TARGETS_LOST, Happening.STICKS_LOST, Happening.STATIONS_LOST)
        if isinstance(follows, str):
            actions = _BY_LOSS_ACTION if follows == "COM_OBL_RC_ACT" else _BY_LINK_ACTION
            chosen = actions.get(int(self._p[follows]))
            if chosen is None:
                return
            follows = chosen
        text = f"{happening.value}: {follows.value}"
        self._tell(Severity.WARNING if loss else Severity.INFO, text)
        self._switch(follows)
        if loss:
            self.failsafe = happening.value

    # ground and attitude

    def _watch_ground(self) -> None:
        """Decide between idling on the ground and flying; disarm after a landing."""
        fix = self._fix
        if self.standing:
            r = self._guide.reference(fix)
            wants_up = r.down_m < fix.nav.down_m - _LIFT_M or r.v_down_m_s < -_LIFT_M_S or r.a_down_m_s2 < -_LIFT_M_S
            landing = self._is_landing()
            if wants_up and not landing:
                self._effort, self._down_since_us = Effort.FLY, None
                self._set_landed(Landed.TAKING_OFF if self.mode is Mode.TAKEOFF else Landed.IN_AIR)
                return
            if self._down_since_us is None:
                self._down_since_us = fix.now_us
            waited_s = (fix.now_us - self._down_since_us) * 1e-6
            finished = landing or (self.mode is Mode.MISSION and self._mission.state is MissionState.COMPLETE)
            if finished and waited_s >= self._p["COM_DISARM_LAND"]:
                self._disarm()
            return
        self._set_landed(
            Landed.LANDING
            if self._is_landing()
            else Landed.TAKING_OFF if self.mode is Mode.TAKEOFF else Landed.IN_AIR
        )  # fmt: skip
        if fix.nav.down_m < -_NEAR_GROUND_M and fix.feet_down == 0:
            self._rest_since_us = None
            return
        r = self._guide.reference(fix)
        n = fix.nav
        # where the vehicle takes off from is the ground; a reference at or below it means to stand
        grounded = r.down_m > -_TOUCH_M and r.v_down_m_s > -_LIFT_M_S
        calm = abs(n.v_down_m_s) < _TOUCH_M_S and math.hypot(n.v_north_m_s, n.v_east_m_s) < 2 * _TOUCH_M_S
        if not (grounded and calm):
            self._rest_since_us = None
            return
        if self._rest_since_us is None:
            self._rest_since_us = fix.now_us
        resting = (fix.now_us - self._rest_since_us) * 1e-6 >= _REST_S and n.down_m > -3 * _TOUCH_M
        if fix.feet_down > 0 or resting:
            self._effort, self._rest_since_us = Effort.IDLE, None
            self._guide.put(rest_at(n.north_m, n.east_m, 0.0, r.heading_rad)) if self._is_landing() else None
            self._down_since_us = fix.now_us
            self._set_landed(Landed.ON_GROUND)

    def _is_landing(self) -> bool:
        return (
            self.mode is Mode.LAND
            or (self.mode is Mode.RETURN and self._return_stage == 2)
            or (self.mode is Mode.MISSION and self._executor.landing)
        )

    def _watch_attitude(self) -> None:
        """Notice a vehicle that lies on the ground, and stop its motors."""
        fix, n = self._fix, self._fix.nav
        nose_down = 2.0 * (n.qx * n.qz - n.qw * n.qy)
        low = n.down_m > -_NEAR_GROUND_M
        slow = math.hypot(n.v_north_m_s, n.v_east_m_s, n.v_down_m_s) < 0.5
        if not (nose_down > _TIPPED and low and slow):
            self._tipped_since_us = None
            if nose_down < _TIPPED and fix.feet_down > 2:
                self.tipped_over = False
            return
        if self._tipped_since_us is None:
            self._tipped_since_us = fix.now_us
        elif not self.tipped_over and (fix.now_us - self._tipped_since_us) * 1e-6 >= _TIPPED_S:
            self.tipped_over = True
            self._tell(Severity.CRITICAL, "the vehicle has tipped over: motors stopped")
            if self.armed:
                self._disarm()

    def _disarm(self) -> None:
        self.armed = False
        self.changed = True
        self._effort = Effort.OFF
        self._guide.rest_here(self._fix)
        self._set_landed(Landed.ON_GROUND if self._fix.feet_down or self.tipped_over else self.landed)
        self._events.add(EventKind.ARMED, Severity.INFO, "disarmed", 0)
        self._happened(Happening.DISARMED)
        self.failsafe = self.failsafe if self._terminated else ""

    def _set_landed(self, landed: Landed) -> None:
        if landed is not self.landed:
            self.landed = landed
            self._events.add(EventKind.LANDED, Severity.INFO, landed.value)

    def _mission_home(self, point_N: Vec3 | None) -> None:
        if point_N is None:
            self.set_home(None)
            return
        lat, lon = to_global(self.origin, point_N[0], point_N[1])
        self.set_home(GeoPoint(lat, lon, self.origin.alt_amsl_m - point_N[2]))

    def _tell(self, severity: Severity, text: str) -> None:
        self._events.tell(severity, text)


_CONDITIONS: dict[str, Callable[[Commander], str]] = {
    "has_mission": lambda c: "" if c._mission.items else "there is no mission",
    "streaming": lambda c: (
        "" if c._offboard.streaming(c._fix.now_us) else "no stream of targets above 2 Hz in the last second"
    ),
}
