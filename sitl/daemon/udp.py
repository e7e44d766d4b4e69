"""The daemon's UDP sockets: of each vehicle for ground stations, onboard computers and viewers, and shared ones.

Never blocks but in `wait`. One selector holds them all, so that looking at a hundred of them costs what is there.
"""

import contextlib
import errno
import select
import selectors
import socket
import time
from collections.abc import Hashable, Iterator, Mapping
from typing import Any, Generic, TypeVar

from sitl.daemon.config import Address, SettingError
from sitl.daemon.shunning import Shunning

DATAGRAMS_AT_ONCE = 256  # per socket; the loop looks at its deadline before it takes more
_BUFFER_BYTES = 1 << 20
_DATAGRAM_BYTES = 65535

Place = TypeVar("Place", bound=Hashable)  # which of the daemon's sockets


class Sockets(Generic[Place]):
    """Bound sockets, each under its place. instance: the first whose ports they are, named where one is in use."""

    def __init__(self, addresses: Mapping[Place, Address], instance: int) -> None:
        self.addresses = dict(addresses)
        self.received = 0
        self.sent = 0
        self.dropped = 0  # datagrams that the system would not take
        self._shunning: Shunning[Place] = Shunning()
        self._sockets: dict[Place, socket.socket] = {}
        self._selector = selectors.DefaultSelector()
        try:
            for place, address in addresses.items():
                sock = self._sockets[place] = _bound(address, instance)
                self._selector.register(sock, selectors.EVENT_READ, place)
        except SettingError:
            self.close()
            raise
        # epoll and kqueue can be waited for themselves, and by select to the microsecond; epoll by itself to the next
        # whole millisecond
        self._readable: list[Any] = list(self._sockets.values())
        if hasattr(self._selector, "fileno"):
            self._readable = [self._selector]

    def wait(self, timeout_s: float) -> bool:
        """Sleep until a datagram is there (True) or the time is over (False)."""
        return bool(select.select(self._readable, (), (), max(0.0, timeout_s))[0])

    def rest(self, seconds: float) -> None:
        """Sleep, whatever arrives."""
        time.sleep(max(0.0, seconds))

    def receive(self) -> Iterator[tuple[Place, Address, bytes]]:
        """What has come in, without waiting, from each socket in turn: the caller may stop before all is read."""
        waiting = [(key.data, self._sockets[key.data]) for key, _ in self._selector.select(0.0)]
        for _ in range(DATAGRAMS_AT_ONCE):
            for entry in tuple(waiting):
                place, sock = entry
                try:
                    data, address = sock.recvfrom(_DATAGRAM_BYTES)
                except BlockingIOError:
                    waiting.remove(entry)
                    continue
                except OSError:
                    continue  # Windows reports a peer's closed port here; nothing was received
                self.received += 1
                yield place, address, data
            if not waiting:
                return

    @property
    def shunned(self) -> int:
        """How often a flooding address has been shut out."""
        return self._shunning.shunned

    def refused(self, place: Place, address: Address, wall_s: float) -> None:
        """A datagram was more than its sender may send: too many of these, and the system drops the rest."""
        self._shunning.refused(self._sockets[place], place, address, wall_s)

    def pardon(self, wall_s: float) -> None:
        """Listen again to those that were shut out long enough."""
        self._shunning.pardon(wall_s)

    def send(self, place: Place, address: Address, data: bytes) -> None:
        """Hand a datagram to the system; one that it refuses is counted and forgotten, as on any UDP link."""
        try:
            self._sockets[place].sendto(data, address)
            self.sent += 1
        except OSError:
            self.dropped += 1

    def close(self) -> None:
        self._shunning.close()
        self._selector.close()
        for sock in self._sockets.values():
            with contextlib.suppress(OSError):
                sock.close()


def _bound(address: Address, instance: int) -> socket.socket:
    host, port = address
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.setblocking(False)
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER_BYTES)
        sock.bind(address)
    except OSError as error:
        sock.close()
        if error.errno == errno.EADDRINUSE:
            raise SettingError(
                f"UDP port {port} on {host} is in use: is instance {instance} running already? "
                f"Choose another with --instance {instance + 1}"
            ) from None
        raise SettingError(f"can't listen on {host}:{port}: {error.strerror}") from None
    return sock
