"""Lateness: how late the loop's turns begin at 1 × real time, beside a bare loop that only sleeps to its deadlines.

Both run in this process, in turns of a few seconds, on the same grid of absolute deadlines, so that what the machine
does meets both. A ground station in a process of its own is served throughout. Then the same with Zenoh subscribers
that never take a message, at the highest telemetry rate so that every queue on the way is full in seconds: one whose
queue is full, one whose whole process is stopped.
"""

import contextlib
import logging
import signal
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.figure import Figure, quantile, told
from benchmarks.processes import BenchmarkError, free_instance, ground, listener, running, start
from sitl.daemon import assembly, recorder
from sitl.daemon.clock import TURN_S, Lateness
from sitl.daemon.config import RunConfig, Setup
from sitl.daemon.loop import Loop
from sitl.daemon.main import wall_clock
from sitl.daemon.udp import Sockets

SEGMENT_S = 4.0
SEGMENTS = 3
SETTLE_S = 0.5
LEFT_OUT_S = 0.25  # of each segment: it begins with a catch-up
FULL_RATE_HZ = 500.0


class Recorded(Lateness):
    """Lateness that keeps every turn's."""

    def __init__(self, turn_s: float = TURN_S) -> None:
        super().__init__(turn_s)
        self.late_s: list[float] = []
        self.since_s = 0.0

    def record(self, planned_s: float, wall_s: float) -> None:
        super().record(planned_s, wall_s)
        if planned_s >= self.since_s:
            self.late_s.append(wall_s - planned_s)


def measure(quick: bool) -> Iterator[Figure]:
    logging.getLogger("sitl").setLevel(logging.WARNING)
    config = RunConfig(instance=free_instance(), settings=(("SIM_TLM_RATE", FULL_RATE_HZ),))
    with assembled(config) as loop:
        watch = ("watch", "--connect", ground(config.instance), "--system", str(config.system_id))
        with running(start("gcs_tools", *watch)):
            yield from beside(loop, "with a ground station", subscribed=False)
            endpoint = assembly.zenoh_endpoint(config)
            with listener(endpoint, "read"):
                yield from beside(loop, "and a subscriber that reads")
            with listener(endpoint, "never"):
                yield from beside(loop, "and a subscriber that never reads")
            with listener(endpoint, "read") as process:
                turn(loop, Recorded(), SETTLE_S)  # its subscription is in force before it stops
                process.send_signal(signal.SIGSTOP)
                yield from beside(loop, "and a subscriber that is stopped")
        figures = loop.figures()
    with assembled(config._replace(record=True)) as loop:
        watch = ("watch", "--connect", ground(config.instance), "--system", str(config.system_id))
        with running(start("gcs_tools", *watch)):
            yield from beside(loop, "with a ground station, recording the flight", subscribed=False)
    yield told(
        "  telemetry in all of it",
        f"{figures.telemetry_messages} messages, longest turn {figures.telemetry_worst_ms:.2f} ms, "
        f"{figures.faults} faults",
    )


@contextlib.contextmanager
def assembled(config: RunConfig) -> Iterator[Loop]:
    """What `sitl run` puts together, in this process."""
    clock = wall_clock()
    with contextlib.ExitStack() as stack:
        state = stack.enter_context(tempfile.TemporaryDirectory(prefix="yawsitter-benchmark-"))
        config = config._replace(state_dir=Path(state))
        setup = Setup((config,))
        sockets = Sockets(setup.sockets, config.instance)
        stack.callback(sockets.close)
        built = assembly.build(setup)
        stack.callback(built.close)
        [vehicle] = built.vehicles
        recorders = recorder.start(setup.vehicles)
        stack.callback(recorder.close, recorders)
        loop = assembly.build_loop(setup, built.vehicles, sockets, built.publishers, recorders, clock)
        vehicle.advance(100_000)
        vehicle.commander.takeoff()
        vehicle.commander.arm()
        assembly.settle_garbage()
        yield loop


def beside(loop: Loop, what: str, subscribed: bool = True) -> Iterator[Figure]:
    """The loop and the bare one in turns; medians and 99th percentiles, and their ratio."""
    ours, alone = Recorded(), []
    loop.lateness = ours
    sent = loop.figures().telemetry_messages
    for _ in range(SEGMENTS):
        turn(loop, ours, SEGMENT_S)
        alone += bare(SEGMENT_S)
    sent = loop.figures().telemetry_messages - sent
    if subscribed and not sent:
        raise BenchmarkError(f"nothing was sent {what}")
    p50, p99, bare_p50, bare_p99 = (quantile(v, q) * 1e3 for v in (ours.late_s, alone) for q in (0.5, 0.99))
    yield told(
        f"lateness p50 / p99, {what}",
        f"{p50:.2f} / {p99:.2f} ms; bare {bare_p50:.2f} / {bare_p99:.2f} ms; ratio {p50 / bare_p50:.1f} / "
        f"{p99 / bare_p99:.1f}; {ours.overruns} of {ours.turns} over {TURN_S * 1e3:g} ms; "
        f"{sent / (SEGMENTS * SEGMENT_S):.0f} messages/s",
    )


def turn(loop: Loop, record: Recorded, seconds: float) -> None:
    clock = wall_clock()
    begun_s = clock()
    record.since_s = begun_s + LEFT_OUT_S
    loop.run(lambda: clock() >= begun_s + seconds)


def bare(seconds: float, turn_s: float = TURN_S) -> list[float]:
    """How late a loop is that does nothing but sleep until the next multiple of the turn."""
    late = []
    begun_s = time.monotonic()
    for k in range(1, int(seconds / turn_s)):
        due_s = begun_s + k * turn_s
        left_s = due_s - time.monotonic()
        if left_s > 0.0:
            time.sleep(left_s)
        late.append(time.monotonic() - due_s)
    return late
