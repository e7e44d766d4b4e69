"""All that is flown and computed, in parallel processes."""

import math
import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from typing import Any, NamedTuple

from sitl.model.trim import as_dict, solve
from sitl.reproduce import loops
from sitl.reproduce.cases import ABLATED_VEHICLES, SEEDS, Case, evaluation
from sitl.reproduce.fly import Flight, fly
from sitl.vehicle_spec import load_vehicle

WORKERS = 2
AIRFRAMES = ("yawsitter", "yawsitter-literal")
Tick = Callable[[str, int, int], None]  # what was finished, how many are, of how many


class Evaluation(NamedTuple):
    """Everything the report tells of. flights: by Case.name. loops, limits, trims: plain data."""

    quick: bool
    flights: dict[str, Flight]
    loops: list[dict[str, Any]]
    limits: dict[str, float]
    trims: dict[str, dict[str, Any]]

    def flight(self, setup: str, mission: str, seed: int = 1) -> Flight:
        return self.flights[Case(setup, mission, seed=seed).name]

    @property
    def seeds(self) -> tuple[int, ...]:
        return SEEDS[:1] if self.quick else SEEDS

    @property
    def ablated(self) -> tuple[str, ...]:
        return ABLATED_VEHICLES[:1] if self.quick else ABLATED_VEHICLES


def evaluate(quick: bool, tick: Tick) -> Evaluation:
    """Fly and analyse. Raises fly.FlightError where a flight fails."""
    cases = evaluation(quick)
    todo = list({case.command: case for case in cases}.values())
    total = len(todo) + 1
    # fresh processes: a fork would copy whatever threads and caches the caller has
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(WORKERS, os.cpu_count() or 1), mp_context=context) as pool:
        analysis = pool.submit(loops.analyse)
        jobs: dict[Future[Any], str] = {analysis: "loop analysis"}
        flown = {case.command: pool.submit(fly, case) for case in todo}
        jobs |= {job: command for command, job in flown.items()}
        try:
            for done, job in enumerate(as_completed(jobs), start=1):
                job.result()
                tick(jobs[job], done, total)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        flights = {case.name: flown[case.command].result()._replace(case=case) for case in cases}
        return Evaluation(quick, flights, analysis.result(), _limits(), _trims())


def _trims() -> dict[str, dict[str, Any]]:
    return {name: as_dict(solve(load_vehicle(name).airframe.airframe)) for name in AIRFRAMES}


def _limits() -> dict[str, float]:
    """What the vehicle can't do better, whatever its gains."""
    a = load_vehicle("yawsitter").airframe.airframe
    zero = loops.unstable_zero()
    weight = as_dict(solve(a))["thrust_N"]
    flap_pressure_area = weight / (2.0 * math.pi * (a.slipstream_radius_ratio * a.prop_radius_m) ** 2) * a.flap_area_m2
    deflection = 2.0 * flap_pressure_area * a.flap_max_rad
    return {
        "unstable_zero_1_s": zero,
        "thrust_to_weight": 2.0 * a.thrust_max_N / (a.mass_kg * 9.80665),
        "pitch_acceleration_rad_s2": deflection * a.chord_m * abs(a.flap_moment_slope) / a.jyy_kg_m2,
        "roll_acceleration_rad_s2": deflection * a.flap_roll_arm_m * a.flap_lift_slope / a.jxx_kg_m2,
        "yaw_acceleration_rad_s2": (weight - 2.0 * a.thrust_min_N) * a.prop_arm_m / a.jzz_kg_m2,
    }
