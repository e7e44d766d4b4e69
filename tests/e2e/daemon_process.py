"""A real daemon in a process of its own, and a real pymavlink client, for the tests in this folder."""

import contextlib
import os
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

os.environ.setdefault("MAVLINK20", "1")

from pymavlink.dialects.v20 import common as mavlink

ROOT = Path(__file__).resolve().parents[2]
BOOT_LIMIT_S = 60.0  # with a cold kernel cache
REPLY_LIMIT_S = 10.0
INSTANCES = range(33, 40)  # their ports are nobody else's default


def free_instance(among: Sequence[int] = INSTANCES) -> int:
    """An instance whose ports nobody holds."""
    first = os.getpid() % len(among)  # another run of these tests looks for one at the same time
    for instance in (*among[first:], *among[:first]):
        held = []
        try:
            for kind, port in (
                (socket.SOCK_DGRAM, 18570),
                (socket.SOCK_DGRAM, 14580),
                (socket.SOCK_DGRAM, 19410),
                (socket.SOCK_DGRAM, 19450),
                (socket.SOCK_STREAM, 7447),
                *([(socket.SOCK_DGRAM, 14540)] if instance < 9 else []),  # from there on it is shared
            ):
                sock = socket.socket(socket.AF_INET, kind)
                held.append(sock)
                if kind == socket.SOCK_STREAM:
                    sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                sock.bind(("127.0.0.1", port + instance))
        except OSError:
            continue
        finally:
            for sock in held:
                sock.close()
        return instance
    raise RuntimeError("all instances for tests are taken")


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "sitl", *arguments]


class Daemon:
    """`sitl run`; its standard error goes to a file."""

    def __init__(self, folder: Path, *arguments: str, instance: int | None = None, zenoh: bool = False) -> None:
        self.instance = free_instance() if instance is None else instance
        self.state_dir = folder / "state"
        self.log_path = folder / f"log-{time.monotonic_ns()}.txt"
        own = ["--instance", str(self.instance), "--state-dir", str(self.state_dir)]
        with self.log_path.open("w") as log:
            self.started_s = time.monotonic()
            self.process = subprocess.Popen(
                command("run", *own, *([] if zenoh else ["--no-zenoh"]), *arguments),
                stdout=subprocess.DEVNULL,
                stderr=log,
                cwd=ROOT,
            )

    @property
    def log(self) -> str:
        return self.log_path.read_text()

    @property
    def zenoh_endpoint(self) -> str:
        return f"tcp/127.0.0.1:{7447 + self.instance}"

    def stop(self, number: int = signal.SIGINT) -> int:
        """Signal it and wait; its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.process.wait(20)

    def __enter__(self) -> "Daemon":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(20)


class Client:
    """A ground station on the daemon's GCS port, seeing nothing but what that daemon sends to it."""

    def __init__(self, daemon: Daemon, onboard: bool = False) -> None:
        self._daemon = daemon
        self._port = (14580 if onboard else 18570) + daemon.instance
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self.mav = mavlink.MAVLink(None, 255, 190)
        self._hello_s = float("-inf")

    def send_bytes(self, data: bytes) -> None:
        self._socket.sendto(data, ("127.0.0.1", self._port))

    def send(self, message: object) -> None:
        self.send_bytes(message.pack(self.mav))

    def messages(self, limit_s: float) -> Iterator:
        """What arrives within a time, with a heartbeat of our own each half second."""
        end_s = time.monotonic() + limit_s
        while (now_s := time.monotonic()) < end_s:
            if now_s - self._hello_s > 0.5:
                self._hello_s = now_s
                self.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
            self._socket.settimeout(min(0.25, end_s - now_s))
            try:
                data, address = self._socket.recvfrom(65535)
            except (TimeoutError, ConnectionRefusedError):
                continue
            if address[1] != self._port:
                continue
            yield from (m for m in self._parser.parse_buffer(data) or [] if m.get_type() != "BAD_DATA")

    def wait(self, wanted: Callable[[object], bool] | str, limit_s: float = REPLY_LIMIT_S):
        """The first message that fits, by name or by test."""
        fits = (lambda m: m.get_type() == wanted) if isinstance(wanted, str) else wanted
        for message in self.messages(limit_s):
            if fits(message):
                return message
        raise AssertionError(f"not heard within {limit_s} s: {wanted}; the daemon's log:\n{self._daemon.log}")

    def until_ready(self) -> None:
        standing_by = mavlink.MAV_STATE_STANDBY
        self.wait(lambda m: m.get_type() == "HEARTBEAT" and m.system_status == standing_by, BOOT_LIMIT_S)
        assert self._daemon.process.poll() is None, f"another daemon answers; this one's log:\n{self._daemon.log}"

    def request(self, message: object, fits: Callable[[object], bool]):
        """The answer to a request, which is repeated each second as on any link that may lose datagrams."""
        self.drain()
        for repetition in range(round(REPLY_LIMIT_S)):
            if hasattr(message, "confirmation"):
                message.confirmation = repetition  # so that it isn't carried out twice where only the answer was late
            self.send(message)
            for answer in self.messages(1.0):
                if fits(answer):
                    return answer
        raise AssertionError(f"no answer to {message}; the daemon's log:\n{self._daemon.log}")

    def command(self, number: int, *parameters: float) -> int:
        """COMMAND_LONG; the MAV_RESULT that comes back."""
        seven = (*parameters, *(0.0,) * (7 - len(parameters)))
        message = mavlink.MAVLink_command_long_message(self._daemon.instance + 1, 1, number, 0, *seven)
        return self.request(message, lambda m: m.get_type() == "COMMAND_ACK" and m.command == number).result

    def set(self, name: str, value: float, integer: bool = False) -> float:
        """Write a parameter; the value in force that comes back."""
        kind = mavlink.MAV_PARAM_TYPE_INT32 if integer else mavlink.MAV_PARAM_TYPE_REAL32
        wire = struct.unpack("<f", struct.pack("<i", int(value)))[0] if integer else value
        message = mavlink.MAVLink_param_set_message(self._daemon.instance + 1, 1, name.encode(), wire, kind)
        return self._value(message, name)

    def get(self, name: str) -> float:
        message = mavlink.MAVLink_param_request_read_message(self._daemon.instance + 1, 1, name.encode(), -1)
        return self._value(message, name)

    def _value(self, message: object, name: str) -> float:
        m = self.request(message, lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == name)
        if m.param_type == mavlink.MAV_PARAM_TYPE_INT32:
            return struct.unpack("<i", struct.pack("<f", m.param_value))[0]
        return m.param_value

    def drain(self) -> None:
        """Throw away what has gathered in the socket while nobody read it."""
        self._socket.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                self._socket.recvfrom(65535)

    def boot_ms(self) -> int:
        """Simulation time as the newest attitude tells it."""
        self.drain()
        return self.wait("ATTITUDE").time_boot_ms

    def close(self) -> None:
        self._socket.close()
