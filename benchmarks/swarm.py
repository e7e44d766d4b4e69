"""A swarm at 1 × real time, hovering: processor time for each vehicle, and the loop's deadlines, with 10, 25 and 50.

What `sitl swarm` puts together, in this process, with a ground station in a process of its own that reads everything at
the shared port, at 10 Hz. Windows of the three swarms take turns. Then 50 with a Zenoh subscriber to all keys besides.
"""

import contextlib
import json
import logging
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.figure import Figure, at_most, quantile, told
from benchmarks.lateness import Recorded, bare
from benchmarks.processes import BenchmarkError, listener, running, start
from gcs_tools.link import free_ports
from sitl.daemon import assembly, swarm
from sitl.daemon.clock import SWARM_TURN_S
from sitl.daemon.config import RunConfig
from sitl.daemon.loop import Loop
from sitl.daemon.main import wall_clock
from sitl.daemon.udp import Sockets

SIZES = (10, 25, 50)
RATE_HZ = 10.0
WINDOW_S, WINDOWS = 5.0, 3
CLIMB_S = 6.0
_FIRSTS = (165, 70)  # instances: 85 from each are taken
_RATE = "ATTITUDE"  # the stream that is counted


class Turns(Recorded):
    """How late each began, and the processor time that it took."""

    def __init__(self, turn_s: float) -> None:
        super().__init__(turn_s)
        self.work_s: list[float] = []


def measure(quick: bool) -> Iterator[Figure]:
    logging.getLogger("sitl").setLevel(logging.WARNING)
    sizes = SIZES[::2] if quick else SIZES
    spent: dict[int, list[float]] = {size: [] for size in sizes}
    turns: dict[int, Turns] = {}
    told_Hz: dict[int, float] = {}
    beside: list[float] = []  # how late a loop was that only sleeps
    with contextlib.ExitStack() as stack:
        loops = {}
        first = _free_first(sum(sizes))
        for size in sizes:
            loops[size] = stack.enter_context(_hovering(size, first))
            first += size
            turns[size] = _timed(loops[size])
        for _ in range(WINDOWS):
            for size, loop in loops.items():
                spent_s, told_Hz[size] = _window(loop)
                spent[size].append(spent_s * 1e3 / size / WINDOW_S)
                beside += bare(WINDOW_S, SWARM_TURN_S)
        largest = loops[sizes[-1]]
        endpoint = f"tcp/127.0.0.1:{7447 + largest.members[0].endpoint.system_id - 1}"
        largest.lateness = Recorded(SWARM_TURN_S)  # not to be told
        with listener(endpoint, "read"):
            _turn(largest, 1.0)
            subscribed_s, _ = _window(largest)
        messages = sum(member.publisher.messages for member in largest.members if member.publisher)
    for size in sizes:
        yield told(f"a vehicle for a second, {size} of them", f"{min(spent[size]):.2f} ms of one core")
    growth = min(spent[sizes[-1]]) / min(spent[sizes[0]])
    yield at_most(f"cost of one among {sizes[-1]} to one among {sizes[0]}", [growth], 1.2, "×")
    whole = [value * 1e-3 * sizes[-1] for value in spent[sizes[-1]]]
    yield at_most(f"{sizes[-1]} vehicles at 1 ×, {RATE_HZ:g} Hz of telemetry each", whole, 1.0, "of a core")
    yield told(f"  {_RATE} heard of each at the shared port", f"{told_Hz[sizes[-1]]:.1f} Hz")
    yield told(
        "  with a Zenoh subscriber to all", f"{subscribed_s / WINDOW_S:.2f} of a core, {messages} messages so far"
    )
    bare_p50, bare_p99 = (quantile(beside, q) * 1e3 for q in (0.5, 0.99))
    for size in sizes:
        p50, p99 = (quantile(turns[size].late_s, q) * 1e3 for q in (0.5, 0.99))
        ratio = f"ratio {p50 / bare_p50:.1f} / {p99 / bare_p99:.1f}"
        measured = f"{p50:.2f} / {p99:.2f} ms; bare {bare_p50:.2f} / {bare_p99:.2f} ms; {ratio}"
        yield told(f"lateness p50 / p99, {size} vehicles", measured)
        p50, p99, longest = (quantile(turns[size].work_s, q) * 1e3 for q in (0.5, 0.99, 1.0))
        yield told("  a turn's processor time p50 / p99 / longest", f"{p50:.1f} / {p99:.1f} / {longest:.1f} ms")


def _free_first(count: int) -> int:
    """An instance from which on so many have free ports. Raises BenchmarkError."""
    for first in _FIRSTS:
        udp = [base + first + k for base in (18570, 14580, 18300) for k in range(count)]
        if first + count <= 250 and free_ports(udp=udp, tcp=[7447 + first + k for k in range(count)]):
            return first
    raise BenchmarkError("no row of free ports is long enough")


@contextlib.contextmanager
def _hovering(count: int, first: int) -> Iterator[Loop[Any]]:
    """A swarm in the air at 3 m."""
    clock = wall_clock()
    with contextlib.ExitStack() as stack:
        state = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="yawsitter-benchmark-")))
        setup = swarm.setup(RunConfig(instance=first, state_dir=state), swarm.grid(count, 3.0), RATE_HZ)
        sockets = Sockets(setup.sockets, first)
        stack.callback(sockets.close)
        built = assembly.build(setup)
        stack.callback(built.close)
        loop = assembly.build_loop(setup, built.vehicles, sockets, built.publishers, (), clock)
        for vehicle in built.vehicles:
            vehicle.advance(100_000)
            vehicle.commander.takeoff()
            vehicle.commander.arm()
        loop.now_us = 100_000
        _turn(loop, CLIMB_S)
        if not all(vehicle.snapshot().nav.down_m < -1.0 for vehicle in built.vehicles):
            raise BenchmarkError("they are not in the air")
        assembly.settle_garbage()
        yield loop


def _timed(loop: Loop[Any]) -> Turns:
    """What the loop's turns are like from here on."""
    turns = loop.lateness = Turns(loop.lateness.turn_s)
    turn = loop.turn

    def timed(wall_s: float) -> float:
        start_s = time.thread_time()
        wake_s = turn(wall_s)
        if wall_s >= turns.since_s:
            turns.work_s.append(time.thread_time() - start_s)
        return wake_s

    loop.turn = timed
    return turns


def _turn(loop: Loop[Any], seconds: float) -> None:
    clock = wall_clock()
    end_s = clock() + seconds
    loop.run(lambda: clock() >= end_s)


def _window(loop: Loop[Any]) -> tuple[float, float]:
    """Processor seconds of this process, and how often a second the ground station heard of each vehicle."""
    _, port = next(iter(address for (_, port), address in loop._sockets.addresses.items() if port.value == "shared"))
    listening = start("benchmarks.swarm_listener", str(port), _RATE, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    with running(listening) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdout.readline()
        _turn(loop, 0.5)
        loop.lateness.since_s = wall_clock()()
        start_s = time.process_time()
        _turn(loop, WINDOW_S)
        spent_s = time.process_time() - start_s
        loop.lateness.since_s = float("inf")
        out, _ = process.communicate("end\n", timeout=10.0)
        heard = json.loads(out)
    if len(heard["counts"]) != len(loop.members):
        raise BenchmarkError(f"{len(heard['counts'])} of {len(loop.members)} vehicles heard")
    return spent_s, statistics.median(heard["counts"]) / heard["seconds"]
