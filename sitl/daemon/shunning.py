"""Letting the system itself drop what a flooding address sends, so that it can't fill the buffer that others share.

A second socket at the same port, connected to that address, gets all that it sends, and is never read. Only Linux is
known to sort datagrams so; elsewhere a flood is dropped by the vehicle alone, which takes it time.
"""

import contextlib
import logging
import socket
import sys
from collections.abc import Hashable
from typing import Generic, NamedTuple, TypeVar

from sitl.daemon.config import Address

SHUN_S = 2.0  # how long an address is not listened to
REFUSALS = 500  # datagrams refused within a second that earn it that
ADDRESSES_MAX = 16  # not listened to at a time
COUNTED_MAX = 256  # addresses counted at a time: a flood from more is not one that this can stop
TOLD_S = 10.0  # between two lines in the log

log = logging.getLogger(__name__)

Place = TypeVar("Place", bound=Hashable)  # which of the daemon's sockets


class _Sink(NamedTuple):
    until_s: float
    socket: socket.socket


class Shunning(Generic[Place]):
    """Counts refusals by address. `shunned`: how often an address has been shut out."""

    def __init__(self) -> None:
        self.shunned = 0
        self._refusals: dict[tuple[Place, Address], int] = {}
        self._since_s = self._told_s = float("-inf")
        self._sinks: dict[tuple[Place, Address], _Sink] = {}

    def refused(self, listening: socket.socket, place: Place, address: Address, wall_s: float) -> None:
        """A datagram from `address` to `listening` was more than it may send."""
        if wall_s - self._since_s > 1.0:
            self._refusals.clear()
            self._since_s = wall_s
        sender = place, address
        count = self._refusals.get(sender, 0) + 1
        if count > 1 or len(self._refusals) < COUNTED_MAX:
            self._refusals[sender] = count
        if count >= REFUSALS and len(self._sinks) < ADDRESSES_MAX and sender not in self._sinks:
            self._shun(listening, sender, wall_s)

    def pardon(self, wall_s: float) -> None:
        """Listen again to those whose time is over."""
        for sender, sink in list(self._sinks.items()):
            if wall_s >= sink.until_s:
                sink.socket.close()
                del self._sinks[sender]

    def close(self) -> None:
        self.pardon(float("inf"))

    def _shun(self, listening: socket.socket, sender: tuple[Place, Address], wall_s: float) -> None:
        if sys.platform != "linux":
            return
        sink = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        option = socket.SOL_SOCKET, socket.SO_REUSEADDR
        try:
            sink.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)  # the least there is
            sink.setsockopt(*option, 1)
            listening.setsockopt(*option, 1)  # for this moment: nobody else shall be able to share the port
            sink.bind(listening.getsockname())
            sink.connect(sender[1])
        except OSError:
            sink.close()
            return
        finally:
            with contextlib.suppress(OSError):
                listening.setsockopt(*option, 0)
        self._sinks[sender] = _Sink(wall_s + SHUN_S, sink)
        self._refusals.pop(sender, None)
        self.shunned += 1
        if wall_s - self._told_s >= TOLD_S:
            self._told_s = wall_s
            host, number = sender[1]
            log.warning("%s:%d sends far more than it may, and is not listened to for %g s", host, number, SHUN_S)
