"""Tracking: the paper's two flights by both vehicles, in lockstep and over UDP in real time, against the paper's MAE.

The flights over UDP take 70 s and 55 s each; the two vehicles fly at the same time, so all four take two and a half
minutes. `--quick` leaves them out.
"""

import contextlib
import json
import subprocess
from collections.abc import Iterator

from benchmarks.figure import Figure, each_at_most
from benchmarks.processes import BenchmarkError, daemon, free_instances, onboard, running, start, stop
from gcs_tools.table import PAPER

VEHICLES = ("yawsitter", "yawsitter-real")
FLIGHTS = ("rectangle", "circle")
_PATIENCE_S = 60.0  # beyond the flight itself
_PIPES = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}


def measure(quick: bool) -> Iterator[Figure]:
    for flight in FLIGHTS:
        for vehicle in VEHICLES:
            process = start("sitl", "fly", _mission(flight), "--vehicle", vehicle, "--json", **_PIPES)
            yield _figure(flight, vehicle, "lockstep", process)
    if quick:
        return
    for flight in FLIGHTS:
        yield from _real_time(flight)


def _real_time(flight: str) -> Iterator[Figure]:
    """Both vehicles at once, each with a daemon and a client of its own."""
    with contextlib.ExitStack() as stack:
        clients = []
        for vehicle, instance in zip(VEHICLES, free_instances(len(VEHICLES)), strict=True):
            stack.enter_context(daemon(instance, "--vehicle", vehicle))
            clients.append(stack.enter_context(running(_client(flight, instance))))
        for vehicle, client in zip(VEHICLES, clients, strict=True):
            yield _figure(flight, vehicle, "UDP, 1 ×", client)


def _client(flight: str, instance: int) -> subprocess.Popen[str]:
    connection = ("--connect", onboard(instance), "--system", str(instance + 1))
    return start("gcs_tools", "fly", _mission(flight), *connection, "--json", **_PIPES)


def _mission(flight: str) -> str:
    return f"missions/{flight}.yaml"


def _figure(flight: str, vehicle: str, how: str, process: subprocess.Popen[str]) -> Figure:
    try:
        output, errors = process.communicate(timeout=70.0 + _PATIENCE_S)
    except subprocess.TimeoutExpired:
        stop(process)
        raise BenchmarkError(f"{flight}, {vehicle}: not flown in time") from None
    if process.returncode:
        reason = (errors.strip().splitlines() or [f"status {process.returncode}"])[-1]
        raise BenchmarkError(f"{flight}, {vehicle}, {how}: {reason}")
    result = json.loads(output)
    if result["vehicle"] not in (vehicle, None):
        raise BenchmarkError(f"{flight}: it was {result['vehicle']} that flew, not {vehicle}")
    return each_at_most(f"MAE {flight}, {vehicle}, {how}", result["mae"], PAPER[flight]["mae"], "m")
