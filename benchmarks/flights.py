"""The paper's rectangle in the forms that the benchmarks fly in process, without link and sockets."""

import math
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from benchmarks.processes import ROOT, BenchmarkError
from gcs_tools import plan as plans
from gcs_tools.plan import Streamed, Uploaded
from gcs_tools.reference import Waypoints
from sitl.calm_array import calm_array, put_calm
from sitl.closed_loop import NOISE_COLUMNS, TRACE_COLUMNS, LoopState
from sitl.control.guidance import Effort, Guidance
from sitl.control.reference import DEGREE, Trajectory
from sitl.loop_arrays import LOOP_SIZE, OBSERVED_SIZE, guidance_array, put_loop, run_in_place, state_of
from sitl.model.rigid_body import State
from sitl.onboard.calm import Calm, Ground
from sitl.onboard.mission import MissionState
from sitl.onboard.modes import Mode
from sitl.onboard.offboard import OffboardTarget
from sitl.onboard.plan import MissionItem
from sitl.tally import NOTHING, tally
from sitl.vehicle import NOISE_STEPS, Vehicle, load_vehicle

STREAM_US = 20_000  # between targets, and between two crossings into compiled code
AIRBORNE_S = 60.0  # of the rectangle: what the bare loop flies, before the landing
_MINIMUM_JERK = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)  # s(τ) = 10τ³ − 15τ⁴ + 6τ⁵
_NO_TRACE = np.zeros((0, len(TRACE_COLUMNS)))
_ARRIVED_M = 0.1


@cache
def streamed() -> Streamed:
    """The paper's rectangle; read once, so that reading it is in nobody's time."""
    plan = plans.load(ROOT / "missions" / "rectangle.yaml")
    assert isinstance(plan, Streamed)
    return plan


class Bare(NamedTuple):
    """Plant and cascade with a trajectory, and nothing around them."""

    plants: object
    controllers: object
    guidance: Guidance
    loop: LoopState
    step_us: int
    noisy: bool


def bare(name: str) -> Bare:
    """The rectangle as one trajectory, from standing, with the very constants that the vehicle flies with."""
    vehicle = Vehicle(load_vehicle(name))
    guidance = Guidance(int(Effort.FLY), _trajectory())
    noisy = any(vehicle.spec.sensors)
    return Bare(vehicle._plants, vehicle._controllers, guidance, vehicle.loop, vehicle.step_us, noisy)


def _trajectory() -> Trajectory:
    """The rectangle's minimum-jerk moves as polynomials, exactly."""
    reference = streamed().reference
    assert isinstance(reference, Waypoints)
    points = reference.points
    c = np.zeros((len(points) - 1, 4, DEGREE + 1))
    for k, (here, there) in enumerate(pairwise(points)):
        span = there.t_s - here.t_s
        for axis in range(3):
            move = there.at_m[axis] - here.at_m[axis]
            c[k, axis] = [move * s / span**power for power, s in enumerate(_MINIMUM_JERK)]
            c[k, axis, 0] += here.at_m[axis]
    return Trajectory(np.array([point.t_s for point in points[:-1]]), c, points[-1].t_s)


def fly_bare(flight: Bare, steps_at_once: int) -> float:
    """AIRBORNE_S of the rectangle in crossings of so many steps, to where it should be then. Returns seconds."""
    random = np.random.Generator(np.random.PCG64(1))
    noise = np.zeros((0, NOISE_COLUMNS))
    loop, seen = np.zeros(LOOP_SIZE), np.zeros(OBSERVED_SIZE)
    put_loop(loop, flight.loop)
    guidance = guidance_array(flight.guidance)
    calm, nothing = calm_array(0.0), tally()
    now_us, left = 0, round(AIRBORNE_S * 1e6) // flight.step_us
    while left > 0:
        steps = min(left, steps_at_once)
        put_calm(calm, Calm(1 << 52, Ground.NOTHING), int(seen[-1]), math.inf)
        if flight.noisy and len(noise) < steps:
            fresh = random.standard_normal((max(steps - len(noise), NOISE_STEPS), NOISE_COLUMNS))
            noise = np.concatenate((noise, fresh))
        run = run_in_place(
            flight.plants, flight.controllers, guidance, loop, noise, now_us, flight.step_us, steps, _NO_TRACE, seen,
            calm, nothing, NOTHING,
        )  # fmt: skip
        now_us += run * flight.step_us
        left -= run
        noise = noise[run:]
    _check(state_of(loop), streamed().reference.at(AIRBORNE_S).position_m)
    return AIRBORNE_S


@cache
def mission() -> tuple[list[MissionItem], float]:
    """Its corners as mission items, and the seconds after which the flight counts as stuck."""
    plan = plans.load(ROOT / "missions" / "rectangle-mission.yaml")
    assert isinstance(plan, Uploaded)
    items = [
        MissionItem(i.frame, i.command, 0, i.autocontinue, i.param1, i.param2, i.param3, i.param4, i.x, i.y, i.z)
        for i in plan.items
    ]
    return items, plan.limit_s


def fly_mission(vehicle: Vehicle) -> float:
    """The rectangle as mission items; the vehicle decides everything itself. Returns seconds of simulation."""
    items, limit_s = mission()
    if vehicle.mission.replace(items) is not None:
        raise BenchmarkError("the rectangle is refused as a mission")
    vehicle.advance(STREAM_US)
    vehicle.commander.arm()
    vehicle.commander.start_mission()
    while vehicle.mission.state is not MissionState.COMPLETE:
        vehicle.advance(vehicle.now_us + 1_000_000)
        if vehicle.now_us > limit_s * 1e6:
            raise BenchmarkError("the rectangle did not end as a mission")
    return vehicle.now_us * 1e-6


def fly_targets(vehicle: Vehicle) -> float:
    """The rectangle as 50 targets a second, handed over without a link. Returns seconds of simulation."""
    plan = streamed()
    start_us = 2_000_000
    commander, offboard = vehicle.commander, vehicle.offboard
    end_us = start_us + round(AIRBORNE_S * 1e6)
    while vehicle.now_us < end_us:
        now_us = vehicle.now_us
        position, velocity, acceleration = plan.reference.at((now_us - start_us) * 1e-6)
        offboard.submit(OffboardTarget(now_us, position, velocity, acceleration, 0.0), now_us)
        if commander.mode is not Mode.OFFBOARD and not offboard.lost(now_us):
            commander.set_mode(Mode.OFFBOARD)
            commander.arm()
        vehicle.advance(now_us + STREAM_US)
    _check(vehicle.snapshot().truth, plan.reference.at(AIRBORNE_S).position_m)
    return vehicle.now_us * 1e-6


def _check(state: State, target_m: tuple[float, float, float]) -> None:
    away = math.dist((state.north_m, state.east_m, state.down_m), target_m)
    if away > _ARRIVED_M:
        raise BenchmarkError(f"the flight ended {away:.2f} m from where it should")
