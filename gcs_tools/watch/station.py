"""All vehicles that are heard at one endpoint, as one talker behind one UdpLink; one of them is the chosen one."""

import math
from collections.abc import Callable

from gcs_tools.client import Client, LinkError
from gcs_tools.fleet import system_of
from gcs_tools.watch.seen import Seen


class Station:
    """make: a client of whichever vehicle is heard first. system: the one to choose; None: the first one heard."""

    def __init__(self, make: Callable[[], Client], system: int | None = None, seconds: float = math.inf) -> None:
        self.wanted = system
        self.vehicles: dict[int, Seen] = {}  # by system id
        self.began_s: float | None = None  # the caller's time of the first turn
        self.fault: LinkError | None = None
        self._make, self._seconds = make, seconds
        self._stranger = Seen(make())  # who hears those that aren't known yet; it says the heartbeats
        self._left, self._wall_s = False, -math.inf

    @property
    def order(self) -> list[Seen]:
        return [self.vehicles[system] for system in sorted(self.vehicles)]

    @property
    def chosen(self) -> Seen | None:
        return next((seen for seen in self.vehicles.values() if seen.chosen), None)

    @property
    def unauthentic(self) -> int:
        """Frames heard of nobody known, that the key doesn't fit."""
        return self._stranger.client.unauthentic

    def choose(self, place: int) -> None:
        """The vehicle at a place of the order, from 0; another place changes nothing."""
        if 0 <= place < len(self.vehicles):
            for k, seen in enumerate(self.order):
                seen.chosen = k == place

    def move(self, steps: int) -> None:
        """Choose the vehicle so many places further on, round and round."""
        if self.vehicles:
            place = next((k for k, seen in enumerate(self.order) if seen.chosen), -1 if steps > 0 else 0)
            self.choose((place + steps) % len(self.vehicles))

    def leave(self) -> None:
        """End; the vehicles get their own stream rates back with the next poll."""
        if not self._left:
            self._left = True
            for seen in self.vehicles.values():
                seen.client.stop(LinkError("left"))
                seen.leave()

    def receive(self, data: bytes, wall_s: float) -> bool:
        self._wall_s = wall_s
        seen = self.vehicles.get(system_of(data) or 0)
        if seen is not None:
            return seen.client.receive(data, wall_s)
        stranger = self._stranger
        if not stranger.client.receive(data, wall_s):
            return False
        self._know(stranger)
        return True

    def _know(self, seen: Seen) -> None:
        self.vehicles[seen.system] = seen
        seen.chosen = self.chosen is None and self.wanted in (None, seen.system)
        seen.client.start(seen.attend())
        self._stranger = Seen(self._make())
        self._stranger.client.heartbeats = False  # one is enough: it goes to every vehicle

    def poll(self, wall_s: float) -> list[bytes]:
        self._wall_s = wall_s
        if self.began_s is None:
            self.began_s = wall_s
        clients = [seen.client for seen in (*self.vehicles.values(), self._stranger)]
        return [data for client in clients for data in client.poll(wall_s)]

    @property
    def next_deadline(self) -> float:
        return min(seen.client.next_deadline for seen in (*self.vehicles.values(), self._stranger))

    @property
    def finished(self) -> bool:
        return self._left or (self.began_s is not None and self._wall_s - self.began_s >= self._seconds)
