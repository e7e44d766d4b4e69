"""Thirty simulated hours of missions, flown one after the other by one vehicle: nothing may grow or be missed.

Each flight is uploaded, flown and landed for the same client, through MAVLink bytes in lockstep, with a fresh battery.
Told is what the process holds in memory, averaged over the first hour and over the last.
"""

import gc
import math
import os
import re
import statistics
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.figure import Figure, at_most, told
from benchmarks.processes import ROOT, BenchmarkError
from gcs_tools import lockstep
from gcs_tools import plan as plans
from gcs_tools.client import Client
from gcs_tools.flight import Flight
from gcs_tools.plan import Uploaded
from sitl.mavlink.endpoint import Endpoint, PortKind
from sitl.vehicle import Vehicle, load_vehicle

HOURS = 30.0
GROWTH_MAX_PERCENT = 2.0
_HOUR_S = 3600.0


class Sample(NamedTuple):
    """After one flight."""

    at_s: float  # of simulation
    memory_MiB: float
    missed: int  # items that were not reported reached, or not in order
    drift_m: float  # from the place that it took off from


def measure(quick: bool) -> Iterator[Figure]:
    hours = 3.0 if quick else HOURS
    samples = list(soak(hours))
    first = [sample.memory_MiB for sample in samples if sample.at_s <= _HOUR_S]
    last = [sample.memory_MiB for sample in samples if sample.at_s > samples[-1].at_s - _HOUR_S]
    growth = 100.0 * (statistics.mean(last) / statistics.mean(first) - 1.0)
    yield told(f"{samples[-1].at_s / _HOUR_S:.1f} simulated hours of missions", f"{len(samples)} flights")
    yield at_most("  items missed", [sum(sample.missed for sample in samples)], 0, "")
    yield at_most("  memory, last hour against the first", [growth], GROWTH_MAX_PERCENT, "%")
    yield told("  memory", f"{statistics.mean(first):.1f} MiB, then {statistics.mean(last):.1f} MiB")
    yield told("  farthest landing from its mark", f"{max(sample.drift_m for sample in samples):.3f} m")


def soak(hours: float, vehicle: str = "yawsitter-real") -> Iterator[Sample]:
    """Flights until so much time has passed on board. Raises BenchmarkError for one that goes wrong."""
    craft = Vehicle(load_vehicle(vehicle))
    endpoint, client = Endpoint(craft), Client()
    plan = plans.load(ROOT / "missions" / "rectangle-mission.yaml")
    assert isinstance(plan, Uploaded)
    while craft.now_us < hours * _HOUR_S * 1e6:
        reached = _fly(plan, craft, endpoint, client)
        missed = sum(a != b for a, b in zip(reached, range(len(plan.items)), strict=False))
        missed += abs(len(plan.items) - len(reached))
        where = craft.snapshot().truth
        yield Sample(craft.now_us * 1e-6, memory_MiB(), missed, math.hypot(where.north_m, where.east_m))
        if endpoint.faults:
            raise BenchmarkError(f"{endpoint.faults} faults after {craft.now_us * 1e-6:.0f} s")
        craft.seed += 1
        craft.reset()  # a fresh battery, other noise, and back to the mark


def _fly(plan: Uploaded, craft: Vehicle, endpoint: Endpoint, client: Client) -> list[int]:
    """One flight from the upload to the disarming; the items reached, in order."""
    flight = Flight(plan, client)
    while not client.finished:
        wall_s = craft.now_us * 1e-6
        for datagram in client.poll(wall_s):
            endpoint.receive(datagram, lockstep.ADDRESS, PortKind.ONBOARD, wall_s)
        for sent in endpoint.poll(wall_s):
            client.receive(sent.data, wall_s)
        craft.advance(craft.now_us + lockstep.TURN_US)
    if client.fault is not None:
        raise BenchmarkError(f"the flight at {craft.now_us * 1e-6:.0f} s: {client.fault}")
    return [int(found[1]) for note in flight.notes if (found := re.search(r"item (\d+) reached", note))]


def memory_MiB() -> float:
    """What the process holds, rubbish left aside."""
    gc.collect()
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError as error:
        raise BenchmarkError(f"memory is not told here: {error.strerror}") from None
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20
