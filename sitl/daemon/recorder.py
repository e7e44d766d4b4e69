"""Flights on their way to disk: all that is kept of them goes through a pipe to a process that writes it.

The loop never touches the disk and never waits: what the pipe has no room for stays here, and where the other side
can't keep up (at many times real time) control steps are left out: every second is kept, every fourth, eighth …
Light to import: the process is started before the vehicle is built.
"""

import contextlib
import importlib.util
import json
import logging
import os
import struct
import subprocess
import sys
import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sitl.daemon.config import SettingError
from sitl.mavlink.tlog import stamped

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

log = logging.getLogger(__name__)

HEAD = struct.Struct("<cI")  # what follows, and how many bytes of it
MESSAGE = struct.Struct("<BQ")  # number of the topic, simulation time [µs]
BEGIN, FRAME, STEPS, TOPIC, END = b"B", b"F", b"S", b"M", b"E"

BEFORE_BYTES = 1 << 20  # of frames from before the flight, some ten seconds: they show what led to the arming
BACKLOG_MAX = 1 << 26  # bytes waiting for the pipe
THIN_AT = 1 << 24  # of them; beyond, control steps are left out
STRIDE_MAX = 1024
_PIPE_BYTES = 1 << 20
_CLOSE_S = 20.0


class Flight(NamedTuple):
    """What the writing side is told of a flight when it begins."""

    name: str
    instance: int
    unix_s: float
    now_us: int
    origin: tuple[float, float, float]  # latitude, longitude [deg], altitude AMSL [m]

    def pack(self) -> bytes:
        return json.dumps(self._asdict()).encode()


class Recorder:
    """One flight after the other into `folder`. Raises SettingError where that can't be."""

    def __init__(self, folder: Path, instance: int) -> None:
        self.folder = folder
        self.instance = instance
        self.flight: str | None = None  # name of the one under way
        self._closing: dict[str, tuple[int, int]] = {}  # flights that are over but not yet on disk: steps kept, seen
        self.steps_seen = self.steps_kept = 0
        self._before: deque[bytes] = deque()
        self._before_bytes = 0
        self._backlog = bytearray()
        self._stride = 1
        if importlib.util.find_spec("mcap") is None:
            raise SettingError("--record needs the package mcap: pip install 'yawsitter-sitl[record]'")
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SettingError(f"--record {folder}: {error.strerror}") from None
        if not os.access(folder, os.W_OK | os.X_OK):
            raise SettingError(f"--record {folder}: not writable")
        command = [sys.executable, "-m", "sitl.daemon.flight_writer", str(folder)]
        self._process: subprocess.Popen[bytes] | None = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._pipe, self._done = self._process.stdin.fileno(), self._process.stdout.fileno()
        os.set_blocking(self._pipe, False)
        os.set_blocking(self._done, False)
        with contextlib.suppress(ImportError, AttributeError, OSError):  # Linux alone lets a pipe hold more
            import fcntl

            fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)

    @property
    def works(self) -> bool:
        """Whether there still is somebody who writes."""
        return self._process is not None

    def writes(self, name: str) -> bool:
        """Whether a file of this name is still being written."""
        return any(name.startswith(flight) for flight in (*self._closing, self.flight or "/"))

    def begin(self, unix_s: float, now_us: int, origin: tuple[float, float, float]) -> None:
        stamp = time.strftime("%Y-%m-%d_%H-%M-%S", time.gmtime(unix_s)) + f"-{int(unix_s * 1e3) % 1000:03}"
        self.flight = f"{stamp}Z_instance-{self.instance}"
        self.steps_seen = self.steps_kept = 0
        self._put(BEGIN, Flight(self.flight, self.instance, unix_s, now_us, origin).pack())
        for entry in self._before:
            self._put(FRAME, entry)
        self._before.clear()
        self._before_bytes = 0

    def frame(self, frame: bytes, unix_s: float) -> None:
        """A MAVLink frame that passes; between flights the last ones are remembered."""
        entry = stamped(frame, unix_s)
        if self.flight is not None:
            self._put(FRAME, entry)
            return
        self._before.append(entry)
        self._before_bytes += len(entry)
        while self._before_bytes > BEFORE_BYTES:
            self._before_bytes -= len(self._before.popleft())

    def message(self, topic: int, now_us: int, data: bytes) -> None:
        """A telemetry message, of the topic with this number."""
        self._put(TOPIC, MESSAGE.pack(topic, now_us) + data)

    def steps(self, trace: "NDArray[np.float64]") -> None:
        """Control steps, a row each."""
        self._adapt()
        first = -self.steps_seen % self._stride
        kept = trace[first :: self._stride]
        self.steps_seen += len(trace)
        if len(kept) and self._put(STEPS, kept.tobytes()):
            self.steps_kept += len(kept)

    def _adapt(self) -> None:
        if len(self._backlog) > THIN_AT:
            self._stride = min(STRIDE_MAX, self._stride * 2)
        elif not self._backlog and self._stride > 1:
            self._stride //= 2

    def end(self) -> None:
        if self.flight is not None:
            self._put(END, b"")
            self._closing[self.flight] = self.steps_kept, self.steps_seen
            self.flight, self._stride = None, 1

    def _put(self, kind: bytes, data: bytes) -> bool:
        if self._process is None or len(self._backlog) + len(data) > BACKLOG_MAX:
            return False
        self._backlog += HEAD.pack(kind, len(data))
        self._backlog += data
        return True

    def pump(self) -> None:
        """Hand over what the pipe has room for, without waiting."""
        try:
            while self._backlog:
                del self._backlog[: os.write(self._pipe, self._backlog)]
        except BlockingIOError:
            pass
        except OSError as error:
            self._fail(error.strerror or str(error))
        if self._closing:
            self._hear()

    def _hear(self) -> None:
        """Which flights are on disk."""
        with contextlib.suppress(BlockingIOError):
            for name in os.read(self._done, 4096).decode().split():
                kept, seen = self._closing.pop(name)
                log.info("recorded %s: %d of %d control steps", name, kept, seen)

    def _fail(self, why: str) -> None:
        if self._process is not None:
            log.error("recording stopped: %s: %s", self.folder, why)
            process, self._process = self._process, None
            self._backlog.clear()
            self.flight = None
            self._closing.clear()
            process.kill()
            process.wait()

    def close(self) -> None:
        """End the flight under way and wait until all is on disk."""
        self.end()
        if self._process is None:
            return
        os.set_blocking(self._pipe, True)
        self.pump()
        if self._process is None:
            return
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(_CLOSE_S)
            self._hear()
            self._process = None
        except subprocess.TimeoutExpired:
            self._fail("its process doesn't end")
