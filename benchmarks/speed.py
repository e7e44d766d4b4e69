"""Speed: simulated seconds per second of one core, without the link and with it."""

import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from benchmarks import flights
from benchmarks.figure import Figure, at_least, spread, told
from benchmarks.processes import BenchmarkError
from gcs_tools import lockstep
from gcs_tools.client import Client
from gcs_tools.flight import Flight
from sitl import batch
from sitl.mavlink.endpoint import Endpoint, PortKind
from sitl.vehicle import Vehicle, load_vehicle

T = TypeVar("T")

RUNS = 7
_UNIT = "× real time"
VEHICLES = ("yawsitter", "yawsitter-real")
_UNHEARD = ((PortKind.GCS, ("127.0.0.1", 14550)), (PortKind.ONBOARD, ("127.0.0.1", 14541)))


def measure(quick: bool) -> Iterator[Figure]:
    for name in VEHICLES:
        rates = _rates(flights.bare, name, _bare)
        yield at_least(f"compiled loop alone, {name}", rates, 500.0, _UNIT)
    for name in VEHICLES:
        rates = _rates(_vehicle, name, flights.fly_mission)
        yield at_least(f"vehicle flying the rectangle as a mission, {name}", rates, 500.0, _UNIT)
    for name in VEHICLES:
        rates = _rates(_airy, name, _batched)
        yield at_least(f"flight of a batch, the paper's rectangle in wind and gusts, {name}", rates, 300.0, _UNIT)
    rates = _rates(_knowing, VEHICLES[1], _batched)
    yield at_least(f"the same, state known, {VEHICLES[1]}", rates, 600.0, _UNIT)
    for name in VEHICLES:
        rates = _rates(_vehicle, name, flights.fly_targets)
        yield at_least(f"vehicle given 50 targets a second, {name}", rates, 500.0, _UNIT)
    for name in VEHICLES:
        rates = _rates(_vehicle, name, _loop_back)
        yield at_least(f"with MAVLink loop-back, streams and metrics, {name}", rates, 200.0, _UNIT)
    rates = _rates(_vehicle, VEHICLES[0], _crowded)
    yield told("the same, all default streams to both ports besides", spread(rates, _UNIT))


def _vehicle(name: str) -> Vehicle:
    return Vehicle(load_vehicle(name))


def _airy(name: str) -> dict[str, Any]:
    return {"spec": load_vehicle(name), "wind_N": (1.0, 0.0, 0.0), "gust_m_s": 0.5}


def _knowing(name: str) -> dict[str, Any]:
    return _airy(name) | {"parameters": {"EST_ENABLE": 0.0}}


def _batched(settings: dict[str, Any]) -> float:
    """As a campaign flies it, with building the vehicle in the time."""
    outcome = batch.fly(flights.streamed(), **settings)
    if outcome.fault:
        raise BenchmarkError(outcome.fault)
    return outcome.end_s


def _rates(build: Callable[[str], T], name: str, fly: Callable[[T], float]) -> list[float]:
    """Simulated seconds per second, run by run, without building; the first run only warms up."""
    fly(build(name))
    rates = []
    for _ in range(RUNS):
        subject = build(name)
        start_s = time.perf_counter()
        simulated_s = fly(subject)
        rates.append(simulated_s / (time.perf_counter() - start_s))
    return rates


def _bare(flight: flights.Bare) -> float:
    """In crossings of 20 ms, as the vehicle does it."""
    return flights.fly_bare(flight, steps_at_once=flights.STREAM_US // flight.step_us)


def _loop_back(vehicle: Vehicle) -> float:
    """As `sitl fly` does it, with working out the metrics in the time."""
    lockstep.fly(flights.streamed(), vehicle).flight.metrics()
    return vehicle.now_us * 1e-6


def _crowded(vehicle: Vehicle) -> float:
    """The same flight with one more peer at each port that takes all default streams."""
    endpoint, client = Endpoint(vehicle, static_peers=_UNHEARD), Client()
    flight = Flight(flights.streamed(), client)
    while not client.finished:
        wall_s = vehicle.now_us * 1e-6
        for datagram in client.poll(wall_s):
            endpoint.receive(datagram, lockstep.ADDRESS, PortKind.ONBOARD, wall_s)
        for sent in endpoint.poll(wall_s):
            if sent.address == lockstep.ADDRESS:
                client.receive(sent.data, wall_s)
        vehicle.advance(vehicle.now_us + lockstep.TURN_US)
    flight.metrics()
    return vehicle.now_us * 1e-6
