"""Other simulators that pip installs, in turn with this one: simulated seconds per second of one core.

Each flies closed loop as its own package offers it (benchmarks/peer_flights), in a process, an environment and a
temporary folder of its own and without drawing; importing, building and a first short flight are not timed. Those are
flown that benchmarks.peer_environments has installed.
What each simulates, and what it doesn't, stands in docs/performance.md.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.figure import Figure, at_least, spread, told
from benchmarks.peer_environments import hint, python_of
from benchmarks.processes import ROOT, BenchmarkError, running

RUNS = 3
LIMIT_S = 120.0
_FLIGHTS = Path(__file__).parent / "peer_flights"
_UNIT = "× real time"


class Flight(NamedTuple):
    what: str
    environment: str  # empty: this one
    script: str
    arguments: tuple[str, ...] = ()
    at_once: int = 1  # processes


def _own(name: str, rate_Hz: int, at_once: int = 1) -> Flight:
    many = f", {at_once} processes at once" if at_once > 1 else ""
    return Flight(f"{name} at {rate_Hz} Hz{many}", "", "ours.py", (name, str(rate_Hz)), at_once)


IDEAL, REAL = _own("yawsitter", 500), _own("yawsitter-real", 500)
IDEAL_250, REAL_250 = _own("yawsitter", 250), _own("yawsitter-real", 250)
IDEAL_100, REAL_100 = _own("yawsitter", 100), _own("yawsitter-real", 100)
IDEAL_2, REAL_2 = _own("yawsitter", 500, 2), _own("yawsitter-real", 500, 2)
ROTORPY = Flight("RotorPy, one vehicle", "rotorpy", "rotorpy_one.py")
ROTORPY_100, ROTORPY_1000 = (
    Flight(f"RotorPy, a batch of {count}, vehicle-seconds", "rotorpy-batch", "rotorpy_batch.py", (str(count),))
    for count in (100, 1000)
)
CESSNA, CESSNA_500, F450, BALL = (
    Flight(f"JSBSim, {aircraft} at {rate} Hz", "jsbsim", "jsbsim_one.py", (aircraft, rate))
    for aircraft, rate in (("c172x", "120"), ("c172x", "500"), ("F450", "500"), ("ball", "500"))
)
CESSNA_2 = CESSNA._replace(what=f"{CESSNA.what}, 2 processes at once", at_once=2)
PYFLYT = Flight("PyFlyt, one quadrotor", "pyflyt", "pyflyt_quad.py")
UDAAN = Flight("Udaan, one quadrotor", "udaan", "udaan_quad.py")
CRAZYFLOW, CRAZYFLOW_100, CRAZYFLOW_1000 = (
    Flight(f"Crazyflow, {count} at once, vehicle-seconds", "crazyflow", "crazyflow_batch.py", (str(count),))
    for count in (1, 100, 1000)
)
FLIGHTS = (
    IDEAL, REAL, IDEAL_250, REAL_250, IDEAL_100, REAL_100, CESSNA, CESSNA_500, F450, BALL, ROTORPY, ROTORPY_100,
    ROTORPY_1000, PYFLYT, UDAAN, CRAZYFLOW, CRAZYFLOW_100, CRAZYFLOW_1000, IDEAL_2, REAL_2, CESSNA_2,
)  # fmt: skip


class Comparison(NamedTuple):
    what: str
    own: tuple[Flight, ...]
    peer: Flight
    least: float | None  # None: nothing is required
    factor: float = 1.0  # from simulated seconds to what is compared


COMPARISONS = (
    Comparison("each as it comes", (IDEAL, REAL), ROTORPY, 20.0),
    Comparison("one after the other against its batch of 1000", (IDEAL, REAL), ROTORPY_1000, None),
    Comparison("each as it comes, 500 Hz against 120 Hz", (IDEAL, REAL), CESSNA, 5.0),
    Comparison("the same step of 2 ms, its Cessna", (IDEAL, REAL), CESSNA_500, 5.0),
    Comparison("the same step of 2 ms, its quadrotor", (IDEAL, REAL), F450, 5.0),
    Comparison("evaluations of the forces", (IDEAL, REAL), CESSNA, None, 4.0 * 500.0 / 120.0),
    Comparison("at 250 Hz against 120 Hz", (IDEAL_250, REAL_250), CESSNA, 5.0),
    Comparison("at 100 Hz against 120 Hz", (IDEAL_100, REAL_100), CESSNA, 5.0),
    Comparison("two processes against two, 500 Hz against 120 Hz", (IDEAL_2, REAL_2), CESSNA_2, 5.0),
    Comparison("each as it comes", (IDEAL, REAL), PYFLYT, None),
    Comparison("each as it comes", (IDEAL, REAL), UDAAN, None),
    Comparison("one at a time against one", (IDEAL, REAL), CRAZYFLOW, None),
    Comparison("one after the other against its batch of 1000", (IDEAL, REAL), CRAZYFLOW_1000, None),
)


def measure(quick: bool) -> Iterator[Figure]:
    there = [flight for flight in FLIGHTS if _python(flight) is not None]
    rates: dict[Flight, list[float]] = {flight: [] for flight in there}
    for _ in range(1 if quick else RUNS):
        for flight in there:
            rates[flight].append(_rate(flight))
    for flight in FLIGHTS:
        yield told(flight.what, spread(rates[flight], _UNIT) if flight in rates else hint(flight.environment))
    for comparison in COMPARISONS:
        for own in comparison.own:
            if comparison.peer in rates:
                yield _compared(comparison, own, rates)


def _compared(comparison: Comparison, own: Flight, rates: dict[Flight, list[float]]) -> Figure:
    """Turn by turn, so that a slow moment of the machine meets both."""
    pairs = zip(rates[own], rates[comparison.peer], strict=True)
    ratios = [comparison.factor * mine / theirs for mine, theirs in pairs]
    what = f"{own.arguments[0]} against {comparison.peer.what.partition(',')[0]}: {comparison.what}"
    least = comparison.least
    return told(what, spread(ratios, "×")) if least is None else at_least(what, ratios, least, "×")


def _python(flight: Flight) -> Path | None:
    return python_of(flight.environment) if flight.environment else Path(sys.executable)


def _rate(flight: Flight) -> float:
    """Vehicle-seconds per second of processor time on one core; of several processes, per second of wall time.

    Raises BenchmarkError, TimeoutExpired.
    """
    with tempfile.TemporaryDirectory(prefix="yawsitter-peers-") as folder:
        processes = [_start(flight, folder) for _ in range(flight.at_once)]
        try:
            for process in processes:
                _ready(flight, process)
            told = [process.communicate("go\n", timeout=LIMIT_S)[1] for process in processes]
        finally:
            for process in processes:
                with running(process):
                    pass
    rates = [line.split()[1:] for text in told for line in text.splitlines() if line.startswith("RATES")]
    if len(rates) != flight.at_once:
        raise BenchmarkError(f"{flight.what}: {told[0].strip().splitlines()[-1]}")
    return sum(float(wall) for _, wall in rates) if flight.at_once > 1 else float(rates[0][0])


def _start(flight: Flight, folder: str) -> "subprocess.Popen[str]":
    environment = {**os.environ, "PYTHONPATH": "" if flight.environment else str(ROOT)}
    process = subprocess.Popen(
        [str(_python(flight)), str(_FLIGHTS / flight.script), *flight.arguments],
        cwd=folder, env=environment, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip
    if flight.at_once == 1 and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(process.pid, {max(os.sched_getaffinity(0))})
    return process


def _ready(flight: Flight, process: "subprocess.Popen[str]") -> None:
    """Wait until it has warmed up. Raises BenchmarkError."""
    assert process.stderr is not None
    last = ""
    for line in process.stderr:
        if line.startswith("READY"):
            return
        last = line.strip() or last
    raise BenchmarkError(f"{flight.what}: {last}")
