"""What is known of one vehicle: the latest message of each topic, whole instants, and where it has been."""

from collections import deque
from typing import Any, NamedTuple

import msgspec

from gcs_tools.view import topics
from gcs_tools.view.history import History
from gcs_tools.view.topics import Actuators, Attitude, Loads, Setpoint, State

WAITING_MAX = 32  # instants of which not all parts have come
EVENTS_KEPT = 200


class Instant(NamedTuple):
    """The sampled messages of one `now_us`."""

    state: State
    attitude: Attitude
    setpoint: Setpoint
    actuators: Actuators
    loads: Loads

    @property
    def now_us(self) -> int:
        return self.state.now_us


class Vehicle:
    """Fed with messages by a source, read by the page; neither waits for the other.

    `alive` says whether the vehicle is there (its liveliness token stands, or it is a recording). `instant` is the
    newest whole one. `epoch` goes up whenever what was known before no longer leads to what comes: the vehicle was
    started again, or a replay was moved to another moment.
    """

    def __init__(self, instance: int) -> None:
        self.instance = instance
        self.alive = False
        self.epoch = 0
        self.instant: Instant | None = None
        self.mode: topics.Mode | None = None
        self.loop: topics.Loop | None = None
        self.description: dict[str, Any] | None = None  # the vehicle's own, without the list of topics
        self.mission: topics.Mission | None = None  # as stored in the vehicle
        self.parameters: dict[str, topics.Parameter] = {}
        self.events: deque[topics.Event] = deque(maxlen=EVENTS_KEPT)
        self.history = History()
        self.unreadable = 0  # messages that were left out
        self._waiting: dict[int, dict[str, Any]] = {}
        self._takers = {
            "mode": self._take_mode,
            "loop": self._take_loop,
            "event": self._take_event,
            "events": self._take_events,
            "parameters": self._take_parameters,
            "mission": self._take_mission,
            "description": self._take_description,
        }

    @property
    def name(self) -> str:
        kind = self.description["name"] if self.description else "vehicle"
        return f"{kind} {self.instance}"

    @property
    def now_us(self) -> int | None:
        return self.instant.now_us if self.instant else self.mode.now_us if self.mode else None

    def take(self, topic: str, payload: bytes) -> None:
        """A message as it came. One that can't be read is counted and left out."""
        try:
            message = topics.decode(topic, payload)
        except (msgspec.DecodeError, KeyError):
            self.unreadable += 1
            return
        if topic in topics.SAMPLED:
            self._take_part(topic, message)
        else:
            self._takers[topic](message)

    def forget(self) -> None:
        """Begin anew: what comes next does not continue what was."""
        self.epoch += 1
        self.instant = self.mode = self.loop = self.mission = self.description = None
        self.parameters = {}
        self.events.clear()
        self._waiting.clear()
        self.history.clear()

    def _take_part(self, topic: str, message: Any) -> None:
        now_us = message.now_us
        if self.instant is not None and now_us <= self.instant.now_us:
            return  # the answer to a query that a sample overtook
        parts = self._waiting.setdefault(now_us, {})
        parts[topic] = message
        if len(parts) < len(topics.SAMPLED):
            while len(self._waiting) > WAITING_MAX:
                del self._waiting[min(self._waiting)]
            return
        self._waiting = {us: others for us, others in self._waiting.items() if us > now_us}
        self.instant = Instant(**parts)
        self.history.add(self.instant)

    def _take_mode(self, message: topics.Mode) -> None:
        self.mode = message

    def _take_loop(self, message: topics.Loop) -> None:
        self.loop = message

    def _take_event(self, message: topics.Event) -> None:
        if not self.events or message.number > self.events[-1].number:
            self.events.append(message)

    def _take_events(self, message: topics.Events) -> None:
        known = {event.number: event for event in (*message.events, *self.events)}
        self.events.clear()
        self.events.extend(known[number] for number in sorted(known))

    def _take_parameters(self, message: topics.Parameters) -> None:
        self.parameters.update((p.name, p) for p in message.parameters)

    def _take_mission(self, message: topics.Mission) -> None:
        self.mission = message

    def _take_description(self, message: topics.Description) -> None:
        self.description = message.vehicle
