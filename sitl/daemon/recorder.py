"""Flights on their way to disk: one vehicle's, through a pipe to a process that writes them.

Where the other side can't keep up (at many times real time, or with many vehicles) control steps are left out: every
second is kept, every fourth, eighth … Light to import.
"""

import json
import os
import struct
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from sitl.daemon.config import RunConfig, SettingError
from sitl.daemon.flight_pipe import BEGIN, END, FRAME, STEPS, TOPIC, FlightPipe
from sitl.mavlink.tlog import stamped

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MESSAGE = struct.Struct("<BQ")  # number of the topic, simulation time [µs]

BEFORE_BYTES = 1 << 20  # of frames from before the flight, some ten seconds: they show what led to the arming
THIN_BYTES = (
    1 << 22
)  # with so many waiting for the pipe every second control step is left out; twice as many: half the rest
STRIDE_MAX = 1024


class Flight(NamedTuple):
    """What the writing side is told of a flight when it begins."""

    name: str
    instance: int
    unix_s: float
    now_us: int
    origin: tuple[float, float, float]  # latitude, longitude [deg], altitude AMSL [m]
    folder: str

    def pack(self) -> bytes:
        return json.dumps(self._asdict()).encode()


class Recorder:
    """One flight after the other into `folder`. Raises SettingError where that can't be."""

    def __init__(self, pipe: FlightPipe, folder: Path, instance: int) -> None:
        self.pipe, self.folder, self.instance = pipe, folder, instance
        self.steps_seen = self.steps_kept = 0
        self._flight: str | None = None
        self._before: deque[bytes] = deque()
        self._before_bytes = 0
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SettingError(f"--record {folder}: {error.strerror}") from None
        if not os.access(folder, os.W_OK | os.X_OK):
            raise SettingError(f"--record {folder}: not writable")

    @property
    def flight(self) -> str | None:
        """Name of the one under way."""
        return self._flight if self.pipe.works else None

    def writes(self, name: str) -> bool:
        """Whether a file of this name is still being written."""
        return any(name.startswith(flight) for flight in (*self.pipe.closing, self.flight or "/"))

    def begin(self, unix_s: float, now_us: int, origin: tuple[float, float, float]) -> None:
        stamp = time.strftime("%Y-%m-%d_%H-%M-%S", time.gmtime(unix_s)) + f"-{int(unix_s * 1e3) % 1000:03}"
        self._flight = f"{stamp}Z_instance-{self.instance}"
        self.steps_seen = self.steps_kept = 0
        flight = Flight(self._flight, self.instance, unix_s, now_us, origin, str(self.folder.resolve()))
        self._put(BEGIN, flight.pack())
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
        stride = min(STRIDE_MAX, 1 << len(self.pipe.backlog) // THIN_BYTES)
        kept = trace[-self.steps_seen % stride :: stride]
        self.steps_seen += len(trace)
        if len(kept) and self._put(STEPS, kept.tobytes()):
            self.steps_kept += len(kept)

    def end(self) -> None:
        if self.flight is not None:
            self._put(END, b"")
            self.pipe.closing[self.flight] = self.steps_kept, self.steps_seen
            self._flight = None

    def _put(self, kind: bytes, data: bytes) -> bool:
        return self.pipe.put(kind, self.instance, data)

    def pump(self) -> None:
        """Hand over what can be, without waiting."""
        self.pipe.pump()


def start(vehicles: Sequence[RunConfig]) -> list[Recorder]:
    """One for each that is to be recorded, all by one process. Raises SettingError."""
    recorded = [vehicle for vehicle in vehicles if vehicle.record]
    if not recorded:
        return []
    pipe = FlightPipe()
    try:
        return [Recorder(pipe, vehicle.log_dir, vehicle.instance) for vehicle in recorded]
    except SettingError:
        pipe.close()
        raise


def close(recorders: Sequence[Recorder]) -> None:
    """End the flights under way and wait until all is on disk."""
    for recorder in recorders:
        recorder.end()
    for recorder in recorders[:1]:
        recorder.pipe.close()
