"""All that is flown and computed, in parallel processes."""

import math
import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any, NamedTuple

from sitl.frames import GRAVITY_M_S2
from sitl.model.trim import as_dict, solve
from sitl.reproduce import loops, robustness
from sitl.reproduce.cases import ABLATED_VEHICLES, ABLATIONS, BEYOND, SEEDS, Case, Craft, evaluation
from sitl.reproduce.fly import Array, Flight, fly
from sitl.reproduce.trials import TRIALS, erring, measure
from sitl.vehicle_spec import load_vehicle

WORKERS = 2
AIRFRAMES = ("yawsitter", "yawsitter-literal")
Tick = Callable[[str, int, int], None]  # what was finished, how many are, of how many


class Evaluation(NamedTuple):
    """Everything the report tells of. flights: by Case.name. loops, limits, trims: plain data.

    trials: by trial and set-up, the measures of each seed. steps: by set-up and axis. recoveries: by set-up.
    kicks: by ablation and vehicle. shapes: by gain set and loop.
    """

    quick: bool
    flights: dict[str, Flight]
    loops: list[dict[str, Any]]
    limits: dict[str, float]
    trims: dict[str, dict[str, Any]]
    trials: dict[tuple[str, str], list[tuple[float, ...]]]
    steps: dict[tuple[str, int], Array]
    recoveries: dict[str, Array]
    kicks: dict[tuple[str, str], float]
    shapes: dict[str, dict[str, Array]]

    def flight(self, setup: str, mission: str, seed: int = 1) -> Flight:
        return self.flights[Case(setup, mission, seed=seed).name]

    @property
    def seeds(self) -> tuple[int, ...]:
        return SEEDS[:1] if self.quick else SEEDS

    @property
    def ablated(self) -> tuple[str, ...]:
        return ABLATED_VEHICLES[:1] if self.quick else ABLATED_VEHICLES


class _Work:
    """Functions and what to call them with, each call once, however many ask for its result."""

    def __init__(self) -> None:
        self.calls: dict[str, tuple[Callable[..., Any], tuple[Any, ...]]] = {}

    def add(self, name: str, function: Callable[..., Any], *args: Any) -> str:
        self.calls[name] = function, args
        return name

    def done(self, tick: Tick) -> dict[str, Any]:
        """The results by name, from parallel processes."""
        # fresh processes: a fork would copy whatever threads and caches the caller has
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(min(WORKERS, os.cpu_count() or 1), mp_context=context) as pool:
            jobs = {pool.submit(function, *args): name for name, (function, args) in self.calls.items()}
            try:
                for done, job in enumerate(as_completed(jobs), start=1):
                    job.result()
                    tick(jobs[job], done, len(jobs))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
            return {name: job.result() for job, name in jobs.items()}


def evaluate(quick: bool, tick: Tick) -> Evaluation:
    """Fly and analyse. Raises fly.FlightError where a flight fails."""
    work, cases = _Work(), evaluation(quick)
    loop_analysis = work.add("loop analysis", loops.analyse)
    flights = {case: work.add(case.command, fly, case) for case in cases}
    trials = {
        (trial.key, setup.key): [
            work.add(f"{trial.key}, {setup.title}, seed {seed}", measure, trial.key, setup.craft, seed)
            for seed in (SEEDS if not quick and (trial.gusty or erring(setup.craft)) else SEEDS[:1])
        ]
        for trial in TRIALS
        for setup in BEYOND
    }
    steps = {
        (s.key, axis): work.add(f"step {axis}, {s.title}", robustness.step_response, s.craft, axis, 1)
        for s in BEYOND
        for axis in range(3)
    }
    recoveries = {s.key: work.add(f"recoveries, {s.title}", robustness.excursions, s.craft) for s in BEYOND}
    kicks = {
        (a.key, v): work.add(
            f"heading, {a.group}: {a.title}, {v}", robustness.heading_kick, Craft(v, a.overrides), a.plant, a.believed
        )
        for a in ABLATIONS
        for v in ABLATED_VEHICLES[: 1 if quick else None]
    }
    results = work.done(tick)
    return Evaluation(
        quick,
        {case.name: results[name]._replace(case=case) for case, name in flights.items()},
        results[loop_analysis],
        _limits(),
        _trims(),
        {key: [results[name] for name in names] for key, names in trials.items()},
        {key: results[name] for key, name in steps.items()},
        {key: results[name] for key, name in recoveries.items()},
        {key: results[name] for key, name in kicks.items()},
        loops.shapes(),
    )


def _trims() -> dict[str, dict[str, Any]]:
    return {name: as_dict(solve(load_vehicle(name).airframe.airframe)) for name in AIRFRAMES}


def _limits() -> dict[str, float]:
    """What the vehicle can't do better, whatever its gains, and the attitude errors whose demand is all that it has."""
    a = load_vehicle("yawsitter").airframe.airframe
    thrust_N = as_dict(solve(a))["thrust_N"]
    flaps_N = thrust_N / (2.0 * a.wake_area_m2) * a.flap_area_m2 * 2.0 * a.flap_max_rad  # q S_f δ of both
    moments = {
        "roll": (flaps_N * a.flap_roll_arm_m * a.flap_lift_slope, a.jxx_kg_m2),
        "pitch": (flaps_N * a.chord_m * abs(a.flap_moment_slope), a.jyy_kg_m2),
        "yaw": ((thrust_N - 2.0 * a.thrust_min_N) * a.prop_arm_m, a.jzz_kg_m2),
    }
    limits = {
        "unstable_zero_1_s": loops.unstable_zero(),
        "thrust_to_weight": 2.0 * a.thrust_max_N / (a.mass_kg * GRAVITY_M_S2),
    }
    for axis, (name, (moment, inertia)) in zip("XYZ", moments.items(), strict=True):
        limits[f"{name}_rad_s2"] = moment / inertia
        for gains, home, _ in loops.HOMES:
            g = load_vehicle(home).gains
            limits[f"{name}_saturates_deg_{gains}"] = math.degrees(moment / (g[f"ATT_{axis}_P"] * g[f"RATE_{axis}_P"]))
    return limits
