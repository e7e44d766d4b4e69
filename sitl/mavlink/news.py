"""What has happened on board, told to all peers."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from sitl.mavlink.codec import by_name, message
from sitl.mavlink.streams import BY_ID, STREAMS
from sitl.onboard.modes import Event, EventKind

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.parameters import ParameterService


class News:
    """Tells each event once; what normally flows slowly and has changed with it, at once."""

    def __init__(self, link: "Link", parameters: "ParameterService") -> None:
        self._link, self._parameters = link, parameters
        self._events = link.vehicle.events
        self._number = self._events.next_number

    @property
    def waiting(self) -> bool:
        return self._events.next_number != self._number

    def tell(self) -> bool:
        """Tell what has happened since the last call. True: the heartbeat has changed too."""
        events = self._events.since(self._number)
        self._number = self._events.next_number
        for event in events:
            teller = self._TELLERS.get(event.kind)
            if teller is not None:
                teller(self, event)
        return any(event.kind in (EventKind.MODE, EventKind.ARMED) for event in events)

    def _text(self, event: Event) -> None:
        self._link.tell(None, event.severity, event.text)

    def _parameter(self, event: Event) -> None:
        self._parameters.on_change(event)

    def _reached(self, event: Event) -> None:
        self._link.broadcast(message("MISSION_ITEM_REACHED", seq=event.value))

    def _stream(self, *names: str) -> None:
        view = self._link.view()
        for k in (k for name in names for k in BY_ID[by_name(name).id]):
            payload = STREAMS[k].payload(view)
            if payload:
                self._link.broadcast_packed(STREAMS[k].definition, payload)

    _TELLERS: "dict[EventKind, Callable[[News, Event], None]]" = {  # noqa: RUF012
        EventKind.TEXT: _text,
        EventKind.PARAMETER: _parameter,
        EventKind.ITEM_REACHED: _reached,
        EventKind.ITEM_CURRENT: lambda self, _event: self._stream("MISSION_CURRENT"),
        EventKind.PLAN: lambda self, _event: self._stream("MISSION_CURRENT"),
        EventKind.FENCE: lambda self, _event: self._stream("FENCE_STATUS"),
        EventKind.MODE: lambda self, _event: self._stream("CURRENT_MODE", "MISSION_CURRENT"),
        EventKind.LANDED: lambda self, _event: self._stream("EXTENDED_SYS_STATE"),
        EventKind.HOME: lambda self, _event: self._stream("HOME_POSITION"),
    }
