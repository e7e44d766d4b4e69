"""Flying a plan over the link: everything a client does from the first heartbeat to the last disarming.

A flight is a script of its Client (see client.py): no sockets, no clock of its own. Phases:

    connecting → configuring → preparing → flying → landing → done

Streamed flights send a target every 20 ms of the vehicle's time, each evaluated for the very instant it is stamped
with. Uploaded flights hand the items over, start the mission and watch.
"""

import math
from typing import Any

from gcs_tools import commands
from gcs_tools.client import TRIES, Client, LinkError, Script
from gcs_tools.clock import Metronome
from gcs_tools.metrics import Metrics, TooFewSamplesError, Track, evaluate
from gcs_tools.plan import Plan, Streamed, Uploaded
from gcs_tools.recording import Recording
from gcs_tools.reference import Vector
from gcs_tools.undertaking import Undertaking
from gcs_tools.upload import hand_over
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

STREAM_S = 0.02  # of the vehicle's time between targets
LISTEN_S = 2.0  # for the first sample of every stream
LEAD_S = 0.5  # armed and standing, before the flight's time starts
WARM_UP_S = 1.3  # of streaming before Offboard is asked for (more than any vehicle wants of it)
ARMING_PATIENCE_S = 8.0
START_WITHIN_M = 1.0  # of the flight's first point
GROUND_M = 0.1  # a reference lower than this at its end is a landing
LANDING_S = 120.0  # of the vehicle's time
ELSEWHERE_S = 2.0  # in another mode, after which an uploaded flight counts as given up by the vehicle
SETTLE_S = 5.0  # after a completed mission, for the vehicle to disarm by itself
MISSION_COMPLETE = 5  # MISSION_STATE
_MISSION_MODES = ("mission", "return", "land")

_TARGET = codec.by_name("SET_POSITION_TARGET_LOCAL_NED")
_HERE = (math.nan,) * 4  # heading, latitude, longitude and altitude of a landing: as they are
_IGNORE_YAW, _IGNORE_YAW_RATE = 1 << 10, 1 << 11

# Interval of every stream that a flight looks at [µs]; all others that the vehicle sends by itself are turned off
# while it lasts, so that a flight at many times real time isn't spent on packing them.
_WANTED = {"LOCAL_POSITION_NED": 20_000, "DEBUG_VECT": 100_000, "SYS_STATUS": 500_000, "SYSTEM_TIME": 1_000_000}
_WANTED_UPLOADED = {"POSITION_TARGET_LOCAL_NED": 20_000, "MISSION_CURRENT": 1_000_000, "HOME_POSITION": 2_000_000}
UNWANTED = (
    "ATTITUDE",
    "ATTITUDE_QUATERNION",
    "HIGHRES_IMU",
    "ODOMETRY",
    "NAMED_VALUE_FLOAT",
    "FENCE_STATUS",
    "GLOBAL_POSITION_INT",
    "POSITION_TARGET_LOCAL_NED",
    "POSITION_TARGET_GLOBAL_INT",
    "ATTITUDE_TARGET",
    "SERVO_OUTPUT_RAW",
    "ACTUATOR_OUTPUT_STATUS",
    "VFR_HUD",
    "GPS_RAW_INT",
    "ALTITUDE",
    "WIND_COV",
    "EXTENDED_SYS_STATE",
    "BATTERY_STATUS",
    "HOME_POSITION",
    "GPS_GLOBAL_ORIGIN",
    "SCALED_PRESSURE",
    "ESTIMATOR_STATUS",
    "VIBRATION",
    "MISSION_CURRENT",
    "CURRENT_MODE",
)


class Flight(Undertaking):
    """One flight of a plan by the vehicle at the other end of `client`."""

    def __init__(self, plan: Plan, client: Client) -> None:
        super().__init__(client)
        self.plan = plan
        self.recording = Recording()
        self.measured_s: float | None = None  # how long it lasted, once it has been flown
        self.wall_s: tuple[float, float] = (0.0, 0.0)  # the caller's time at its start and at its end
        self.reached: list[tuple[float, Vector | None]] = []  # when items were reached, and where they are
        self._wanted = _WANTED | (_WANTED_UPLOADED if isinstance(plan, Uploaded) else {})
        self._metronome = Metronome(client.vehicle.clock, STREAM_S)
        self._last_reached: int | None = None
        client.on["LOCAL_POSITION_NED"] = self.recording.position
        client.on["POSITION_TARGET_LOCAL_NED"] = self.recording.target
        client.on["DEBUG_VECT"] = self.recording.debug
        client.start(self._script())

    # What the outside sees.

    @property
    def progress(self) -> float:
        """From 0 to 1."""
        if self.measured_s is not None:
            return 1.0
        if isinstance(self.plan, Streamed):
            return min(1.0, max(0.0, self.t_s / self.plan.duration_s))
        done = self.client.vehicle.mission_item or 0
        return min(1.0, done / len(self.plan.items)) if self.phase == "flying" else 0.0

    def track(self) -> Track:
        if self.t0_s is None:
            raise LinkError("the flight never started")
        return self.recording.track(self.t0_s, self.plan.reference if isinstance(self.plan, Streamed) else None)

    def key_points(self) -> list[tuple[float, Vector | None]]:
        """When something was to be reached, and where; without a place it is the reference then."""
        if isinstance(self.plan, Streamed):
            return [(t, self.plan.reference.at(t).position_m) for t in self.plan.key_times_s]
        return self.reached

    def metrics(self) -> Metrics:
        if self.measured_s is None:
            raise LinkError("the flight wasn't flown to its end")
        try:
            return evaluate(self.track(), self.measured_s, self.key_points())
        except TooFewSamplesError as error:
            raise LinkError(str(error)) from None

    def give_up(self) -> None:
        """Interrupted from outside: the vehicle, if this flight put it into the air, lands where it is."""
        if self.client.vehicle.armed and self.phase in ("flying", "landing"):
            self._send_land()
            self._note("asked the vehicle to land")
        self.client.stop(LinkError("interrupted"))

    # The script.

    def _script(self) -> Script[None]:
        client, v = self.client, self.client.vehicle
        yield from client.connect()
        self._note(f"vehicle {client.system} heard")
        self.phase = "configuring"
        intervals = dict.fromkeys(UNWANTED, -1) | self._wanted
        yield from self._listen(intervals)
        if v.armed:
            raise LinkError("the vehicle is armed already; a flight starts disarmed and standing")
        self.phase = "preparing"
        try:
            if isinstance(self.plan, Streamed):
                yield from self._streamed(self.plan)
            else:
                yield from self._uploaded(self.plan)
        except LinkError:
            if v.armed and self.phase == "flying" and v.mode in ("offboard", "mission"):
                self._send_land()  # it was this flight that put it into the air
            raise
        finally:
            client.background = None
            client.send_intervals(dict.fromkeys(intervals, 0))
        self.phase = "done"

    def _listen(self, intervals: dict[str, int]) -> Script[None]:
        """Have the streams at their rates and what a flight needs to know at hand."""
        client, v = self.client, self.client.vehicle
        for left in reversed(range(TRIES)):
            yield from client.set_intervals(intervals)
            try:
                yield from client.wait(
                    lambda: v.position_m is not None and v.clock.known and v.ready is not None,
                    LISTEN_S,
                    "the vehicle tells no position, time or readiness",
                )
                return
            except LinkError:
                if not left:
                    raise

    def _streamed(self, plan: Streamed) -> Script[None]:
        client, v = self.client, self.client.vehicle
        start = plan.reference.at(0.0).position_m
        assert v.position_m is not None
        away = math.dist(start, v.position_m)
        if away > START_WITHIN_M:
            place = ", ".join(f"{x:.2f}" for x in v.position_m)
            raise LinkError(f"the vehicle stands at ({place}), {away:.2f} m from where this flight starts")
        yield from self._hand_over(plan)
        client.background = self._stream
        began_s = v.clock.at(client.wall_s)
        yield from client.wait(
            lambda: v.clock.at(client.wall_s) - began_s > WARM_UP_S, 60.0, "the vehicle's clock stands still"
        )
        yield from client.set_mode("offboard", patience_s=3.0)
        yield from client.arm(ARMING_PATIENCE_S)
        self._begin(LEAD_S)
        yield from client.wait(lambda: self.t_s >= 0.0, 60.0, "the vehicle's clock stands still")
        began_wall_s = client.wall_s
        while self.t_s < plan.duration_s:
            self._still("offboard")
            yield math.inf
        self.measured_s = plan.duration_s
        self.wall_s = (began_wall_s, client.wall_s)
        self.phase = "landing"
        if plan.reference.at(plan.duration_s).position_m[2] > -GROUND_M:
            yield from client.disarm(ARMING_PATIENCE_S)
        else:
            yield from self._land()
        self._note("disarmed")

    def _uploaded(self, plan: Uploaded) -> Script[None]:
        client, v = self.client, self.client.vehicle
        yield from self._hand_over(plan)
        client.on["MISSION_ITEM_REACHED"] = self._item_reached
        yield from client.arm(ARMING_PATIENCE_S)
        self._begin(0.0)
        began_wall_s = client.wall_s
        yield from commands.start_mission(client, patience_s=2.0)
        yield from self._follow(plan)
        self.measured_s = max(self.t_s, STREAM_S)
        self.wall_s = (began_wall_s, client.wall_s)
        self.phase = "landing"
        if v.armed:
            yield from self._land()
        self._note("disarmed")

    def _hand_over(self, plan: Plan) -> Script[None]:
        for text in (yield from hand_over(self.client, plan)):
            self._note(text)

    def _follow(self, plan: Uploaded) -> Script[None]:
        """Until the vehicle has disarmed, or the mission has long been complete."""
        v = self.client.vehicle
        complete_s: float | None = None
        elsewhere_s: float | None = None
        while v.armed:
            t = self.t_s
            if t > plan.limit_s:
                raise LinkError(f"the mission isn't done after {plan.limit_s:g} s, at item {v.mission_item}")
            if v.mission_state == MISSION_COMPLETE:
                complete_s = t if complete_s is None else complete_s
                if t - complete_s > SETTLE_S and v.mode not in _MISSION_MODES[1:]:
                    return
            elif v.mode not in _MISSION_MODES:  # a completed mission may tell its mode before its state
                elsewhere_s = t if elsewhere_s is None else elsewhere_s
                if t - elsewhere_s > ELSEWHERE_S:
                    raise LinkError(self._left("mission"))
            yield math.inf
        yield from self.client.wait(lambda: v.mission_state == MISSION_COMPLETE, 2.0, self._left("mission"))

    def _begin(self, lead_s: float) -> None:
        now_s = self.client.vehicle.clock.at(self.client.wall_s) + lead_s
        self.t0_s = math.ceil(now_s / STREAM_S - 1e-6) * STREAM_S
        self.phase = "flying"
        self._note("armed")

    def _land(self) -> Script[None]:
        client, v = self.client, self.client.vehicle
        self._note("landing")
        yield from client.require("landing", mav.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, *_HERE)
        client.background = None
        began_s = self.t_s
        while v.armed:
            if self.t_s - began_s > LANDING_S:
                raise LinkError("the vehicle landed no sooner than it was given up on")
            yield math.inf

    def _send_land(self) -> None:
        place = {f"param{k}": value for k, value in enumerate(_HERE, start=4)}
        command = mav.MAV_CMD_NAV_LAND
        self.client.send(codec.message("COMMAND_LONG", command=command, **place, **self.client.address()))

    # What runs beside it.

    def _stream(self) -> float:
        """Send the target that is due; when the next one will be, on the caller's clock."""
        return self._metronome.beat(self.client.wall_s, self._send_target)

    def _send_target(self, now_s: float) -> None:
        client, plan = self.client, self.plan
        stamp_ms = round(now_s * 1000.0)
        assert isinstance(plan, Streamed)
        t = stamp_ms * 1e-3 - self.t0_s if self.t0_s is not None else -1.0
        position, velocity, acceleration = plan.reference.at(t)
        heading = plan.heading_rad
        mask = _IGNORE_YAW_RATE if heading is not None else _IGNORE_YAW_RATE | _IGNORE_YAW
        client.send_packed(
            _TARGET,
            _TARGET.pack(
                stamp_ms,
                *position,
                *velocity,
                *acceleration,
                heading or 0.0,
                0.0,
                mask,
                client.system or 0,
                mav.MAV_COMP_ID_AUTOPILOT1,
                mav.MAV_FRAME_LOCAL_NED,
            ),
        )

    def _item_reached(self, m: Any) -> None:
        if self.t0_s is None or not isinstance(self.plan, Uploaded) or m.seq >= len(self.plan.items):
            return
        if self._last_reached == m.seq:
            return  # told twice
        self._last_reached = m.seq
        t = self.client.vehicle.clock.at(self.client.wall_s) - self.t0_s
        self.reached.append((t, self.plan.items[m.seq].place_m()))
        self._note(f"item {m.seq} reached")

    def _still(self, mode: str) -> None:
        v = self.client.vehicle
        if not v.armed or v.mode != mode:
            raise LinkError(self._left(mode))

    def _left(self, mode: str) -> str:
        v = self.client.vehicle
        became = "disarmed" if not v.armed else f"left {mode} mode for {v.mode}"
        reason = v.reasons_since(self.client.wall_s - 3.0)
        return f"the vehicle {became} at t = {self.t_s:.1f} s{': ' + reason if reason else ''}"
