"""What is recorded of a vehicle: from arming to disarming, every control step and whatever happens."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sitl.closed_loop import TRACE_COLUMNS
from sitl.daemon.recorder import Recorder
from sitl.onboard.modes import EventKind
from sitl.telemetry import keys, messages
from sitl.telemetry.keys import Topic

if TYPE_CHECKING:
    from sitl.telemetry.feed import Feed
    from sitl.vehicle import Vehicle

EVENTS_BEFORE = 20  # of those before the flight: they show what led to the arming

_NUMBERS = {topic: number for number, topic in enumerate(keys.TOPICS)}


class FlightRecorder:
    """Follows one vehicle, for one Recorder. The loop calls `trace` before it advances, `take` afterwards."""

    def __init__(self, vehicle: "Vehicle", feed: "Feed", recorder: Recorder) -> None:
        self._vehicle, self._feed, self._recorder = vehicle, feed, recorder
        self._next_event = vehicle.events.next_number
        self._trigger: tuple[object, ...] = ()
        recorder.end()  # that of a vehicle before this one

    def frame(self, frame: bytes, unix_s: float) -> None:
        self._recorder.frame(frame, unix_s)

    def trace(self, until_us: int, unix_s: float) -> NDArray[np.float64] | None:
        """Room for the control steps until then; None between flights."""
        vehicle, recorder = self._vehicle, self._recorder
        flying = recorder.flight is not None
        if vehicle.commander.armed and not flying and recorder.pipe.works:
            self._begin(unix_s)
        elif flying and not vehicle.commander.armed:
            recorder.end()
        if recorder.flight is None:
            recorder.pump()
            return None
        return np.empty((max(0, until_us - vehicle.now_us) // vehicle.step_us, len(TRACE_COLUMNS)))

    def take(self, trace: NDArray[np.float64] | None) -> None:
        """What `trace` was filled with, and what has happened meanwhile."""
        if trace is None:
            self._next_event = max(self._next_event, self._vehicle.events.next_number - EVENTS_BEFORE)
            return
        self._recorder.steps(trace)
        self._tell_news()
        self._recorder.pump()

    def _begin(self, unix_s: float) -> None:
        vehicle, origin = self._vehicle, self._vehicle.snapshot().origin
        self._recorder.begin(unix_s, vehicle.now_us, (origin.lat_deg, origin.lon_deg, origin.alt_amsl_m))
        for topic in (keys.DESCRIPTION, keys.PARAMETERS, keys.MISSION, keys.MODE):
            self._put(topic, vehicle.now_us, self._feed.latest(topic))
        self._trigger = messages.mode_trigger(vehicle.snapshot())

    def _tell_news(self) -> None:
        vehicle = self._vehicle
        snapshot = vehicle.snapshot()
        trigger = messages.mode_trigger(snapshot)
        if trigger != self._trigger:
            self._trigger = trigger
            self._put(keys.MODE, vehicle.now_us, self._feed.latest(keys.MODE))
        if vehicle.events.next_number == self._next_event:
            return
        for event in vehicle.events.since(self._next_event):
            self._put(keys.EVENT, event.now_us, messages.encode(messages.event(event)))
            if event.kind is EventKind.PLAN:
                self._put(keys.MISSION, event.now_us, self._feed.latest(keys.MISSION))
            if event.kind is EventKind.PARAMETER and event.text in vehicle.parameters:
                changed = messages.parameters(event.now_us, vehicle.parameters, [event.text])
                self._put(keys.PARAMETERS, event.now_us, messages.encode(changed))
        self._next_event = vehicle.events.next_number

    def _put(self, topic: Topic, now_us: int, data: bytes) -> None:
        self._recorder.message(_NUMBERS[topic], now_us, data)
