"""What the dashboard makes of a vehicle's messages beyond VehicleState: errors, angles, flight time, round trip."""

import math
from collections import deque
from statistics import median
from typing import Any

from gcs_tools.client import Client
from gcs_tools.reference import Vector
from gcs_tools.vehicle_state import Text
from gcs_tools.watch.traces import Trace
from sitl.mavlink import codec

STALE_S = 1.5  # without a stamp, after which the vehicle's clock stands still
SEEN = 8  # beyond all severities: not told by the vehicle, but seen
_RATE_WINDOW_S = 3.0
_PAIR_S = 0.5  # of the vehicle's time between a position and the reference that it is compared with
_TRACK_S = 0.5
_TRACK_KEPT = 360
_PINGS = 5

# ESTIMATOR_STATUS_FLAGS of what is known; all others tell of something that is wrong
_ESTIMATES = {1: "attitude", 2: "horizontal velocity", 4: "vertical velocity", 16: "position", 32: "height"}
_WRONG = 1024 | 2048  # GPS_GLITCH, ACCEL_ERROR


class Instruments:
    """Listens to a client's vehicle; the time is the client's."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self.error_m: Vector | None = None  # position minus reference at the same instant
        self.heading_deg: float | None = None
        self.tilt_deg: float | None = None  # of the nose from the vertical
        self.wind_m_s: Vector | None = None  # how the air moves: north, east, down
        self.estimator: Any = None  # the newest ESTIMATOR_STATUS
        self.heartbeat_s: float | None = None
        self.joined_in_flight = False
        self.error, self.height, self.thrust, self.speed = Trace(max), Trace(), Trace(), Trace()
        self.motor, self.flap = Trace(), Trace()  # the greater amount of left and right
        self.changes: deque[Text] = deque(maxlen=100)  # what was seen to happen
        self._was: tuple[str | None, bool] | None = None  # mode, armed
        self.track: deque[tuple[float, float]] = deque(maxlen=_TRACK_KEPT)  # north, east [m]
        self._track_s = -math.inf
        self._target: Any = None
        self._armed_s: float | None = None  # the vehicle's time of arming
        self._flown_s: float | None = None
        self._stamps: deque[tuple[float, float]] = deque()  # wall, vehicle
        self._pings: deque[int] = deque(maxlen=_PINGS)
        self._trips_s: deque[float] = deque(maxlen=_PINGS)
        client.on |= {
            "HEARTBEAT": self._heartbeat,
            "LOCAL_POSITION_NED": self._position,
            "POSITION_TARGET_LOCAL_NED": self._reference,
            "ATTITUDE": self._attitude,
            "DEBUG_VECT": self._debug,
            "WIND_COV": self._wind,
            "ESTIMATOR_STATUS": self._estimator,
            "SYSTEM_TIME": self._time,
            "MISSION_ITEM_REACHED": self._item_reached,
            "TIMESYNC": self._timesync,
        }

    def rate(self, wall_s: float) -> float | None:
        """Vehicle seconds per second over the last few; 0 where its clock stands still, None where it is unknown."""
        if not self._stamps:
            return None
        (from_s, stamp0_s), (to_s, stamp1_s) = self._stamps[0], self._stamps[-1]
        if wall_s - to_s > STALE_S:
            return 0.0
        return (stamp1_s - stamp0_s) / (to_s - from_s) if to_s - from_s > 0.5 else None

    @property
    def flight_s(self) -> float | None:
        """How long the motors have been armed, or were the last time, in the vehicle's time."""
        newest_s = self._client.vehicle.clock.newest_s
        if self._armed_s is None or newest_s is None:
            return self._flown_s
        return newest_s - self._armed_s

    @property
    def round_trip_s(self) -> float | None:
        return median(self._trips_s) if self._trips_s else None

    @property
    def missing(self) -> list[str]:
        """What the vehicle's estimator doesn't know, or takes to be wrong."""
        if self.estimator is None:
            return []
        flags = self.estimator.flags
        return [name for bit, name in _ESTIMATES.items() if not flags & bit] + ["a sensor"] * bool(flags & _WRONG)

    def ping(self) -> None:
        """Ask for the vehicle's clock, for the sake of how long the answer takes."""
        sent_ns = round(self._client.wall_s * 1e9)
        self._pings.append(sent_ns)
        self._client.send(codec.message("TIMESYNC", ts1=sent_ns))

    def _heartbeat(self, m: Any) -> None:
        v, first = self._client.vehicle, self.heartbeat_s is None
        self.heartbeat_s = self._client.wall_s
        if v.armed and self._armed_s is None and v.clock.newest_s is not None:
            self._armed_s, self._flown_s = v.clock.newest_s, None
        elif not v.armed and self._armed_s is not None:
            self._flown_s, self._armed_s, self.joined_in_flight = self.flight_s, None, False
        if first:
            self.joined_in_flight = v.armed
        self._changed(v.mode, v.armed)

    def _changed(self, mode: str | None, armed: bool) -> None:
        if self._was is not None:
            if self._was[0] != mode:
                self.note(f"mode {mode}")
            if self._was[1] != armed:
                self.note("armed" if armed else "disarmed")
        self._was = mode, armed

    def _item_reached(self, m: Any) -> None:
        self.note(f"item {m.seq + 1} reached")

    def note(self, text: str) -> None:
        """Keep what was seen to happen now."""
        self.changes.append(Text(self._client.wall_s, SEEN, text))

    def _clock(self, stamp_s: float) -> None:
        wall_s = self._client.wall_s
        if self._stamps and stamp_s < self._stamps[-1][1]:
            if stamp_s < self._stamps[-1][1] - 1.0:  # started again
                self._stamps.clear()
                self._armed_s = self._flown_s = self.error_m = self._target = None
            return
        self._stamps.append((wall_s, stamp_s))
        while self._stamps[0][0] < wall_s - _RATE_WINDOW_S:
            self._stamps.popleft()

    def _time(self, m: Any) -> None:
        self._clock(m.time_boot_ms * 1e-3)

    def _position(self, m: Any) -> None:
        wall_s = self._client.wall_s
        self._clock(m.time_boot_ms * 1e-3)
        self.height.put(-m.z, wall_s)
        self.speed.put(math.hypot(m.vx, m.vy, m.vz), wall_s)
        if wall_s - self._track_s >= _TRACK_S:
            self._track_s = wall_s
            if math.isfinite(m.x + m.y):
                self.track.append((m.x, m.y))
        self.error_m = _error(m, self._target) if self._client.vehicle.armed else None
        if self.error_m is not None:
            self.error.put(math.hypot(*self.error_m), wall_s)

    def _reference(self, m: Any) -> None:
        self._target = m

    def _attitude(self, m: Any) -> None:
        if not math.isfinite(m.roll + m.pitch + m.yaw):
            self.heading_deg = self.tilt_deg = None
            return
        self.heading_deg = math.degrees(m.yaw) % 360.0
        self.tilt_deg = math.degrees(math.acos(max(-1.0, min(1.0, math.cos(m.roll) * math.cos(m.pitch)))))

    def _debug(self, m: Any) -> None:
        if m.name == "THRUST_N":
            self.thrust.put(m.z, self._client.wall_s)
            self.motor.put(max(m.x, m.y), self._client.wall_s)
        elif m.name == "FLAP_DEG":
            self.flap.put(max(abs(m.x), abs(m.y)), self._client.wall_s)

    def _wind(self, m: Any) -> None:
        self.wind_m_s = (m.wind_x, m.wind_y, m.wind_z)

    def _estimator(self, m: Any) -> None:
        self.estimator = m

    def _timesync(self, m: Any) -> None:
        if m.tc1 and m.ts1 in self._pings:
            self._pings.remove(m.ts1)
            self._trips_s.append(max(0.0, self._client.wall_s - m.ts1 * 1e-9))


def _error(position: Any, target: Any) -> Vector | None:
    """Position minus reference, which is carried forward to the position's instant; None where there is none."""
    if target is None:
        return None
    t = (position.time_boot_ms - target.time_boot_ms) * 1e-3
    if abs(t) > _PAIR_S:
        return None
    error = []
    for axis in "xyz":
        place, speed = getattr(target, axis), getattr(target, f"v{axis}")
        acceleration = getattr(target, f"af{axis}")
        if not math.isfinite(place):
            return None
        moved = sum(x for x in (speed * t, 0.5 * acceleration * t * t) if math.isfinite(x))
        error.append(getattr(position, axis) - place - moved)
    return (error[0], error[1], error[2])
