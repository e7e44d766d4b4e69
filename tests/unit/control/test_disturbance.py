"""The disturbance observer, against the plant's own force laws."""

import math

import numpy as np
import pytest

from sitl.control.disturbance import Bandwidth, Flaps, modelled, none, observed
from sitl.control.flow import flow_at
from sitl.model.derivative import loads, total
from sitl.model.propulsion import rotor_speed
from sitl.model.rigid_body import State, accelerations
from sitl.navigation import NavState
from sitl.quaternion import rotate_back
from sitl.vehicle_spec import load_vehicle

SPEC = load_vehicle("yawsitter")
A = SPEC.airframe.airframe
STILL = (0.0, 0.0, 0.0)
DT = 0.0005
FLYING = State(
    1.0, 2.0, -30.0, 1.5, -0.7, 0.3, 0.69, 0.05, 0.72, -0.03, 0.4, -0.2, 0.3,
    rotor_speed(A, 5.0), rotor_speed(A, 6.2), 0.2, -0.1,
)  # fmt: skip


def unit(s: State) -> State:
    k = 1.0 / math.sqrt(sum(c * c for c in s[6:10]))
    return State(*s[:6], *(k * c for c in s[6:10]), *s[10:])


def flow_and_flaps(s: State):
    u, _, w = rotate_back(s[6:10], s[3:6])
    return flow_at(A, u, w, 5.0, 6.2), Flaps(s.flap_left_rad, s.flap_right_rad)


def test_the_controllers_force_laws_are_the_plants_in_still_air() -> None:
    s = unit(FLYING)
    linear, angular = accelerations(A, s, *total(loads(A, SPEC.airframe.gear, s, STILL)))
    flow, flaps = flow_and_flaps(s)
    modelled_linear, modelled_angular = modelled(A, NavState(*s[:13]), flow, flaps)
    assert modelled_linear == pytest.approx(linear, abs=1e-9)
    assert modelled_angular == pytest.approx(angular, abs=1e-9)


def watched(push: tuple[float, float, float], twist: tuple[float, float, float], seconds: float, aloft: bool = True):
    """The disturbance found after some time of motion by the model plus a constant push and twist."""
    s, bandwidth, d = unit(FLYING), Bandwidth(3.0, 10.0), none()
    flow, flaps = flow_and_flaps(s)
    velocity, rates = np.array(s[3:6]), np.array(s[10:13])
    for _ in range(round(seconds / DT)):
        nav = NavState(*s[:3], *velocity, *s[6:10], *rates)
        d = observed(A, d, nav, flow, flaps, bandwidth, aloft, DT)
        linear, angular = modelled(A, nav, flow, flaps)
        velocity = velocity + DT * (np.array(linear) + push)
        rates = rates + DT * (np.array(angular) + twist)
    return d


def test_what_the_model_explains_is_no_disturbance() -> None:
    d = watched(STILL, STILL, 0.3)
    assert d.acceleration_N == pytest.approx(STILL, abs=0.01)
    assert d.angular_B == pytest.approx(STILL, abs=0.05)


def test_a_constant_push_is_found_with_the_observers_own_time_constant() -> None:
    d = watched((1.0, -0.5, 0.3), STILL, 1.0 / 3.0)
    share = 1.0 - math.exp(-1.0)
    assert d.acceleration_N == pytest.approx((share, -0.5 * share, 0.3 * share), abs=0.02)
    assert watched((1.0, 0.0, 0.0), STILL, 2.0).acceleration_N[0] == pytest.approx(1.0, abs=0.02)


def test_a_twist_is_found_in_body_axes() -> None:
    assert watched(STILL, (2.0, 0.0, -1.0), 0.5).angular_B == pytest.approx((2.0, 0.0, -1.0), abs=0.1)


def test_on_the_ground_nothing_is_learned() -> None:
    d = watched((3.0, 0.0, 0.0), (5.0, 0.0, 0.0), 1.0, aloft=False)
    assert d.acceleration_N == STILL
    assert d.angular_B == STILL


def test_a_push_beyond_all_sense_is_limited() -> None:
    assert watched((100.0, 0.0, 0.0), STILL, 2.0).acceleration_N[0] == 6.0
