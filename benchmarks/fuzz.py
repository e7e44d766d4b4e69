"""A million hostile datagrams against a hovering vehicle, in process, in lockstep: it must not so much as drift.

The claim: whatever arrives, apart from what the vehicle must obey (hostile.obeyed), it stays within 0.3 m of where it
hovers, and parameters and plan stay whole. Then a tenth as many with nothing left out: the vehicle may do as it is told
then, but it must stay finite, its parameters within their ranges, and the link up.
"""

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

from benchmarks.figure import Figure, at_most, told
from benchmarks.hostile import Hostile, Target
from benchmarks.processes import BenchmarkError
from sitl.mavlink.codec import Parser
from sitl.mavlink.endpoint import Endpoint, PortKind
from sitl.onboard.mission import MissionItem
from sitl.onboard.modes import Mode
from sitl.vehicle import Vehicle, load_vehicle

COUNT = 1_000_000
FLIGHT = 100_000  # datagrams to one vehicle, which hovers for as many milliseconds and some more
DRIFT_M = 0.3
_PER_TURN = 20  # datagrams to 20 ms of simulation
_TURN_US = 20_000
_HOVER_M = 5.0
_PEERS = 12


class Outcome(NamedTuple):
    """What came of one flight."""

    datagrams: int
    left_out: int
    drift_m: float
    faults: int
    changed: list[str]


def measure(quick: bool) -> Iterator[Figure]:
    count = COUNT // 20 if quick else COUNT
    flights = [hover(seed, min(FLIGHT, count)) for seed in range(1, max(1, count // FLIGHT) + 1)]
    sent, left_out = sum(flight.datagrams for flight in flights), sum(flight.left_out for flight in flights)
    yield told("hostile datagrams to a hovering vehicle", f"{sent}; {left_out} that it must obey left out")
    yield at_most("  farthest from its place", [max(flight.drift_m for flight in flights)], DRIFT_M, "m")
    changed = sorted({name for flight in flights for name in flight.changed})
    yield at_most("  parameters or plan changed", [len(changed)], 0, f"({', '.join(changed)})" if changed else "")
    yield at_most("  faults in the program", [sum(flight.faults for flight in flights)], 0, "")
    wild = [obey(seed, min(FLIGHT, count // 10)) for seed in range(1, max(1, count // 10 // FLIGHT) + 1)]
    sent = sum(flight.datagrams for flight in wild)
    yield told("and with nothing left out", f"{sent}, all finite, the link up")
    yield at_most("  parameters out of range", [sum(len(flight.changed) for flight in wild)], 0, "")
    yield at_most("  faults in the program", [sum(flight.faults for flight in wild)], 0, "")


def hovering(vehicle: str = "yawsitter", seed: int = 1) -> tuple[Vehicle, Endpoint]:
    """In the air and in Hold, with a plan stored."""
    craft = Vehicle(load_vehicle(vehicle), seed=seed)
    endpoint = Endpoint(craft)
    item = MissionItem(6, 16, 0, 1, 0.0, 0.0, 0.0, math.nan, 556_985_000, 373_595_000, 5.0)
    fault = craft.mission.replace([item, item._replace(x=556_986_000), item._replace(z=8.0)])
    if fault is not None:
        raise BenchmarkError(f"the plan is refused: {fault}")
    craft.advance(200_000)
    craft.commander.takeoff(craft.commander.home.alt_amsl_m + _HOVER_M)
    craft.commander.arm()
    while craft.commander.mode is not Mode.HOLD or craft.now_us < 8_000_000:
        craft.advance(craft.now_us + _TURN_US)
        if craft.now_us > 60_000_000:
            raise BenchmarkError("the vehicle doesn't take off")
    craft.advance(craft.now_us + 4_000_000)
    return craft, endpoint


def hover(seed: int, count: int, vehicle: str = "yawsitter") -> Outcome:
    """One flight under `count` datagrams that it need not obey."""
    craft, endpoint = hovering(vehicle, seed)
    target = Target(1, 1, craft.parameters)
    hostile = Hostile(seed, target)
    place = craft.snapshot().truth[:3]
    before = _kept(craft)
    drift_m = 0.0
    for _ in _throw(craft, endpoint, hostile, count):
        here = craft.snapshot().truth[:3]
        drift_m = max(drift_m, math.dist(here, place))
    after = _kept(craft)
    changed = [name for name in before if before[name] != after[name]]
    return Outcome(count, hostile.left_out, drift_m, endpoint.faults, changed)


def obey(seed: int, count: int) -> Outcome:
    """One flight under `count` datagrams with nothing left out; it ends as it may. Raises BenchmarkError."""
    craft, endpoint = hovering(seed=seed)
    hostile = Hostile(seed, Target(1, 1, craft.parameters), tame=False)
    for _ in _throw(craft, endpoint, hostile, count):
        if not all(map(math.isfinite, craft.snapshot().truth)):
            raise BenchmarkError(f"seed {seed}: the simulation has run away at {craft.now_us * 1e-6:.2f} s")
    p = craft.parameters
    declared = {name: p.declaration(name) for name in p.names}
    outside = [name for name, d in declared.items() if not d.minimum <= p[name] <= d.maximum]
    endpoint.poll(craft.now_us * 1e-6)
    frames = [frame for sent in endpoint.poll(craft.now_us * 1e-6 + 5.0) for frame in Parser().feed(sent.data)]
    if not any(frame.name == "HEARTBEAT" for frame in frames):
        raise BenchmarkError(f"seed {seed}: no heartbeat")
    return Outcome(count, hostile.left_out, math.inf, endpoint.faults, outside)


def _kept(craft: Vehicle) -> dict[str, object]:
    """What must not change: every parameter, the plan, mode and arming."""
    kept: dict[str, object] = {name: craft.parameters[name] for name in craft.parameters.names}
    return {**kept, "plan": repr(craft.mission.items), "mode": craft.commander.mode, "armed": craft.commander.armed}


def _throw(craft: Vehicle, endpoint: Endpoint, hostile: Hostile, count: int) -> Iterator[None]:
    """Hand the datagrams over, and let time pass for the vehicle and the link alike; yields at every turn."""
    for k, data in enumerate(itertools.islice(hostile, count)):
        wall_s = craft.now_us * 1e-6
        kind = PortKind.GCS if k % 3 else PortKind.ONBOARD
        endpoint.receive(data, ("127.0.0.1", 5000 + k * 7 % _PEERS), kind, wall_s)
        if k % _PER_TURN == 0:
            craft.advance(craft.now_us + _TURN_US)
            endpoint.poll(craft.now_us * 1e-6)
            yield
