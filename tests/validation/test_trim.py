import math

import pytest

from sitl.control.feedforward import invert
from sitl.frames import GRAVITY_M_S2
from sitl.model.trim import solve, unbalanced
from sitl.vehicle_spec import load_vehicle


@pytest.mark.parametrize(
    ("vehicle", "pitch_deg", "thrust_N", "flap_deg"),
    [("yawsitter", 99.55, 10.734, -2.07), ("yawsitter-literal", 92.39, 11.211, -8.07)],
)
def test_hover_trim_of_both_airframes(vehicle: str, pitch_deg: float, thrust_N: float, flap_deg: float) -> None:
    point = solve(load_vehicle(vehicle).airframe.airframe)
    assert point.converged
    assert math.degrees(point.pitch_rad) == pytest.approx(pitch_deg, abs=0.01)
    assert point.thrust_N == pytest.approx(thrust_N, abs=0.002)
    assert math.degrees(point.flap_rad) == pytest.approx(flap_deg, abs=0.01)


@pytest.mark.parametrize("airspeed", [0.0, 3.0, 8.0, 15.0])
def test_nothing_is_left_over_in_trim(airspeed: float) -> None:
    a = load_vehicle("yawsitter").airframe.airframe
    point = solve(a, airspeed)
    assert point.converged
    assert unbalanced(a, airspeed, point.pitch_rad, point.thrust_N, point.flap_rad) == pytest.approx(
        [0, 0, 0], abs=1e-8
    )


def test_a_trim_beyond_the_actuators_is_reported_as_none() -> None:
    heavy = load_vehicle("yawsitter").airframe.airframe._replace(mass_kg=5.0)
    assert not solve(heavy).converged


@pytest.mark.parametrize("speed", [-3.0, 0.0, 2.0, 3.7])
def test_the_controllers_inverse_model_agrees_with_the_trim_solver(speed: float) -> None:
    a = load_vehicle("yawsitter").airframe.airframe
    weight = a.mass_kg * GRAVITY_M_S2
    start = solve(a)
    inverse = invert(a, (0.0, 0.0, -weight), (speed, 0.0, 0.0), 0.0, start.pitch_rad, weight, 40)
    left = unbalanced(a, speed, inverse.pitch_rad, inverse.thrust_N, inverse.flap_rad)
    assert left == pytest.approx([0, 0, 0], abs=1e-6)
