"""Every convention of docs/conventions.md, executed."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl import frames, quaternion

ANGLE = st.floats(-3.1, 3.1)
TILT = st.floats(-1.5, 1.5)


def matrix(q: tuple[float, float, float, float]) -> np.ndarray:
    return np.array([quaternion.rotate(q, tuple(e)) for e in np.eye(3)]).T


def rot(axis: str, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


@given(TILT, ANGLE, ANGLE)
def test_the_papers_angles_are_y_then_x_then_z(phi: float, theta: float, psi: float) -> None:
    q = frames.quaternion_from_yxz(phi, theta, psi)
    assert matrix(q) == pytest.approx(rot("y", theta) @ rot("x", phi) @ rot("z", psi), abs=1e-12)


@given(TILT, ANGLE, ANGLE)
def test_the_papers_angles_survive_the_round_trip(phi: float, theta: float, psi: float) -> None:
    q = frames.quaternion_from_yxz(phi, theta, psi)
    assert frames.quaternion_to_yxz(*q) == pytest.approx((phi, theta, psi), abs=1e-6)


def test_in_hover_the_nose_points_up_and_the_papers_pitch_is_90_degrees() -> None:
    q = frames.standing(0.0, math.pi / 2)
    assert quaternion.rotate(q, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, -1.0), abs=1e-12)
    assert np.degrees(frames.quaternion_to_yxz(*q)) == pytest.approx((0.0, 90.0, 0.0), abs=1e-9)


def test_the_wire_shows_upright_hover_as_level() -> None:
    q = frames.standing(0.7, math.pi / 2)
    assert frames.euler_321(*frames.wire_quaternion(*q)) == pytest.approx((0.0, 0.0, 0.7), abs=1e-12)


def test_hovers_trim_pitch_of_99_degrees_shows_as_9_degrees_nose_up_on_the_wire() -> None:
    q = frames.standing(0.0, math.radians(99.0))
    assert math.degrees(frames.euler_321(*frames.wire_quaternion(*q))[1]) == pytest.approx(9.0)


def test_heading_is_where_the_belly_faces() -> None:
    q = frames.standing(math.radians(90.0), math.pi / 2)
    belly_N = quaternion.rotate(q, (0.0, 0.0, 1.0))
    assert belly_N == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    assert math.degrees(frames.heading(*q)) == pytest.approx(90.0)


def test_the_papers_yaw_is_mavlinks_roll_and_its_roll_is_minus_mavlinks_yaw() -> None:
    leaned = frames.quaternion_from_yxz(0.0, math.pi / 2, 0.1)
    turned = frames.quaternion_from_yxz(0.1, math.pi / 2, 0.0)
    assert frames.euler_321(*frames.wire_quaternion(*leaned)) == pytest.approx((0.1, 0.0, 0.0), abs=1e-12)
    assert frames.euler_321(*frames.wire_quaternion(*turned)) == pytest.approx((0.0, 0.0, -0.1), abs=1e-12)


def test_wire_rates_follow_the_same_exchange_of_axes() -> None:
    assert frames.wire_rates(1.0, 2.0, 3.0) == (3.0, 2.0, -1.0)


@given(ANGLE, TILT, ANGLE)
def test_wire_and_body_quaternions_are_inverse(roll: float, pitch: float, yaw: float) -> None:
    q = frames.quaternion_from_321(roll, pitch, yaw)
    assert frames.body_quaternion(*frames.wire_quaternion(*q)) == pytest.approx(q, abs=1e-12)
    assert frames.euler_321(*q) == pytest.approx((roll, pitch, yaw), abs=1e-6)


@given(st.floats(-1e3, 1e3))
def test_wrapped_angles_lie_within_a_half_turn_and_mean_the_same(angle: float) -> None:
    wrapped = frames.wrap_pi(angle)
    assert -math.pi <= wrapped < math.pi + 1e-9
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


def test_rotating_back_undoes_rotating() -> None:
    q = frames.quaternion_from_321(0.3, -0.4, 2.0)
    v = (1.0, -2.0, 3.0)
    assert quaternion.rotate_back(q, quaternion.rotate(q, v)) == pytest.approx(v)
    assert quaternion.multiply(q, quaternion.conjugate(q)) == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-12)
