"""What a set of gains costs: flights in this process, each with three terms that are about 1 where it goes well.

                 a step on a loop                          a course followed with feed-forward
    tracking     ∫|e| dt / (size × the loop's time)        mean distance from the reference / 1 cm
    overshoot    share of the step / 10 %                  greatest distance / 10 cm
    effort       Σ|du/dt| of motors and flaps / 5 per s    the same

The loop's time is 1 s for position, 0.4 s velocity, 0.15 s attitude, 0.05 s rate. The cost of a flight is the sum of
its terms; of a manoeuvre the worst of its flights, one for each seed; of the gains the mean of the manoeuvres. A flight
that fails costs FAILED and up to twice that, the more the sooner it failed; no flight that succeeds costs as much.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from gcs_tools import plan as plans
from gcs_tools.client import Client, LinkError
from gcs_tools.plan import Plan, Streamed
from gcs_tools.reference import TimedPoint, Waypoints
from gcs_tools.tune import analysis, loops
from gcs_tools.tune.experiment import Experiment, GainSet
from gcs_tools.tune.response import TooFewSamplesError
from gcs_tools.tune.session import InProcess, conduct
from sitl import batch
from sitl.quaternion import Vec3
from sitl.vehicle import Vehicle, load_vehicle
from sitl.vehicle_spec import VehicleSpec

FAILED = 1000.0
TOUR = "tour"  # the course that is built in
_DEAREST = 0.999 * FAILED  # of a flight that succeeds
_OVERSHOOT, _TRAVEL_1_S, _NEAR_M, _OFF_M = 0.1, 5.0, 0.01, 0.1
_LOST_M = 5.0
_HEIGHT_M = 6.0
_SLOW_US = 20_000
_LONGEST_S = 60.0  # of a flight with a step
_ACTUATORS = ("thrust_left_N", "thrust_right_N", "flap_left_rad", "flap_right_rad")
_COLUMNS = [batch.TRACE_COLUMNS.index(f"command_{name}") for name in _ACTUATORS]


class Air(NamedTuple):
    """What a flight is flown in. seed: of gusts and sensor noise."""

    seed: int
    wind_N: Vec3
    gust_m_s: float


class Task(NamedTuple):
    """What a candidate is judged by. manoeuvres: names of loops, TOUR, or mission files."""

    vehicle: str
    settings: tuple[tuple[str, float], ...]
    manoeuvres: tuple[str, ...]
    airs: tuple[Air, ...]


class Cost(NamedTuple):
    """The terms of one flight. fault: why it failed; then `tracking` is the whole cost."""

    tracking: float
    overshoot: float
    effort: float
    fault: str = ""

    @property
    def total(self) -> float:
        total = self.tracking + self.overshoot + self.effort
        return total if self.fault else min(total, _DEAREST)


def failed(fault: str, share: float) -> Cost:
    """Of a flight that got so far, 0 to 1."""
    return Cost(FAILED * (2.0 - min(1.0, max(0.0, share))), 0.0, 0.0, fault)


def judged(costs: list[list[Cost]]) -> float:
    """The cost of gains, from that of each manoeuvre's flights."""
    return sum(max(cost.total for cost in flights) for flights in costs) / len(costs)


def fly(task: Task, manoeuvre: str, air: Air, gains: dict[str, float]) -> Cost:
    """One flight. What goes wrong in it is in the cost: nothing that gains can do raises."""
    try:
        cost = _step(task, manoeuvre, air, gains) if manoeuvre in loops.LOOPS else _course(task, manoeuvre, air, gains)
    except (ArithmeticError, ValueError) as error:
        return failed(f"{type(error).__name__}: {error}", 0.0)
    return cost if math.isfinite(cost.total) else failed("not a number", 0.0)


@cache
def _spec(name: str) -> VehicleSpec:
    return load_vehicle(name)


@cache
def course(name: str) -> Plan:
    """The built-in tour, or a mission file. Raises ConfigError."""
    return _tour() if name == TOUR else plans.load(name)


def _tour() -> Streamed:
    """Up, legs of 2 m to all sides at up to 1.25 m/s, and up and down on the way; 24 s."""
    places = ((0, 0, 0), (0, 0, -2), (2, 0, -2), (2, 2, -3), (0, 2, -2), (1, 1, -2), (0, 0, -2))
    times = (0.0, 4.0, 7.0, 10.0, 13.0, 16.0, 19.0)
    points = [TimedPoint(t, (float(n), float(e), float(d))) for t, (n, e, d) in zip(times, places, strict=True)]
    return Streamed(TOUR, TOUR, Waypoints(points), 21.0, (), 0.0, None)


def _step(task: Task, name: str, air: Air, gains: dict[str, float]) -> Cost:
    loop = loops.parse(name)
    excitation = loops.step(loop.kind.size, loop.kind.hold_s)
    vehicle = Vehicle(
        _spec(task.vehicle), seed=air.seed, wind_N=air.wind_N, gust_m_s=air.gust_m_s,
        overrides={**dict(task.settings), **gains},
    )  # fmt: skip
    interval_us = 1000 if loop.steers else _SLOW_US
    experiment = Experiment(
        Client(), loop, excitation, [GainSet("own", None)],
        height_m=_HEIGHT_M, full_rate_us=interval_us, land=False,
    )  # fmt: skip
    try:
        (trial,) = conduct(experiment, InProcess(vehicle, lambda: experiment.recording and loop.steers), quiet=True)
        values = analysis.analyse(trial, excitation, 0.02).values
    except (LinkError, TooFewSamplesError) as fault:
        return failed(str(fault), vehicle.now_us * 1e-6 / _LONGEST_S)
    if trial.fault:
        return failed(trial.fault, vehicle.now_us * 1e-6 / _LONGEST_S)
    return Cost(
        values["iae"] / (abs(excitation.size) * loop.kind.scale_s),
        values["overshoot"] / _OVERSHOOT,
        values["travel_1_s"] / _TRAVEL_1_S,
    )


def _course(task: Task, name: str, air: Air, gains: dict[str, float]) -> Cost:
    plan, spec = course(name), _spec(task.vehicle)
    flown = batch.fly(
        plan, spec, seed=air.seed, wind_N=air.wind_N, gust_m_s=air.gust_m_s,
        parameters={**dict(task.settings), **gains}, traced=True,
    )  # fmt: skip
    length_s = plan.duration_s if isinstance(plan, Streamed) else plan.limit_s
    share = flown.end_s / length_s
    if flown.fault or flown.trace is None:
        return failed(flown.fault or "never flew", share)
    if not flown.max_distance_m < _LOST_M or flown.tipped_over:
        return failed(f"it was {flown.max_distance_m:.1f} m from its reference", share)
    a = spec.airframe.airframe
    ranges = np.array([a.thrust_max_N, a.thrust_max_N, a.flap_max_rad, a.flap_max_rad])
    u = flown.trace[:, _COLUMNS] / ranges
    travel_1_s = float(np.abs(np.diff(u, axis=0)).sum()) / max(float(flown.trace[-1, 0] - flown.trace[0, 0]), 1e-9)
    return Cost(flown.mean_distance_m / _NEAR_M, flown.max_distance_m / _OFF_M, travel_1_s / _TRAVEL_1_S)
