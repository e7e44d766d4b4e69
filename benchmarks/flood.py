"""The daemon under a flood: heartbeats, answers to another peer, and the loop's deadlines.

One address sends valid messages of many kinds as fast as is asked; a ground station at another address listens and
asks for something twice a second.
"""

import contextlib
import re
import socket
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.figure import Figure, at_most, told
from benchmarks.processes import LOCAL_GCS, BenchmarkError, free_instance, running, start
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

RATE_HZ = 20_000
LASTS_S = 30.0
_SLICE_S = 0.002
_ASK_S = 0.5
_BOOT_S = 60.0


class Flooded(NamedTuple):
    """What a ground station saw of a flooded vehicle."""

    sent: int
    seconds: float
    beats_s: list[float]  # between two heartbeats
    asked: int
    answered: int


def measure(quick: bool) -> Iterator[Figure]:
    seconds = 5.0 if quick else LASTS_S
    (_, calm), (seen, loop) = (_flooded(rate_Hz, seconds) for rate_Hz in (0.0, RATE_HZ))
    yield told("flood from one address", f"{seen.sent / seen.seconds:.0f} messages/s for {seen.seconds:.0f} s")
    yield at_most("  longest time between two heartbeats to another", [max(seen.beats_s)], 1.5, "s")
    yield at_most("  requests of another left unanswered", [100.0 * (1.0 - seen.answered / seen.asked)], 1.0, "%")
    yield at_most(f"  turns of the loop late by more than one, of {loop.turns}", [loop.late_percent], 1.0, "%")
    yield told("  the same without the flood", f"{calm.late_percent:.2f} %, the latest by {calm.worst_ms:.1f} ms")
    yield told("  the latest turn, faults", f"{loop.worst_ms:.1f} ms, {loop.faults}")


class Punctuality(NamedTuple):
    """The daemon's figures of its loop."""

    turns: int
    overruns: int
    worst_ms: float
    faults: int

    @property
    def late_percent(self) -> float:
        return 100.0 * self.overruns / self.turns


def _flooded(rate_Hz: float, seconds: float) -> tuple[Flooded, Punctuality]:
    """A daemon of its own, flooded."""
    instance = free_instance()
    with tempfile.TemporaryDirectory(prefix="yawsitter-benchmark-") as folder:
        log = Path(folder) / "log"
        arguments = ("run", "--instance", str(instance), "--state-dir", folder, "--no-zenoh")
        with log.open("w") as file, running(start("sitl", *arguments, stderr=file)) as process:
            seen = flood(instance, rate_Hz, seconds)
            process.terminate()
            process.wait(10.0)
        return seen, punctuality(log.read_text())


def punctuality(log: str) -> Punctuality:
    """From the daemon's last words. Raises BenchmarkError."""
    found = re.search(r"(\d+) turns, (\d+) late by more than one, the worst by ([\d.]+) ms, (\d+) faults", log)
    if found is None:
        raise BenchmarkError(f"the daemon's log doesn't tell its figures:\n{log}")
    return Punctuality(int(found[1]), int(found[2]), float(found[3]), int(found[4]))


def messages(system: int) -> list[bytes]:
    """Valid frames that do no harm, of the kinds that cost most to answer among them."""
    encoder = codec.Encoder(254, mav.MAV_COMP_ID_MISSIONPLANNER)
    to = {"target_system": system, "target_component": 1}
    kinds = (
        codec.message("HEARTBEAT", type=mav.MAV_TYPE_GCS, autopilot=mav.MAV_AUTOPILOT_INVALID),
        codec.message("COMMAND_LONG", command=mav.MAV_CMD_REQUEST_MESSAGE, param1=30.0, **to),
        codec.message("PARAM_REQUEST_READ", param_id="RATE_Y_P", param_index=-1, **to),
        codec.message("COMMAND_LONG", command=mav.MAV_CMD_DO_SET_SERVO, **to),
        codec.message("SET_POSITION_TARGET_LOCAL_NED", coordinate_frame=1, type_mask=0xFF8, **to),
        codec.message("ATTITUDE", roll=0.1),
        codec.message("PING", seq=1),
        codec.message("MISSION_REQUEST_LIST", **to),
    )
    return [encoder.encode(kind) for kind in kinds]


def flood(instance: int, rate_Hz: float, lasts_s: float) -> Flooded:
    """Flood the vehicle's port for ground stations from one address and listen at another. Raises BenchmarkError."""
    system, port = instance + 1, ("127.0.0.1", LOCAL_GCS + instance)
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flooder,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear,
    ):
        for each in (flooder, ear):
            each.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
            each.setblocking(False)
            each.bind(("127.0.0.1", 0))
        station = _Station(ear, system, port)
        station.until_ready()
        frames, sent, start_s = messages(system), 0, time.perf_counter()
        station.begin()
        while (now_s := time.perf_counter()) < start_s + lasts_s:
            due = int((now_s - start_s) * rate_Hz)
            for _ in range(min(due - sent, 2000)):  # what a stalled sender missed comes at once, within reason
                with contextlib.suppress(BlockingIOError):
                    flooder.sendto(frames[sent % len(frames)], port)
                sent += 1
            station.turn(now_s)
            time.sleep(_SLICE_S)
        took_s = time.perf_counter() - start_s
        for _ in range(20):
            station.listen(time.perf_counter())
            time.sleep(0.02)
        return Flooded(sent, took_s, station.beats(), station.asked, station.answered)


class _Station:
    """A ground station that asks for the vehicle's home again and again, with a number to tell the answers by."""

    def __init__(self, ear: socket.socket, system: int, port: tuple[str, int]) -> None:
        self._ear, self._port = ear, port
        self._parser, self._encoder = codec.Parser(), codec.Encoder(255, mav.MAV_COMP_ID_MISSIONPLANNER)
        self._system = system
        self._asked_s = float("-inf")
        self.ready = False
        self.begin()

    def begin(self) -> None:
        self.asked = self.answered = 0
        self._heard_s: list[float] = []

    def until_ready(self) -> None:
        end_s = time.perf_counter() + _BOOT_S
        while not self.ready:
            if (now_s := time.perf_counter()) > end_s:
                raise BenchmarkError(f"the vehicle isn't up after {_BOOT_S:g} s")
            self.turn(now_s)
            time.sleep(0.02)

    def turn(self, now_s: float) -> None:
        if now_s >= self._asked_s + _ASK_S:
            self._asked_s = now_s
            self.asked += 1
            ping = codec.message("PING", seq=self.asked)
            beat = codec.message("HEARTBEAT", type=mav.MAV_TYPE_GCS, autopilot=mav.MAV_AUTOPILOT_INVALID)
            for message in (beat, ping):
                self._ear.sendto(self._encoder.encode(message), self._port)
        self.listen(now_s)

    def listen(self, now_s: float) -> None:
        while True:
            try:
                data = self._ear.recv(65_535)
            except BlockingIOError:
                return
            for frame in self._parser.feed(data):
                if frame.name == "HEARTBEAT":
                    self.ready = self.ready or frame.message.system_status == mav.MAV_STATE_STANDBY
                    self._heard_s.append(now_s)
                elif frame.name == "PING":
                    self.answered += 1

    def beats(self) -> list[float]:
        return [b - a for a, b in zip(self._heard_s, self._heard_s[1:], strict=False)]
