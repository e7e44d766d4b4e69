"""A daemon behind a tap, so that what a client said and was answered can be held against docs/link.md."""

import contextlib
import selectors
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from daemon_process import BOOT_LIMIT_S, INSTANCES, Daemon

from conformance import clients
from conformance.observation import observe
from sitl.mavlink.codec import Frame, Parser, mav


class Running(NamedTuple):
    """A daemon's instance, and the UDP port at which a client reaches it through the tap."""

    instance: int
    port: int


@contextlib.contextmanager
def recorded(client: str | None, folder: Path, *arguments: str, onboard: bool = False) -> Iterator[Running]:
    """A daemon that afterwards has met no fault, and left nothing unanswered that it answered `client` before."""
    with _running(folder, *arguments) as daemon:
        with Tap((14580 if onboard else 18570) + daemon.instance) as tap:
            yield Running(daemon.instance, tap.port)
        assert daemon.stop() == 0, daemon.log
    assert ", 0 faults" in daemon.log
    if client is not None:
        clients.note(client, observe(tap.frames(), daemon.instance + 1))


def _running(folder: Path, *arguments: str) -> Daemon:
    """A daemon that is up; another run of these tests may take an instance's ports between the look and the start."""
    for _ in INSTANCES:
        daemon = Daemon(folder, *arguments)
        end_s = time.monotonic() + BOOT_LIMIT_S
        while daemon.process.poll() is None and time.monotonic() < end_s:
            if "system id" in daemon.log:  # its banner
                return daemon
            time.sleep(0.05)
        with daemon:  # end it
            assert daemon.process.poll() is not None, f"not up within {BOOT_LIMIT_S:g} s"
        assert "--instance" in daemon.log, daemon.log
    raise AssertionError("all instances for tests are taken")


class Tap:
    """Passes datagrams on between clients and the vehicle's port, and keeps what the clients sent.

    Of what comes back, which is streams for the most part, it keeps each message's first and every COMMAND_ACK.
    """

    def __init__(self, vehicle_port: int) -> None:
        self._vehicle = "127.0.0.1", vehicle_port
        self._door = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._door.bind(("127.0.0.1", 0))
        self.port: int = self._door.getsockname()[1]
        self._kept: list[bytes] = []
        self._heard: set[bytes] = set()
        self._ways: dict[tuple[str, int], socket.socket] = {}
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._door, selectors.EVENT_READ)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> "Tap":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join()
        self._selector.close()
        for way in (self._door, *self._ways.values()):
            way.close()

    def frames(self) -> Iterator[Frame]:
        """What was kept, in its order."""
        parser = Parser()
        for data in self._kept:
            yield from parser.feed(data)

    def _run(self) -> None:
        while not self._ending.is_set():
            for key, _ in self._selector.select(0.2):
                with contextlib.suppress(ConnectionRefusedError):  # the vehicle is starting again
                    self._pass_on(key.fileobj, key.data)

    def _pass_on(self, source: socket.socket, client: tuple[str, int] | None) -> None:
        if client is not None:
            data = source.recv(65535)
            self._door.sendto(data, client)
            kind = data[7:10] if data[0] == 0xFD else data[5:6]
            if kind not in self._heard or kind[0] == mav.MAVLINK_MSG_ID_COMMAND_ACK:
                self._heard.add(kind)
                self._kept.append(data)
            return
        data, address = source.recvfrom(65535)
        way = self._ways.get(address)
        if way is None:
            way = self._ways[address] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            way.connect(self._vehicle)
            self._selector.register(way, selectors.EVENT_READ, address)
        self._kept.append(data)
        way.send(data)
