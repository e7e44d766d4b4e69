"""The vehicle's log of events: numbered without gaps, so that every listener keeps its own place."""

from collections import deque

from sitl.onboard.modes import Event, EventKind, Severity

_KEPT = 1000


class EventLog:
    """The last 1000 events. `now_us` is set by whoever steps the vehicle."""

    def __init__(self) -> None:
        self.now_us = 0
        self.next_number = 0
        self._events: deque[Event] = deque(maxlen=_KEPT)

    def add(self, kind: EventKind, severity: Severity, text: str, value: int = 0) -> None:
        self._events.append(Event(self.next_number, self.now_us, kind, severity, text, value))
        self.next_number += 1

    def tell(self, severity: Severity, text: str) -> None:
        """A text for whoever watches the vehicle."""
        self.add(EventKind.TEXT, severity, text)

    def since(self, number: int) -> list[Event]:
        """All kept events with numbers from `number` on, oldest first."""
        if number >= self.next_number:
            return []
        first = self.next_number - len(self._events)
        return list(self._events)[max(0, number - first) :]
