"""Recovery from any attitude: lagging motors and flaps, tuned gains, 20 m above the ground."""

import math

import numpy as np
import pytest

from sitl.closed_loop import NOISE_COLUMNS, TRACE_COLUMNS, Controller, Plant, run, start
from sitl.control.gains import from_names
from sitl.control.guidance import Effort, Guidance
from sitl.control.reference import rest_at
from sitl.frames import standing
from sitl.model.rigid_body import State
from sitl.model.sensors import NOISELESS
from sitl.model.wind import Wind
from sitl.quaternion import multiply
from sitl.records import packed
from sitl.vehicle import Vehicle, load_vehicle

pytestmark = pytest.mark.compiled
ANGLES = (30, 60, 90, 120, 150, 170, -30, -60, -90, -120, -150, -170)
HEIGHT_M = 20.0


def excursions(name: str, axis: int, degrees: float, velocity: tuple[float, float, float]) -> tuple[float, float]:
    """(worst, last) distance [m] from the hover point over 10 s after a start turned about a body axis."""
    spec = load_vehicle(name)
    vehicle = Vehicle(spec)
    a, gear = spec.airframe.airframe, spec.airframe.gear
    plant = Plant(a, gear, spec.actuators, NOISELESS, Wind(0.0, 0.0, 0.0, 0.0), spec.substeps)
    controller = Controller(a, from_names(spec.gains), vehicle.settings(), 0.0, vehicle.tuning())
    half = math.radians(degrees) / 2
    turn = [0.0, 0.0, 0.0]
    turn[axis] = math.sin(half)
    q = multiply(standing(0.0, gear.standing_pitch_rad), (math.cos(half), *turn))
    state = State(0.0, 0.0, -HEIGHT_M, *velocity, *q, *([0.0] * 7))
    steps = 10 * spec.control_rate_hz
    trace = np.zeros((steps, len(TRACE_COLUMNS)))
    guidance = Guidance(int(Effort.FLY), rest_at(0.0, 0.0, -HEIGHT_M, 0.0))
    no_noise = np.zeros((0, NOISE_COLUMNS))
    run(packed(plant), packed(controller), guidance, start(controller, state), no_noise, 0, spec.step_us, steps, trace)
    away = np.linalg.norm(trace[:, 1:4] - (0.0, 0.0, -HEIGHT_M), axis=1)
    return float(away.max()), float(away[-1])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_it_recovers_from_any_attitude_at_rest_within_four_metres(axis: int) -> None:
    results = {angle: excursions("yawsitter-real", axis, angle, (0.0, 0.0, 0.0)) for angle in ANGLES}
    assert max(worst for worst, _ in results.values()) < 4.0, results
    assert max(last for _, last in results.values()) < 0.3, results


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("velocity", [(5.0, 0.0, 0.0), (-5.0, 0.0, 0.0), (0.0, 5.0, 0.0)])
def test_it_recovers_from_any_attitude_drifting_at_five_metres_a_second_within_eight(
    axis: int, velocity: tuple[float, float, float]
) -> None:
    results = {angle: excursions("yawsitter-real", axis, angle, velocity) for angle in ANGLES}
    assert max(worst for worst, _ in results.values()) < 8.0, results
    assert max(last for _, last in results.values()) < 0.5, results
