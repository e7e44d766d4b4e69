"""`sitl fly`: vehicle and client in one process, taking turns, through the same MAVLink bytes as over UDP.

The simulation waits for the client and the client for the simulation, and what both take for wall time is simulation
time. So the same seed and settings give the same flight bit for bit, at whatever speed the machine manages.
"""

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gcs_tools import metrics, results
from gcs_tools import plan as plans
from gcs_tools.client import Client, LinkError
from gcs_tools.flight import Flight
from gcs_tools.link import now_s, sleep_until
from gcs_tools.plan import Plan, Streamed, Uploaded
from gcs_tools.progress import Progress
from sitl.geodesy import GeoPoint
from sitl.mavlink.endpoint import Endpoint, PortKind
from sitl.strict_yaml import ConfigError
from sitl.vehicle import DEFAULT_HOME, Vehicle, load_vehicle, with_airframe
from sitl.vehicle_spec import VehicleSpec, gains_named

TURN_US = 20_000
ADDRESS = ("127.0.0.1", 14540)
LIMIT_S = 7200.0  # of simulation time: no flight takes so long, so one that does is a mistake
_SHOW_EVERY = 64  # turns

AnyVehicle = TypeVar("AnyVehicle", bound=Vehicle)


class _Watched(Vehicle):
    """A vehicle of whose true motion a record is kept: time [s], position and its own reference (north, east, down)."""

    def __init__(self, *args: Any, **options: Any) -> None:
        self.motion: list[tuple[float, ...]] = []
        super().__init__(*args, **options)

    def advance(self, until_us: int, trace: Any = None) -> None:
        super().advance(until_us, trace)
        seen = self.snapshot()
        s = seen.truth
        self.motion.append((seen.now_us * 1e-6, s.north_m, s.east_m, s.down_m, *seen.reference[:3]))


class Flown(NamedTuple):
    flight: Flight
    vehicle: Vehicle
    factor: float  # simulation time over wall time, from the first turn to the last


class Lockstep:
    """The link to a vehicle in this process: both sides take turns, and simulation time is what both take for time."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle, self._endpoint = vehicle, Endpoint(vehicle)

    def turn(self, client: Client, turn_us: int = TURN_US) -> None:
        """The client speaks, the vehicle answers and flies on for `turn_us`."""
        vehicle, endpoint = self.vehicle, self._endpoint
        wall_s = vehicle.now_us * 1e-6
        for datagram in client.poll(wall_s):
            endpoint.receive(datagram, ADDRESS, PortKind.ONBOARD, wall_s)
        client.receive(b"".join([sent.data for sent in endpoint.poll(wall_s)]), wall_s)
        vehicle.advance(vehicle.now_us + turn_us)


def fly(
    plan: Plan, vehicle: Vehicle, *, speed: float = math.inf, quiet: bool = True, limit_s: float = LIMIT_S
) -> Flown:
    """Fly a plan from its first message to its last, or so far. speed: of real time, at most.

    The flight's own failure is in Flown.flight.client.fault.
    """
    link, client = Lockstep(vehicle), Client()
    flight = Flight(plan, client)
    vehicle.advance(TURN_US)  # kernels compiled and caches warm before the clock starts
    start_us, start_s = vehicle.now_us, now_s()
    end_us = start_us + int(limit_s * 1e6)
    turns = 0
    with Progress(flight, quiet=quiet) as progress:
        while not client.finished and vehicle.now_us < end_us:
            link.turn(client)
            turns += 1
            if turns % _SHOW_EVERY == 0:
                progress.update(now_s())
            if speed != math.inf:
                sleep_until(start_s + (vehicle.now_us - start_us) * 1e-6 / speed)
    took_s = max(now_s() - start_s, 1e-9)
    return Flown(flight, vehicle, (vehicle.now_us - start_us) * 1e-6 / took_s)


def build(
    plan: Plan,
    spec: VehicleSpec,
    kind: type[AnyVehicle],
    *,
    plant: Mapping[str, float] | None = None,
    believed: Mapping[str, float] | None = None,
    **options: Any,
) -> AnyVehicle:
    """A vehicle that stands where the plan was drawn. plant, believed: airframe numbers changed in what flies, and in
    what its controller takes it to be. options: Vehicle's. Raises ConfigError.
    """
    home = DEFAULT_HOME
    if isinstance(plan, Uploaded) and plan.home is not None:
        home = GeoPoint(*plan.home)
    flown, airframe = with_airframe(spec, plant or {}, believed or {})
    return kind(flown, home=home, believed_airframe=airframe, **options)


def true_figures(flight: Flight, motion: Sequence[tuple[float, ...]]) -> dict[str, Any]:
    """Errors of the plant's own position, which the vehicle itself doesn't know, as JSON has them."""
    assert flight.t0_s is not None
    assert flight.measured_s is not None
    rows = np.array(motion)
    t = rows[:, 0] - flight.t0_s
    rows, t = rows[t > -1e-6], t[t > -1e-6]
    wanted = rows[:, 4:7]
    if isinstance(flight.plan, Streamed):
        wanted = np.array([flight.plan.reference.at(float(s)).position_m for s in t])
    none = np.zeros((0, 4))
    track = metrics.Track(t, wanted, rows[:, 1:4], none, none, none)
    m = metrics.evaluate(track, flight.measured_s)
    mean, greatest = metrics.distance(track, flight.measured_s)
    figures = {"mae": m.mae, "rmse": m.rmse, "max_overshoot": m.max_overshoot, "final_error": m.final_error}
    in_space = {"mean_distance": mean, "max_distance": greatest}
    return {k: [round(v, 6) for v in values] for k, values in figures.items()} | {
        k: round(v, 6) for k, v in in_space.items()
    }


def main(args: argparse.Namespace) -> int:
    """`sitl fly` with its parsed arguments; a speed of 0 is as fast as possible.

    0 when the mission was flown, 1 when it was not, 2 for settings that can't be used.
    """
    try:
        plan = plans.load(args.mission)
        vehicle = build(
            plan,
            load_vehicle(args.vehicle),
            _Watched,
            plant=dict(args.plant),
            believed=dict(args.believed),
            seed=args.seed,
            wind_N=args.wind,
            gust_m_s=args.gust,
            heading_rad=math.radians(args.heading),
            overrides={**(gains_named(args.gains) if args.gains else {}), **dict(args.set)},
        )
        out = Path(args.out) if args.out else None
        results.prepare(out)
    except ConfigError as error:
        return _complain(str(error), 2)
    flown = fly(plan, vehicle, speed=args.speed or math.inf, quiet=args.json)
    flight = flown.flight
    if flight.measured_s is not None:
        try:
            true = true_figures(flight, vehicle.motion)
            factor, name = flown.factor, vehicle.spec.name
            results.conclude(flight, vehicle=name, factor=factor, out=out, as_json=args.json, true=true)
        except LinkError as error:
            return _complain(f"{plan.name}: {error}", 1)
        except OSError as error:
            return _complain(f"{out}: can't be written: {error.strerror}", 2)
    if not flight.client.finished:
        return _complain(f"{plan.name}: not done after {LIMIT_S:g} s of simulation time", 1)
    if flight.client.fault is not None:
        return _complain(f"{plan.name}: {flight.client.fault}", 1)
    return 0


def _complain(message: str, code: int) -> int:
    print(f"sitl fly: {message}", file=sys.stderr)
    return code
