"""A swarm's turn in compiled code: each vehicle entering by itself, as it does, beside all of them in one call.

The one call gets every vehicle's arrays in typed lists, filled beforehand: what it would cost to keep them up to date
is left out. Both run the same control steps from the same states, and must leave the same bits.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numba
import numpy as np
from numba.typed import List

from benchmarks.figure import Figure, spread, told
from benchmarks.processes import BenchmarkError
from sitl.closed_loop import NOISE_COLUMNS, TRACE_COLUMNS
from sitl.loop_arrays import run_in_place
from sitl.vehicle import Vehicle, load_vehicle

COUNT = 50
STEPS = 10  # in a turn
TURNS, WINDOWS = 40, 7
_NO_NOISE, _NO_TRACE = np.zeros((0, NOISE_COLUMNS)), np.zeros((0, len(TRACE_COLUMNS)))


@numba.njit(nogil=True, error_model="numpy")
def run_all(
    plants: Any, controllers: Any, guidances: Any, loops: Any, noise: Any, start_us: int, dt_us: int, steps: int,
    trace: Any, observed: Any, calms: Any, tallies: Any, wanted: Any,
) -> None:  # fmt: skip
    """`run_in_place` for each vehicle."""
    for k in range(len(loops)):
        run_in_place(
            plants[k], controllers[k], guidances[k], loops[k], noise, start_us, dt_us, steps, trace, observed[k],
            calms[k], tallies[k], wanted[k],
        )  # fmt: skip


def measure(quick: bool) -> Iterator[Figure]:
    alone, together = hovering(), hovering()
    columns = [
        List([getattr(vehicle, name) for vehicle in together])
        for name in ("_plants", "_controllers", "_guidance_array", "_loop_array", "_observed_array", "_calm", "tally")
    ]
    plants, controllers, guidances, loops, observed, calms, tallies = columns
    wanted = List([vehicle.wanted for vehicle in together])
    step_us = together[0].step_us

    def one_by_one(turn: int, steps: int) -> None:
        now_us = turn * STEPS * step_us
        for v in alone:
            run_in_place(
                v._plants, v._controllers, v._guidance_array, v._loop_array, _NO_NOISE, now_us, step_us, steps,
                _NO_TRACE, v._observed_array, v._calm, v.tally, v.wanted,
            )  # fmt: skip

    def at_once(turn: int, steps: int) -> None:
        run_all(
            plants, controllers, guidances, loops, _NO_NOISE, turn * STEPS * step_us, step_us, steps,
            _NO_TRACE, observed, calms, tallies, wanted,
        )  # fmt: skip

    at_once(0, 0)  # compiles
    ways = (one_by_one, at_once)
    flying: dict[Callable[[int, int], None], list[float]] = {way: [] for way in ways}
    entering: dict[Callable[[int, int], None], list[float]] = {way: [] for way in ways}
    for window in range(WINDOWS):
        for way in ways:
            flying[way].append(_shortest_us(way, window * TURNS, STEPS))
            entering[way].append(_shortest_us(way, window * TURNS, 0))
    bits = [[v._loop_array.tobytes() + v._observed_array.tobytes() for v in each] for each in (alone, together)]
    if bits[0] != bits[1]:
        raise BenchmarkError("the two ways differ")
    for way, what in zip(ways, ("one by one", "in one call, to the same bits"), strict=True):
        yield told(f"a turn of {COUNT} vehicles, {what}: each", spread(flying[way], "µs"))
        yield told("  with no control step in it", spread(entering[way], "µs"))


def hovering() -> list[Vehicle]:
    spec = load_vehicle("yawsitter")
    vehicles = [Vehicle(spec, seed=1 + k) for k in range(COUNT)]
    for k, vehicle in enumerate(vehicles):
        vehicle.advance(100_000)
        vehicle.commander.takeoff(vehicle.commander.home.alt_amsl_m + 2.0 + 0.02 * k)
        vehicle.commander.arm()
        vehicle.advance(6_000_000)
    return vehicles


def _shortest_us(way: Callable[[int, int], None], first: int, steps: int) -> float:
    """Time for each vehicle in the quickest of some turns [µs]."""
    spent = []
    for turn in range(first, first + TURNS):
        start_s = time.perf_counter()
        way(turn, steps)
        spent.append(time.perf_counter() - start_s)
    return min(spent) * 1e6 / COUNT
