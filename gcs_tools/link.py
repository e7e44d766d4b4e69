"""The tools' only file with sockets and clocks: it carries a Client's bytes over UDP and tells it the time.

udpin:HOST:PORT     listen there; answer whoever the vehicle turns out to be
udpout:HOST:PORT    send there first
"""

import errno
import select
import socket
import time
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import NamedTuple, Protocol

from gcs_tools.client import LinkError
from gcs_tools.fleet import system_of
from gcs_tools.impairment import GOOD, Impairment, Wire
from sitl.mavlink.signing import Signer

Address = tuple[str, int]

LONGEST_WAIT_S = 0.1
_CALL_INSTEAD = "; to call the vehicle instead: --connect udpout:127.0.0.1:18570 (plus its instance)"
_RECEIVE_BYTES = 65_535
_BUFFER_BYTES = 1 << 20  # a burst of streams while a figure is being drawn


def now_s() -> float:
    """The wall clock that all of the tools' times are on [s]."""
    return time.perf_counter()


def sleep_until(wall_s: float) -> None:
    left_s = wall_s - now_s()
    if left_s > 0.0:
        time.sleep(left_s)


class Talker(Protocol):
    """Who is behind a link: a Client, or many of them."""

    def receive(self, data: bytes, wall_s: float) -> bool: ...
    def poll(self, wall_s: float) -> list[bytes]: ...
    @property
    def next_deadline(self) -> float: ...
    @property
    def finished(self) -> bool: ...
    @property
    def fault(self) -> LinkError | None: ...


class Connection(NamedTuple):
    """Where to listen, or whom to call."""

    listens: bool
    host: str
    port: int

    def __str__(self) -> str:
        return f"udp{'in' if self.listens else 'out'}:{self.host}:{self.port}"


def parse_connection(text: str) -> Connection:
    """'udpin:HOST:PORT' or 'udpout:HOST:PORT'. Raises ValueError whose message names what is allowed."""
    kind, _, rest = text.partition(":")
    host, _, port = rest.rpartition(":")
    if kind not in ("udpin", "udpout") or not host or not port.isdecimal() or not 1 <= int(port) <= 65535:
        raise ValueError(f"'{text}' is not udpin:HOST:PORT or udpout:HOST:PORT (port 1 to 65535)")
    return Connection(kind == "udpin", host, int(port))


def signer(key: bytes) -> Signer:
    """One that stamps by this module's clock."""
    return Signer(key, unix_s=time.time() - now_s())


class UdpLink:
    """One socket between a Client and its vehicle (or a Fleet and its), and what is to go wrong on the way.

    Vehicles that are heard from several addresses are all answered: each takes what is for it.
    """

    def __init__(
        self, connection: Connection, impairment: Impairment = GOOD, tap: Callable[[bytes, float], None] | None = None
    ) -> None:
        """tap: sees what the client hears and says, with the time of day [s since 1970]."""
        self._tap = tap
        where = f"{connection.host}:{connection.port}"
        self._peers: dict[int | None, Address] = {}  # by system; None: who is called, until somebody is heard
        self._in: Wire[tuple[bytes, Address]]
        self._out: Wire[bytes]
        self._in, self._out = Wire(impairment), Wire(impairment.reversed())
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
            self._socket.setblocking(False)
            if connection.listens:
                self._socket.bind((connection.host, connection.port))
            else:
                self._peers[None] = (socket.gethostbyname(connection.host), connection.port)
        except OSError as error:
            self._socket.close()
            verb = "listen on" if connection.listens else "reach"
            instead = _CALL_INSTEAD if error.errno == errno.EADDRINUSE else ""
            raise LinkError(f"can't {verb} {where}: {error.strerror or error}{instead}") from None

    def __enter__(self) -> "UdpLink":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._socket.close()

    @property
    def peer(self) -> Address | None:
        """Who is called, or was heard first."""
        return next(iter(self._peers.values()), None)

    def turn(self, client: Talker) -> None:
        """Send what the client has, wait for an arrival or its next deadline, hand over what has arrived."""
        self.flush(client)
        next_s = min(client.next_deadline, self._in.next_s, self._out.next_s)
        wait_s = 0.0 if client.finished else min(LONGEST_WAIT_S, max(0.0, next_s - now_s()))
        select.select([self._socket], [], [], wait_s)
        while True:
            try:
                data, address = self._socket.recvfrom(_RECEIVE_BYTES)
            except BlockingIOError:
                break
            except ConnectionError:
                continue  # nobody listens there (yet)
            self._in.put(now_s(), (data, address))
        for data, address in self._in.take(now_s()):
            if self._tap is not None:
                self._tap(data, time.time())
            if client.receive(data, now_s()):
                self._peers.pop(None, None)
                self._peers[system_of(data)] = address

    def flush(self, client: Talker) -> None:
        """Send what the client has to say now. What nobody has been heard for is dropped."""
        for data in client.poll(now_s()):
            if self._tap is not None:
                self._tap(data, time.time())
            self._out.put(now_s(), data)
        for data in self._out.take(now_s()):
            for peer in set(self._peers.values()):
                try:
                    self._socket.sendto(data, peer)
                except (BlockingIOError, ConnectionError):
                    continue
                except OSError as error:
                    where = f"{peer[0]}:{peer[1]}"
                    raise LinkError(f"can't send to {where}: {error.strerror or error}") from None

    def run(self, client: Talker, each_turn: Callable[[float], None] = lambda _wall_s: None) -> None:
        """Until the client's script has ended, and what it sent last is on its way. Raises its fault."""
        while not client.finished:
            self.turn(client)
            each_turn(now_s())
        self.flush(client)
        if client.fault is not None:
            raise client.fault


def free_ports(*, udp: Iterable[int], tcp: Iterable[int]) -> bool:
    """Whether all of these can be listened on at 127.0.0.1."""
    kinds = [(socket.SOCK_DGRAM, port) for port in udp] + [(socket.SOCK_STREAM, port) for port in tcp]
    for kind, port in kinds:
        with socket.socket(socket.AF_INET, kind) as probe:
            if kind == socket.SOCK_STREAM:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                return False
    return True
