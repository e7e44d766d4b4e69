"""Where the time of a simulated second goes: kernel, crossing, onboard logic, link and client.

Each share is the difference between two flights of the rectangle that differ in just that, best of several runs.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial

from benchmarks import flights
from benchmarks.figure import Figure, told
from gcs_tools import lockstep
from sitl.vehicle import Vehicle, load_vehicle

RUNS = 9
VEHICLE = "yawsitter"


def measure(quick: bool) -> Iterator[Figure]:
    kernel, crossed, vehicle, link = _bests_ms(
        lambda: partial(flights.fly_bare, flights.bare(VEHICLE), 10**9),
        lambda: partial(flights.fly_bare, flights.bare(VEHICLE), 10),
        lambda: partial(flights.fly_targets, _vehicle()),
        lambda: partial(_linked, _vehicle()),
    )
    yield told("a simulated second in all, yawsitter with the link", f"{link:.2f} ms")
    for what, share in (
        ("  compiled loop, 500 control steps", kernel),
        ("  crossing into it 50 times", crossed - kernel),
        ("  targets, commander, guidance, 50 ticks", vehicle - crossed),
        ("  MAVLink, streams, client, recording", link - vehicle),
    ):
        yield told(what, f"{share:.2f} ms, {share / link:.0%}")


def _vehicle() -> Vehicle:
    return Vehicle(load_vehicle(VEHICLE))


def _linked(vehicle: Vehicle) -> float:
    return lockstep.fly(flights.streamed(), vehicle).vehicle.now_us * 1e-6


def _bests_ms(*prepare: Callable[[], Callable[[], float]]) -> list[float]:
    """Milliseconds per simulated second of each, in turns so that a slow moment of the machine meets all alike."""
    best = [float("inf")] * len(prepare)
    for _ in range(RUNS):
        for k, make in enumerate(prepare):
            fly = make()
            start_s = time.perf_counter()
            simulated_s = fly()
            best[k] = min(best[k], (time.perf_counter() - start_s) * 1e3 / simulated_s)
    return best
