"""Which messages flow by themselves, how often, and when the next one of each is due.

Streams run on simulation time. Default rates are those of PX4's SITL on its ports: mavlink_main.cpp's normal and
onboard modes, with what px4-rc.mavlink sets on top of them. What a peer asked for (SET_MESSAGE_INTERVAL,
REQUEST_DATA_STREAM) is kept in its Schedule.
"""

import heapq
import math
import struct
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import NamedTuple

from sitl.mavlink import messages
from sitl.mavlink.codec import Definition, by_name, mav
from sitl.mavlink.view import View

NEVER = 1 << 62
SHORTEST_US = 1000  # between two messages of one stream
PATIENCE_US = 1_000_000  # a stream with a phase begins within this
DEFAULT, OFF = 0, -1  # intervals with a meaning of their own in SET_MESSAGE_INTERVAL
TOTAL_MAX_HZ = 5000.0  # messages that one peer may have streamed in a second of simulation, all streams together


class PortKind(StrEnum):
    """One of the vehicle's ports. They differ in the default rates of their streams."""

    GCS = "gcs"
    ONBOARD = "onboard"
    VIEWER = "viewer"  # of the true state, for programs that only draw
    SHARED = "shared"  # of all vehicles of a swarm, for ground stations


class Profile(NamedTuple):
    """How the default rates are cut where many vehicles share a machine; what a peer asks for is not.

    phase_us: every stream falls so long after the multiples of its interval, so that vehicles with different phases
    speak at different times; None: it begins at once. Heartbeats keep so far apart, too.
    """

    rate_max_Hz: float = math.inf  # of one stream
    on_hearing: tuple[PortKind, ...] = ()  # ports whose peers get streams only once they have been heard
    phase_us: int | None = None


FULL = Profile()


class Stream(NamedTuple):
    """One message that can flow. Rates in Hz of simulation time, left out = only when asked for."""

    definition: Definition
    values: Callable[[View], messages.Values | None]
    rates_Hz: Mapping[PortKind, float]

    def payload(self, view: View) -> bytes:
        """Empty where there is nothing to tell, or values fit no field: as of a simulation that has run away."""
        try:
            values = self.values(view)
            return b"" if values is None else self.definition.pack(*values)
        except (struct.error, OverflowError, ValueError):
            return b""


def _stream(
    name: str, gcs_Hz: float, onboard_Hz: float, values: Callable[[View], messages.Values | None] | None = None
) -> Stream:
    rates_Hz = {PortKind.GCS: gcs_Hz, PortKind.SHARED: gcs_Hz, PortKind.ONBOARD: onboard_Hz}
    return Stream(by_name(name), values or getattr(messages, name.lower()), rates_Hz)


STREAMS = (
    _stream("ATTITUDE", 50, 100),
    _stream("ATTITUDE_QUATERNION", 50, 50),
    _stream("LOCAL_POSITION_NED", 50, 30),
    _stream("HIGHRES_IMU", 0, 50),
    _stream("ODOMETRY", 0, 30),
    _stream("GLOBAL_POSITION_INT", 50, 50),
    _stream("POSITION_TARGET_LOCAL_NED", 50, 10),
    _stream("POSITION_TARGET_GLOBAL_INT", 1, 10),
    _stream("ATTITUDE_TARGET", 50, 10),
    _stream("SERVO_OUTPUT_RAW", 50, 10),
    _stream("ACTUATOR_OUTPUT_STATUS", 0, 10),
    _stream("VFR_HUD", 4, 10),
    _stream("GPS_RAW_INT", 5, 10),
    _stream("ALTITUDE", 1, 10),
    _stream("WIND_COV", 0.5, 10),
    _stream("DEBUG_VECT", 1, 10, messages.paper_angles),
    _stream("DEBUG_VECT", 1, 10, messages.thrusts),
    _stream("DEBUG_VECT", 1, 10, messages.flaps),
    _stream("NAMED_VALUE_FLOAT", 1, 10, messages.paper_phi),
    _stream("NAMED_VALUE_FLOAT", 1, 10, messages.paper_theta),
    _stream("NAMED_VALUE_FLOAT", 1, 10, messages.paper_psi),
    _stream("SYS_STATUS", 1, 5),
    _stream("EXTENDED_SYS_STATE", 1, 5),
    _stream("BATTERY_STATUS", 0.5, 0.5),
    _stream("HOME_POSITION", 0.5, 0.5),
    _stream("GPS_GLOBAL_ORIGIN", 1, 1),
    _stream("SCALED_PRESSURE", 1, 1),
    _stream("ESTIMATOR_STATUS", 0.5, 1),
    _stream("VIBRATION", 0.1, 0.5),
    _stream("MISSION_CURRENT", 1, 1),
    _stream("FENCE_STATUS", 1, 1),
    _stream("ORBIT_EXECUTION_STATUS", 2, 5),
    _stream("CURRENT_MODE", 0.5, 0.5),
    _stream("SYSTEM_TIME", 1, 1),
    _stream("UTM_GLOBAL_POSITION", 0, 0),
    _stream("SIM_STATE", 0, 0),
    Stream(by_name("HIL_STATE_QUATERNION"), messages.hil_state_quaternion, {PortKind.VIEWER: 25}),
)

BY_ID: dict[int, tuple[int, ...]] = {
    stream.definition.id: tuple(k for k, other in enumerate(STREAMS) if other.definition.id == stream.definition.id)
    for stream in STREAMS
}
"""Places in STREAMS by message id: one id may carry several (DEBUG_VECT under three names)."""

_GROUPS = {
    mav.MAV_DATA_STREAM_RAW_SENSORS: ("HIGHRES_IMU", "SCALED_PRESSURE", "VIBRATION", "GPS_RAW_INT"),
    mav.MAV_DATA_STREAM_EXTENDED_STATUS: ("SYS_STATUS", "EXTENDED_SYS_STATE", "BATTERY_STATUS", "GPS_RAW_INT"),
    mav.MAV_DATA_STREAM_RC_CHANNELS: ("SERVO_OUTPUT_RAW",),
    mav.MAV_DATA_STREAM_RAW_CONTROLLER: ("ATTITUDE_TARGET", "ACTUATOR_OUTPUT_STATUS"),
    mav.MAV_DATA_STREAM_POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "POSITION_TARGET_LOCAL_NED"),
    mav.MAV_DATA_STREAM_EXTRA1: ("ATTITUDE", "ATTITUDE_QUATERNION"),
    mav.MAV_DATA_STREAM_EXTRA2: ("VFR_HUD", "ALTITUDE"),
    mav.MAV_DATA_STREAM_EXTRA3: ("ESTIMATOR_STATUS", "WIND_COV", "SYSTEM_TIME"),
}


def group_members(group: int) -> set[int]:
    """Message ids of a MAV_DATA_STREAM; MAV_DATA_STREAM_ALL is all groups together. Empty for an unknown one."""
    groups = _GROUPS.values() if group == mav.MAV_DATA_STREAM_ALL else (_GROUPS.get(group, ()),)
    return {by_name(name).id for names in groups for name in names}


def _interval(rate_Hz: float) -> int:
    return round(1e6 / rate_Hz) if rate_Hz > 0.0 else OFF


_DEFAULT_INTERVALS = {kind: [_interval(stream.rates_Hz.get(kind, 0.0)) for stream in STREAMS] for kind in PortKind}


class Schedule:
    """One peer's streams: a heap of (due, place in STREAMS), so that looking costs only what is due."""

    __slots__ = ("_defaults", "_heap", "_phase_us", "intervals_us", "next_us")

    def __init__(self, kind: PortKind, now_us: int, profile: Profile = FULL) -> None:
        shortest_us = 0 if math.isinf(profile.rate_max_Hz) else round(1e6 / profile.rate_max_Hz)
        self._phase_us = profile.phase_us
        self._defaults = [max(each, shortest_us) if each > 0 else each for each in _DEFAULT_INTERVALS[kind]]
        self.intervals_us = list(self._defaults)
        self._rebuild(now_us)

    def _rebuild(self, now_us: int) -> None:
        self._heap = [self._first(now_us, k) for k, interval in enumerate(self.intervals_us) if interval > 0]
        self._heap.append((NEVER, -1))
        heapq.heapify(self._heap)
        self.next_us = self._heap[0][0]

    def _first(self, now_us: int, k: int) -> tuple[int, int]:
        """Of a stream that begins now."""
        if self._phase_us is None:
            return now_us, k
        return now_us + (self._phase_us - now_us) % min(self.intervals_us[k], PATIENCE_US), k

    def take(self, now_us: int) -> list[int]:
        """The streams that are due, each once however late, on its own grid from here on."""
        heap, due = self._heap, []
        while (at_us := heap[0][0]) <= now_us:
            k = heap[0][1]
            interval = self.intervals_us[k]
            next_us = at_us + interval
            if next_us <= now_us:
                next_us += (now_us - at_us) // interval * interval
                if next_us <= now_us:
                    next_us += interval
            heapq.heapreplace(heap, (next_us, k))
            due.append(k)
        self.next_us = heap[0][0]
        return due

    def set_interval(self, message_id: int, interval_us: int, now_us: int) -> bool:
        """Interval of a message in µs, DEFAULT or OFF; a new rate starts now. Raises KeyError for other messages.

        False, and nothing changed, where all streams together would come to more than TOTAL_MAX_HZ.
        """
        places = BY_ID[message_id]
        intervals_us = list(self.intervals_us)
        for k in places:
            if interval_us == DEFAULT:
                intervals_us[k] = self._defaults[k]
            else:
                intervals_us[k] = OFF if interval_us == OFF else max(interval_us, SHORTEST_US)
        if sum(1e6 / each for each in intervals_us if each > 0) > TOTAL_MAX_HZ:
            return False
        self.intervals_us = intervals_us
        self._heap = [entry for entry in self._heap if entry[1] not in places]
        self._heap += [self._first(now_us, k) for k in places if intervals_us[k] > 0]
        heapq.heapify(self._heap)
        self.next_us = self._heap[0][0]
        return True

    def interval(self, message_id: int) -> int:
        """Interval of a message in µs, OFF if it doesn't flow. Raises KeyError for other messages."""
        return self.intervals_us[BY_ID[message_id][0]]

    def rewind(self, now_us: int) -> None:
        """Start over after simulation time was set back."""
        self._rebuild(now_us)
