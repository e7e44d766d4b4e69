"""The process that writes flights: what comes through its standard input becomes a .tlog and an .mcap for each.

The .tlog has every MAVLink frame behind its wall time (8 bytes, µs since 1970, big-endian), for every ground station
and mavlogdump. The .mcap has the telemetry's messages under their Zenoh keys with their JSON schemas, at the rate of
the control steps; its log time is the wall time at arming plus the simulation time since.

When the vehicle's process dies, whichever way, its pipe closes, and the files are closed properly. When this one dies,
they are sound up to the last flush.
"""

import contextlib
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import msgspec
import numpy as np
from mcap.writer import Writer

from sitl.closed_loop import TRACE_COLUMNS, Traced, traced
from sitl.control.cascade import Command
from sitl.control.reference import Reference
from sitl.daemon.flight_pipe import BEGIN, END, FRAME, HEAD, STEPS, TOPIC
from sitl.daemon.recorder import MESSAGE, Flight
from sitl.geodesy import GeoPoint
from sitl.model.derivative import by_cause
from sitl.model.rigid_body import State
from sitl.navigation import NavState
from sitl.telemetry import keys, messages, schema
from sitl.telemetry.keys import Topic

FLIGHTS_MAX = 50  # kept in the folder, the oldest go first
FOLDER_BYTES = 1 << 30
FLIGHT_BYTES = 1 << 28  # of one .mcap; a longer flight's control steps are not kept beyond
FLUSH_S = 0.5
CHUNK_BYTES = 1 << 18  # of an .mcap, compressed at once: 0.3 s of control steps
NICE = 10  # the loop goes first

_NAME = re.compile(r"(\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d-\d{3}Z_instance-\d+)\.(tlog|mcap)")
_SCHEMAS: dict[Topic, Any] = {
    keys.STATE: schema.StateMessage,
    keys.ATTITUDE: schema.AttitudeMessage,
    keys.SETPOINT: schema.SetpointMessage,
    keys.ACTUATORS: schema.ActuatorsMessage,
    keys.LOADS: schema.LoadsMessage,
    keys.MODE: schema.ModeMessage,
    keys.EVENT: schema.EventMessage,
    keys.PARAMETERS: schema.ParametersMessage,
    keys.MISSION: schema.MissionMessage,
    keys.DESCRIPTION: dict[str, Any],
}


class Step(NamedTuple):
    """A traced control step as the telemetry's messages take it."""

    now_us: int
    origin: GeoPoint
    truth: State
    nav: NavState
    acceleration_B: tuple[float, float, float]
    acceleration_N: tuple[float, float, float]
    wind_N: tuple[float, float, float]
    reference: Reference
    command: Command
    feet_down: int

    @classmethod
    def of(cls, x: Traced, origin: GeoPoint) -> "Step":
        return cls(
            round(x.t_s * 1e6), origin, x.state, x.nav, x.specific_force_B, x.acceleration_N, x.wind_N, x.reference,
            x.command, x.acting.feet_down,
        )  # fmt: skip


_STEP_TOPICS: dict[Topic, Callable[[Step], Any]] = {
    keys.STATE: messages.state,
    keys.ATTITUDE: messages.attitude,
    keys.SETPOINT: messages.setpoint,
    keys.ACTUATORS: messages.actuators,
}


def json_schema(message: Any) -> dict[str, Any]:
    """A message's JSON schema, in the plain form that viewers know: an object, tuples of one kind as arrays."""
    whole = _plain(msgspec.json.schema(message))
    definitions = whole.pop("$defs", {})
    top = definitions.pop(whole["$ref"].rpartition("/")[2]) if "$ref" in whole else whole
    return {**top, "$defs": definitions} if definitions else dict(top)


def _plain(part: Any) -> Any:
    if isinstance(part, list):
        return [_plain(p) for p in part]
    if not isinstance(part, dict):
        return part
    part = {name: _plain(p) for name, p in part.items()}
    members = part.get("prefixItems")
    if members and all(m == members[0] for m in members):
        part["items"] = part.pop("prefixItems")[0]
    return part


class FlightFiles:
    """The two files of one flight."""

    def __init__(self, flight: Flight) -> None:
        folder = Path(flight.folder)
        self._flight = flight
        self._origin = GeoPoint(*flight.origin)
        self._tlog = (folder / f"{flight.name}.tlog").open("xb")
        self._file = (folder / f"{flight.name}.mcap").open("xb")
        self._mcap = Writer(self._file, chunk_size=CHUNK_BYTES)
        self._mcap.start(profile="", library="yawsitter-sitl")
        self._channels = {topic: self._channel(topic, message) for topic, message in _SCHEMAS.items()}
        self._full = False
        self._flush_s = 0.0

    def _channel(self, topic: Topic, message: Any) -> int:
        known = self._mcap.register_schema(topic.name, "jsonschema", msgspec.json.encode(json_schema(message)))
        return int(self._mcap.register_channel(keys.key(self._flight.instance, topic), "json", known))

    def frame(self, data: bytes) -> None:
        self._tlog.write(data)

    def message(self, topic: Topic, now_us: int, data: bytes) -> None:
        f = self._flight
        log_ns = round(f.unix_s * 1e9) + (now_us - f.now_us) * 1000
        self._mcap.add_message(self._channels[topic], max(0, log_ns), data, max(0, log_ns))

    def steps(self, data: bytes) -> None:
        if self._full:
            return
        for row in np.frombuffer(data).reshape(-1, len(TRACE_COLUMNS)).tolist():
            x = traced(row)
            step = Step.of(x, self._origin)
            for topic, make in _STEP_TOPICS.items():
                self.message(topic, step.now_us, messages.encode(make(step)))
            loads = messages.loads(step.now_us, by_cause(x.acting))
            self.message(keys.LOADS, step.now_us, messages.encode(loads))
        self._full = self._file.tell() > FLIGHT_BYTES

    def flush(self) -> None:
        now_s = time.monotonic()
        if now_s >= self._flush_s:
            self._flush_s = now_s + FLUSH_S
            self._tlog.flush()
            self._file.flush()

    def close(self) -> str:
        """The flight's name, once all is on disk."""
        self._mcap.finish()  # type: ignore[no-untyped-call]
        self._file.close()
        self._tlog.close()
        return self._flight.name


def make_room(folder: Path) -> None:
    """Remove the oldest flights until another may be written. Other files in the folder are let be."""
    flights: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        named = _NAME.fullmatch(path.name)
        if named:
            flights.setdefault(named[1], []).append(path)
    sizes = {name: sum(path.stat().st_size for path in paths) for name, paths in flights.items()}
    for name, paths in flights.items():  # by their names, that is by time
        if len(sizes) < FLIGHTS_MAX and sum(sizes.values()) <= FOLDER_BYTES - FLIGHT_BYTES:
            return
        del sizes[name]
        for path in paths:
            path.unlink(missing_ok=True)


def incoming(source: BinaryIO) -> Iterator[tuple[bytes, int, bytes]]:
    """What comes in, whole: kind, whose and what."""
    while len(head := source.read(HEAD.size)) == HEAD.size:
        kind, instance, size = HEAD.unpack(head)
        data = source.read(size)
        if len(data) < size:
            return
        yield kind, instance, data


def write(source: BinaryIO, done: Callable[[str], None]) -> None:
    """Flights from `source` until it ends, one of each vehicle at a time; `done` is told which are on disk."""
    under_way: dict[int, FlightFiles] = {}
    try:
        for kind, instance, data in incoming(source):
            if kind == BEGIN:
                flight = Flight(**msgspec.json.decode(data))
                make_room(Path(flight.folder))
                under_way[instance] = FlightFiles(flight)
            files = under_way.get(instance)
            if files is None:
                continue
            if kind == FRAME:
                files.frame(data)
            elif kind == STEPS:
                files.steps(data)
            elif kind == TOPIC:
                number, now_us = MESSAGE.unpack_from(data)
                files.message(keys.TOPICS[number], now_us, data[MESSAGE.size :])
            elif kind == END:
                del under_way[instance]
                done(files.close())
                continue
            files.flush()
    finally:
        for files in under_way.values():
            done(files.close())


def tell(name: str) -> None:
    with contextlib.suppress(OSError):  # whoever wanted to know may be gone
        os.write(sys.stdout.fileno(), f"{name}\n".encode())


def main() -> int:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # the end comes through the pipe, after all that is still in it
    with contextlib.suppress(AttributeError):
        os.nice(NICE)
    try:
        write(sys.stdin.buffer, tell)
    except OSError as error:
        print(f"recording stopped: {error.filename}: {error.strerror}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
