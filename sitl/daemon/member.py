"""One vehicle in the loop, with its link, its telemetry and its recorder. What goes wrong with it stays here.

Faults are counted, logged at most once a second, and survived: the loop and the vehicles beside it don't notice.
"""

import logging
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Generic

from sitl.daemon.config import Address
from sitl.daemon.udp import Place, Sockets
from sitl.mavlink.peers import PortKind
from sitl.onboard.modes import EventKind, Severity

if TYPE_CHECKING:
    from sitl.daemon.flight_recorder import FlightRecorder
    from sitl.mavlink.endpoint import Endpoint
    from sitl.telemetry.feed import Feed
    from sitl.telemetry.publisher import Publisher
    from sitl.vehicle import Vehicle

log = logging.getLogger(__name__)

QUIET_S = 1.0  # between two reports of faults

_TOLD = (EventKind.TEXT, EventKind.MODE, EventKind.ARMED)
_LEVELS = {
    Severity.EMERGENCY: logging.CRITICAL,
    Severity.ALERT: logging.CRITICAL,
    Severity.CRITICAL: logging.CRITICAL,
    Severity.ERROR: logging.ERROR,
    Severity.WARNING: logging.WARNING,
    Severity.DEBUG: logging.DEBUG,
}


class Complaints:
    """Faults, counted, and one in a second logged."""

    def __init__(self) -> None:
        self.count = 0
        self._told_s = float("-inf")

    def add(self, what: str, wall_s: float) -> None:
        """The exception being handled."""
        self.count += 1
        if wall_s - self._told_s >= QUIET_S:
            self._told_s = wall_s
            log.exception("fault %d: %s", self.count, what)


class Member(Generic[Place]):
    """A vehicle behind its endpoint. places: which of the sockets are its ports; name: of the vehicle in the log.

    began_us: the loop's time when the vehicle's own was zero. failed: its simulation raised, and stands still.
    """

    def __init__(
        self,
        vehicle: "Vehicle",
        endpoint: "Endpoint",
        places: Mapping[PortKind, Place],
        *,
        publisher: "Publisher | None" = None,
        name: str = "",
    ) -> None:
        self.vehicle = vehicle
        self.endpoint = endpoint
        self.places = places
        self.publisher = publisher
        self.complaints = Complaints()
        self.began_us = 0
        self.failed = False
        self.generation = -1  # of the parameters that the loop has followed
        self.feed: Feed | None = None
        self.recorder: FlightRecorder | None = None
        self._name = f"{name}: " if name else ""
        self._next_event = 0

    @property
    def faults(self) -> int:
        return self.complaints.count + self.endpoint.faults

    def watch_frames(self, clock: Callable[[], float]) -> None:
        """Show the feed and the recorder, if there are any, the MAVLink frames."""
        feed, recorder = self.feed if self.publisher is not None else None, self.recorder

        def frame(data: bytes, outgoing: bool) -> None:
            if feed is not None:
                feed.frame(data, outgoing)
            if recorder is not None:
                recorder.frame(data, clock())

        if feed is not None or recorder is not None:
            self.endpoint.on_frame = frame

    def advance(self, loop_us: int, wall_s: float) -> None:
        """Simulate up to this time of the loop's."""
        recorder, until_us = self.recorder, loop_us - self.began_us
        try:
            if recorder is None:
                self.vehicle.advance(until_us)
            else:
                trace = recorder.trace(until_us, wall_s)
                self.vehicle.advance(until_us, trace)
                recorder.take(trace)
        except Exception as error:
            self.failed = True
            self.complaints.add(f"{self._name}the simulation failed and is paused", wall_s)
            text = f"Simulation failed and is paused: {type(error).__name__}"
            self.vehicle.events.tell(Severity.CRITICAL, text)

    def receive(self, data: bytes, address: Address, kind: PortKind, wall_s: float) -> bool:
        """A datagram that came to one of its own ports. False: it was more than its sender may send."""
        try:
            return self.endpoint.receive(data, address, kind, wall_s)
        except Exception:
            what = f"{self._name}a datagram of {len(data)} bytes from {address[0]}:{address[1]}"
            self.complaints.add(what, wall_s)
            return True

    def send(self, sockets: Sockets[Place], wall_s: float) -> None:
        """What the link has to say now."""
        try:
            for kind, address, data in self.endpoint.poll(wall_s):
                sockets.send(self.places[kind], address, data)
        except Exception:
            self.complaints.add(f"{self._name}the link", wall_s)

    def log_events(self) -> None:
        events = self.vehicle.events
        if events.next_number != self._next_event:
            for event in events.since(self._next_event):
                level = _LEVELS.get(event.severity, logging.INFO) if event.kind in _TOLD else logging.DEBUG
                what = event.text or event.value
                log.log(level, "%s%.3f s: %s: %s", self._name, event.now_us * 1e-6, event.kind.value, what)
            self._next_event = events.next_number
