"""The cascade's parts: errors, limits, integrators, allocation."""

import math

import numpy as np
import pytest

from sitl.control.allocation import allocate
from sitl.control.attitude import attitude_of, braked, braked_together, error_quaternion, error_yxz, rates_of
from sitl.control.feedforward import invert
from sitl.control.flow import flow_at
from sitl.control.gains import GAIN_NAMES, Pid, from_names
from sitl.control.pid import integrated, pid, smoothed
from sitl.control.position import velocity_command
from sitl.control.reference import Trajectory, rest_at, sample
from sitl.control.velocity import specific_force
from sitl.frames import GRAVITY_M_S2, quaternion_from_yxz
from sitl.model.derivative import loads, total
from sitl.model.propulsion import rotor_speed
from sitl.model.rigid_body import State
from sitl.quaternion import about_x, about_z, multiply
from sitl.vehicle_spec import load_vehicle

SPEC = load_vehicle("yawsitter")
A = SPEC.airframe.airframe
GAINS = from_names(SPEC.gains)
WEIGHT = A.mass_kg * GRAVITY_M_S2


def test_gains_reach_the_loop_axis_and_term_that_their_name_says() -> None:
    numbered = from_names({name: float(k) for k, name in enumerate(GAIN_NAMES)})
    assert numbered.position.x == Pid(0.0, 1.0, 2.0)
    assert numbered.velocity.y == Pid(12.0, 13.0, 14.0)
    assert numbered.rate.z == Pid(33.0, 34.0, 35.0)


def test_a_pid_adds_its_three_terms() -> None:
    assert pid(Pid(2.0, 3.0, 5.0), 1.0, 10.0, 100.0) == 2.0 + 30.0 + 500.0


def test_an_integral_stops_growing_while_an_actuator_is_saturated_but_may_shrink() -> None:
    assert integrated(1.0, 0.5, 0.1, 10.0, held=False) == pytest.approx(1.05)
    assert integrated(1.0, 0.5, 0.1, 10.0, held=True) == 1.0
    assert integrated(1.0, -0.5, 0.1, 10.0, held=True) == pytest.approx(0.95)
    assert integrated(9.99, 0.5, 0.1, 10.0, held=False) == 10.0


def test_a_low_pass_settles_and_without_time_constant_passes_through() -> None:
    x = 0.0
    for _ in range(1000):
        x = smoothed(x, 1.0, 0.002, 0.1)
    assert x == pytest.approx(1.0, abs=1e-6)
    assert smoothed(0.0, 1.0, 0.002, 0.0) == 1.0


def test_the_velocity_command_keeps_to_its_limit_on_each_axis() -> None:
    zero = (0.0, 0.0, 0.0)
    v = velocity_command(GAINS.position, (1.0, -100.0, 0.0), zero, zero, zero, 5.0)
    assert v == pytest.approx((2.84, -5.0, 0.0))


def test_the_specific_force_keeps_its_tilt_and_its_lift() -> None:
    zero = (0.0, 0.0, 0.0)
    x, y, z = specific_force(GAINS.velocity, (100.0, 100.0, 0.0), zero, zero, zero, 9.0, math.radians(30.0))
    assert math.degrees(math.atan2(math.hypot(x, y), -z)) == pytest.approx(30.0)
    assert x == pytest.approx(y * 1.22 / 1.12)  # scaled back without turning
    _, _, falling = specific_force(GAINS.velocity, (0.0, 0.0, 100.0), zero, zero, zero, 9.0, 0.5)
    assert falling == pytest.approx(-0.2 * GRAVITY_M_S2)


def test_both_attitude_errors_agree_for_small_angles_near_hover() -> None:
    now = quaternion_from_yxz(0.0, math.radians(95.0), 0.0)
    target = quaternion_from_yxz(0.01, math.radians(96.0), -0.02)
    assert error_quaternion(now, target)[0] == pytest.approx(error_yxz(now, target), abs=1e-3)


def test_the_quaternion_error_is_finite_where_the_papers_angles_are_singular() -> None:
    now = attitude_of(math.radians(90.0), math.radians(99.0), 0.0)
    target = attitude_of(math.radians(95.0), math.radians(99.0), 0.02)
    assert np.degrees(np.linalg.norm(error_quaternion(now, target)[0])) == pytest.approx(5.1, abs=0.3)


def test_rates_of_a_turning_attitude_match_its_numerical_derivative() -> None:
    h = 1e-6
    at = (0.4, 1.7, 0.1)  # heading, pitch, lean
    rate = (0.3, -0.2, 0.5)
    one = attitude_of(*(a - h * r for a, r in zip(at, rate, strict=True)))
    two = attitude_of(*(a + h * r for a, r in zip(at, rate, strict=True)))
    turned = multiply((one[0], -one[1], -one[2], -one[3]), two)
    expected = [2.0 * x / (2.0 * h) for x in turned[1:]]
    assert rates_of(at[2], at[1], *rate) == pytest.approx(expected, abs=1e-6)


def flown_loads(x, u: float = 0.0, w: float = 0.0):
    state = State(
        0.0, 0.0, -100.0, u, 0.0, w, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        rotor_speed(A, x.thrust_left_N), rotor_speed(A, x.thrust_right_N), x.flap_left_rad, x.flap_right_rad,
    )  # fmt: skip
    return total(loads(A, SPEC.airframe.gear, state, (0.0, 0.0, 0.0)))


@pytest.mark.parametrize("moment", [(0.0, 0.0, 0.0), (0.05, 0.1, 0.1), (-0.1, -0.2, 0.3), (0.1, -0.1, -0.2)])
def test_the_plant_answers_an_allocation_with_the_force_and_moment_that_were_asked(moment) -> None:
    left = right = 5.4
    for _ in range(6):  # the slipstream follows the command
        x = allocate(A, 10.5, moment, flow_at(A, 1.0, 0.5, left, right), 0.0, 2.0)
        left, right = x.thrust_left_N, x.thrust_right_N
    force, given = flown_loads(x, 1.0, 0.5)
    assert force[0] == pytest.approx(10.5, abs=0.02)
    assert given == pytest.approx(moment, abs=3e-3)


def test_a_moment_beyond_the_actuators_is_cut_and_said() -> None:
    x = allocate(A, 10.5, (0.0, 5.0, 0.0), flow_at(A, 0.0, 0.0, 5.4, 5.4), 0.0, 2.0)
    assert max(abs(x.flap_left_rad), abs(x.flap_right_rad)) <= A.flap_max_rad + 1e-12
    assert (x.pitch_short, x.yaw_short) == (1.0, 0.0)
    y = allocate(A, 10.5, (0.0, 0.0, 9.0), flow_at(A, 0.0, 0.0, 5.4, 5.4), 0.0, 2.0)
    assert y.yaw_short == 1.0
    assert A.thrust_min_N <= y.thrust_right_N < y.thrust_left_N <= A.thrust_max_N


def test_pitch_is_served_before_roll() -> None:
    x = allocate(A, 10.5, (1.0, 0.2, 0.0), flow_at(A, 0.0, 0.0, 5.4, 5.4), 0.0, 2.0)
    _, moment = flown_loads(x)
    assert (x.roll_short, x.pitch_short) == (1.0, 0.0)
    assert moment[1] == pytest.approx(0.2, abs=0.01)
    assert 0.0 < moment[0] < 1.0


def test_roll_keeps_its_share_of_the_flaps_where_pitch_wants_them_all() -> None:
    x = allocate(A, 10.5, (0.2, 5.0, 0.0), flow_at(A, 0.0, 0.0, 5.4, 5.4), 0.0, 2.0)
    _, moment = flown_loads(x)
    assert (x.roll_short, x.pitch_short) == (0.0, 1.0)
    assert moment[0] == pytest.approx(0.2, abs=0.01)
    assert max(abs(x.flap_left_rad), abs(x.flap_right_rad)) == pytest.approx(A.flap_max_rad)


def test_an_error_is_braked_only_beyond_what_the_actuators_can_stop() -> None:
    assert braked(0.2, 5.0, 25.0) == 0.2
    assert braked(-3.0, 8.0, 25.0) == -braked(3.0, 8.0, 25.0)
    e, p, alpha = 2.0, 8.0, 25.0
    rate = p * braked(e, p, alpha)
    assert rate**2 / (2 * alpha) == pytest.approx(e, abs=0.5 * alpha / p**2 + 1e-9)  # it stops where it should


def test_the_nose_goes_first_and_the_turn_about_it_waits() -> None:
    now = quaternion_from_yxz(0.0, math.radians(95.0), 0.0)
    aside = multiply(multiply(now, about_z(math.radians(100.0))), about_x(1.0))
    (roll, pitch, yaw), nose = error_quaternion(now, aside)
    assert nose == pytest.approx(math.cos(math.radians(100.0)))
    assert roll == 0.0
    assert np.degrees((pitch, yaw)) == pytest.approx((0.0, 100.0), abs=1e-6)


def test_more_forward_force_leans_the_nose_forward() -> None:
    zero = (0.0, 0.0, 0.0)
    hover = invert(A, (0.0, 0.0, -WEIGHT), zero, 0.0, 1.6, WEIGHT, 20)
    forward = invert(A, (1.0, 0.0, -WEIGHT), zero, 0.0, 1.6, WEIGHT, 20)
    right = invert(A, (0.0, 1.0, -WEIGHT), zero, 0.0, 1.6, WEIGHT, 20)
    assert forward.pitch_rad < hover.pitch_rad
    assert right.lean_rad > 0.05
    assert forward.thrust_N > hover.thrust_N - 0.1


def test_a_trajectory_rests_before_its_start_and_after_its_end() -> None:
    c = np.zeros((2, 4, 6))
    c[0, 0, 1], c[1, 0, 0], c[1, 0, 1] = 1.0, 1.0, 2.0
    t = Trajectory(np.array([1.0, 2.0]), c, 3.0)
    assert sample(t, 0.5)[:4] == (0.0, 0.0, 0.0, 0.0)
    assert sample(t, 1.5)[0] == 0.5
    assert sample(t, 1.5)[3] == 1.0
    assert sample(t, 2.5)[0] == 2.0
    assert sample(t, 9.0)[0] == 3.0
    assert sample(t, 9.0)[3] == 0.0
    assert sample(rest_at(1.0, 2.0, 3.0, 4.0), 7.0)[:3] == (1.0, 2.0, 3.0)


def test_two_axes_brake_together_so_that_the_turn_keeps_its_direction() -> None:
    assert braked_together(0.02, 0.01, 8.0, 8.0, 25.0, 45.0) == 1.0  # small enough for both
    assert braked_together(0.0, 0.0, 8.0, 8.0, 25.0, 45.0) == 1.0
    alone = braked(2.0, 8.0, 25.0) / 2.0
    assert braked_together(2.0, 0.0, 8.0, 8.0, 25.0, 45.0) == pytest.approx(alone)
    # on the diagonal the weaker axis has 25 rad/s² for 1/√2 of the turn
    diagonal = braked(2.0 * math.sqrt(2.0), 8.0, 25.0 * math.sqrt(2.0)) / (2.0 * math.sqrt(2.0))
    assert braked_together(2.0, 2.0, 8.0, 8.0, 25.0, 45.0) == pytest.approx(diagonal)
