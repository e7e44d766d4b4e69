"""What is to be said now: the vehicle's topics as encoded messages, without a network. Wall time is handed in.

Sampled topics follow simulation time at SIM_TLM_RATE, and never exceed the same rate in wall time, so that a simulation
running at 200 times real time does not flood its listeners. Nothing is built that nobody listens to.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Protocol

from sitl.telemetry import keys, messages, schema
from sitl.telemetry.keys import Topic

if TYPE_CHECKING:
    from sitl.onboard.events import EventLog
    from sitl.onboard.parameters import Parameters
    from sitl.onboard.plans import Plans
    from sitl.snapshot import Snapshot

BURST_S = 0.1  # samples of this much wall time may follow each other at once, when the loop catches up
GATHER_S = 0.01  # how long MAVLink frames wait to go out together
GATHER_MAX_BYTES = 60_000  # per direction; frames beyond it are left out whole
REPEAT_S = 1.0  # of the topics that are sent on change
EVENTS_KEPT = 200  # how many the `events` query goes back


class Subject(Protocol):
    """What the feed needs of a vehicle."""

    @property
    def now_us(self) -> int: ...
    @property
    def parameters(self) -> "Parameters": ...
    @property
    def plans(self) -> "Plans": ...
    @property
    def events(self) -> "EventLog": ...
    def snapshot(self) -> "Snapshot": ...
    def loads(self) -> Mapping[str, messages.LoadLike]: ...
    def description(self) -> dict[str, Any]: ...


class Sampler:
    """Says when the next sample is due: at most `rate_Hz` per second of simulation, and of wall time."""

    def __init__(self, phase_us: int = 0) -> None:
        self._slot = -1
        self._phase_us = phase_us  # samples fall so long after multiples of their interval
        self._booked_s = float("-inf")

    def due(self, now_us: int, wall_s: float, rate_Hz: float) -> bool:
        slot = math.floor((now_us - self._phase_us) * rate_Hz / 1e6)
        if slot == self._slot:
            return False
        booked_s = max(self._booked_s, wall_s)
        if booked_s - wall_s > BURST_S:
            return False
        self._slot = slot
        self._booked_s = booked_s + 1.0 / rate_Hz
        return True


class Frames:
    """MAVLink frames of one direction, gathered for one message."""

    def __init__(self) -> None:
        self.wanted = False
        self.left_out = 0
        self._data = bytearray()

    def add(self, frame: bytes) -> None:
        if not self.wanted:
            return
        if len(self._data) + len(frame) > GATHER_MAX_BYTES:
            self.left_out += 1
            return
        self._data += frame

    def take(self) -> bytes:
        data = bytes(self._data)
        self._data.clear()
        return data


class Feed:
    """The messages of one vehicle. phase_us: how long after those of a vehicle without a phase they come."""

    def __init__(
        self, vehicle: Subject, instance: int, loop: Callable[[], schema.LoopMessage], phase_us: int = 0
    ) -> None:
        self._vehicle = vehicle
        self._instance = instance
        self._loop = loop
        self._sampler = Sampler(phase_us)
        self._frames = {keys.MAVLINK_OUT: Frames(), keys.MAVLINK_IN: Frames()}
        self._frames_due_s = float("-inf")
        self._trigger: tuple[Any, ...] = ()
        self._repeat_s = float("-inf")
        self._second_repeat_s = REPEAT_S - phase_us * 1e-6 % REPEAT_S  # after the first
        self._next_event = vehicle.events.next_number
        self._builders: dict[Topic, Callable[[], Any]] = {
            keys.STATE: lambda: messages.state(vehicle.snapshot()),
            keys.ATTITUDE: lambda: messages.attitude(vehicle.snapshot()),
            keys.SETPOINT: lambda: messages.setpoint(vehicle.snapshot()),
            keys.ACTUATORS: lambda: messages.actuators(vehicle.snapshot()),
            keys.LOADS: lambda: messages.loads(vehicle.now_us, vehicle.loads()),
            keys.MODE: self._mode,
            keys.LOOP: loop,
            keys.EVENTS: self._events,
            keys.PARAMETERS: lambda: messages.parameters(vehicle.now_us, vehicle.parameters),
            keys.MISSION: lambda: messages.mission(vehicle.now_us, vehicle.plans),
            keys.DESCRIPTION: lambda: messages.description(
                vehicle.description(), instance, vehicle.parameters["SIM_TLM_RATE"]
            ),
        }
        self._sampled = [topic for topic in keys.TOPICS if topic.cadence is keys.Cadence.SAMPLED]

    def latest(self, topic: Topic) -> bytes:
        """The topic's message of this instant."""
        return messages.encode(self._builders[topic]())

    def frame(self, frame: bytes, outgoing: bool) -> None:
        """A MAVLink frame that passes."""
        self._frames[keys.MAVLINK_OUT if outgoing else keys.MAVLINK_IN].add(frame)

    def due(self, wall_s: float, wanted: Callable[[Topic], bool]) -> Iterator[tuple[Topic, bytes]]:
        """The messages that are due and wanted, each once."""
        vehicle = self._vehicle
        if self._sampler.due(vehicle.now_us, wall_s, vehicle.parameters["SIM_TLM_RATE"]):
            for topic in self._sampled:
                if wanted(topic):
                    yield topic, self.latest(topic)
        yield from self._changes(wall_s, wanted)
        if wall_s >= self._frames_due_s:
            self._frames_due_s = wall_s + GATHER_S
            for topic, frames in self._frames.items():
                data = frames.take()
                if data:
                    yield topic, data
                frames.wanted = wanted(topic)

    def _changes(self, wall_s: float, wanted: Callable[[Topic], bool]) -> Iterator[tuple[Topic, bytes]]:
        parameters, log = self._vehicle.parameters, self._vehicle.events
        repeat = wall_s >= self._repeat_s
        if wanted(keys.MODE):
            snapshot = self._vehicle.snapshot()
            trigger = (*messages.mode_trigger(snapshot), parameters["SIM_SPEED"], parameters["SIM_PAUSE"])
            if repeat or trigger != self._trigger:
                self._trigger = trigger
                yield keys.MODE, self.latest(keys.MODE)
        if repeat:
            late_s = wall_s - self._repeat_s
            self._repeat_s = wall_s + (REPEAT_S - late_s if late_s < REPEAT_S else self._second_repeat_s)
            if wanted(keys.LOOP):
                yield keys.LOOP, self.latest(keys.LOOP)
        if log.next_number != self._next_event:
            news = log.since(self._next_event)
            self._next_event = log.next_number
            if wanted(keys.EVENT):
                for event in news:
                    yield keys.EVENT, messages.encode(messages.event(event))

    def _mode(self) -> schema.ModeMessage:
        parameters = self._vehicle.parameters
        return messages.mode(self._vehicle.snapshot(), parameters["SIM_SPEED"], parameters["SIM_PAUSE"] > 0)

    def _events(self) -> schema.EventsMessage:
        log = self._vehicle.events
        return messages.events(log.next_number, log.since(max(0, log.next_number - EVENTS_KEPT)))
