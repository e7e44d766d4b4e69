"""The navigation filter against motions and errors that are known."""

import math

import numpy as np
import pytest

from sitl.estimation.alignment import aligned, attitude_from, starting
from sitl.estimation.corrections import at_rest, with_baro, with_field, with_gnss
from sitl.estimation.error_state import ERRORS, Estimate, Tuning, nav_of, predicted, spread
from sitl.frames import GRAVITY_M_S2, standing
from sitl.quaternion import about_z, multiply, rotate, rotate_back

TUNING = Tuning(1e-4, 1e-3, 4e-5, 1e-4, 0.01, 0.015, 0.05, 0.1, 0.03)
ZERO = (0.0, 0.0, 0.0)
UPRIGHT = standing(0.0, math.pi / 2)
AT_REST = rotate_back(UPRIGHT, (0.0, 0.0, -GRAVITY_M_S2))
DT = 0.002


def hovering(q=UPRIGHT) -> Estimate:
    return starting(ZERO, ZERO, q, ZERO, rotate_back(q, (0.0, 0.0, -GRAVITY_M_S2)))


def turned_by(q, other) -> float:
    """Angle [rad] between two attitudes."""
    return 2.0 * math.acos(min(1.0, abs(sum(a * b for a, b in zip(q, other, strict=True)))))


def rotation(q) -> np.ndarray:
    """R_NB of a quaternion."""
    return np.array([rotate(q, tuple(axis)) for axis in np.eye(3)]).T


def sigma(e: Estimate) -> np.ndarray:
    return np.sqrt(np.diag(e.covariance))


def test_gravity_and_the_field_tell_any_attitude() -> None:
    for q in np.random.default_rng(1).standard_normal((500, 4)):
        q = tuple(q / np.linalg.norm(q))
        found = attitude_from(rotate_back(q, (0.0, 0.0, -9.8)), rotate_back(q, (0.3, 0.0, 0.9)))
        assert turned_by(found, q) < 1e-6


def test_a_constant_turn_and_acceleration_are_integrated_as_their_closed_form() -> None:
    rate, acceleration = (0.3, 0.0, 0.0), (1.0, -2.0, 0.5)
    q, e = UPRIGHT, hovering()
    e = e._replace(rates_B=rate, force_B=rotate_back(q, np.subtract(acceleration, (0.0, 0.0, GRAVITY_M_S2))))
    for _ in range(1000):
        q = multiply(q, (math.cos(0.15 * DT), math.sin(0.15 * DT), 0.0, 0.0))
        e = predicted(e, rate, rotate_back(q, np.subtract(acceleration, (0.0, 0.0, GRAVITY_M_S2))), DT)
    assert turned_by(e.q_NB, q) < 1e-7
    assert e.velocity_N == pytest.approx(np.multiply(2.0, acceleration), abs=1e-9)
    assert e.position_N == pytest.approx(np.multiply(2.0, acceleration), abs=1e-9)  # a t²/2 with t = 2 s


def test_the_covariance_is_that_of_many_flights_with_the_noise_it_expects() -> None:
    rng, ends = np.random.default_rng(3), []
    for _ in range(150):
        e = hovering()
        for noise in rng.standard_normal((500, 6)):
            gyro = noise[:3] * TUNING.gyro_noise_rad_s_rtHz / math.sqrt(DT)
            accel = AT_REST + noise[3:] * TUNING.accel_noise_m_s2_rtHz / math.sqrt(DT)
            e = predicted(e, tuple(gyro), tuple(accel), DT)
        ends.append((*e.position_N, *e.velocity_N))
    e = hovering()
    e.covariance[:] = 0.0
    for _ in range(100):
        spread(e, TUNING, 0.01)
    assert np.std(ends, axis=0) == pytest.approx(sigma(e)[:6], rel=0.25)


def test_a_fix_draws_the_position_to_it_and_makes_it_more_certain() -> None:
    e = hovering()
    before = sigma(e)
    for _ in range(50):
        e = with_gnss(e, TUNING, (0.03, -0.02, 0.01), ZERO)
    assert e.position_N == pytest.approx((0.03, -0.02, 0.01), abs=1e-3)
    assert (sigma(e)[:6] < 0.4 * before[:6]).all()


def test_one_wild_fix_moves_it_by_little_and_a_lasting_one_wins() -> None:
    e = hovering()
    for _ in range(50):
        e = with_gnss(e, TUNING, ZERO, ZERO)
    e = with_gnss(e, TUNING, (50.0, 0.0, 0.0), ZERO)
    assert abs(e.position_N[0]) < 0.02
    for _ in range(600):
        e = predicted(e, ZERO, AT_REST, DT * 50)
        spread(e, TUNING, DT * 50)
        e = with_gnss(e, TUNING, (50.0, 0.0, 0.0), ZERO)
        if abs(e.position_N[0] - 50.0) < 0.5:
            break
    assert e.position_N[0] == pytest.approx(50.0, abs=0.5)


@pytest.mark.parametrize("degrees", [-170.0, -80.0, -1.0, 20.0, 179.0])
def test_the_field_turns_a_heading_that_is_uncertain_and_leaves_a_tilt_that_is_not(degrees: float) -> None:
    truth = standing(math.radians(degrees), 1.7)
    e = hovering(multiply(about_z(math.radians(-3.0)), truth))
    R = rotation(e.q_NB)
    e.covariance[6:9, 6:9] = R.T @ np.diag((0.001**2, 0.001**2, 0.1**2)) @ R
    field = rotate_back(truth, (0.33, 0.0, 0.94))
    for _ in range(60):
        e = with_field(e, TUNING, field)
    assert turned_by(e.q_NB, truth) < math.radians(0.2)
    assert rotate(e.q_NB, (1.0, 0.0, 0.0))[2] == pytest.approx(rotate(truth, (1.0, 0.0, 0.0))[2], abs=1e-3)


def test_in_a_steep_field_a_tilt_is_not_taken_for_a_turn() -> None:
    tilted = multiply((math.cos(0.01), math.sin(0.01), 0.0, 0.0), UPRIGHT)  # by 0.02 rad about the north axis
    e = hovering(tilted)
    R = rotation(tilted)
    e.covariance[6:9, 6:9] = R.T @ np.diag((0.03**2, 0.001**2, 0.001**2)) @ R
    field = rotate_back(UPRIGHT, (0.33, 0.0, 0.94))
    for _ in range(300):
        e = with_field(e, TUNING, field)
    assert turned_by(e.q_NB, UPRIGHT) < 0.003


def test_the_barometers_offset_is_learned_from_the_satellites_and_holds_without_them() -> None:
    e = hovering()
    for _ in range(300):
        e = predicted(e, ZERO, AT_REST, 0.04)
        spread(e, TUNING, 0.04)
        e = with_baro(with_gnss(e, TUNING, ZERO, ZERO), TUNING, 1.5)
    assert e.baro_offset_m == pytest.approx(1.5, abs=0.1)
    for _ in range(200):
        e = predicted(e, ZERO, AT_REST, 0.04)
        spread(e, TUNING, 0.04)
        e = with_baro(e, TUNING, 1.5)
    assert e.position_N[2] == pytest.approx(0.0, abs=0.1)


def test_standing_shows_the_gyros_bias() -> None:
    bias, e = (0.008, -0.005, 0.003), aligned(AT_REST, rotate_back(UPRIGHT, (0.3, 0.0, 0.9)))
    for k in range(1000):
        e = predicted(e, bias, AT_REST, DT)
        if k % 5 == 0:
            spread(e, TUNING, 0.01)
            e = at_rest(e, TUNING, DT)
    assert e.gyro_bias == pytest.approx(bias, abs=2e-4)
    assert turned_by(e.q_NB, UPRIGHT) < 0.01
    assert nav_of(e)[10:] == pytest.approx(ZERO, abs=2e-4)


def test_the_covariance_stays_symmetric_and_positive() -> None:
    rng, e = np.random.default_rng(4), hovering()
    for k, noise in enumerate(rng.standard_normal((400, 6))):
        e = predicted(e, tuple(0.5 * noise[:3]), tuple(AT_REST + noise[3:]), 0.01)
        spread(e, TUNING, 0.01)
        if k % 10 == 0:
            e = with_gnss(e, TUNING, tuple(0.02 * noise[:3]), tuple(0.1 * noise[3:]))
            e = with_field(e, TUNING, (0.3, 0.01 * noise[0], 0.9))
    P = e.covariance
    assert P.shape == (ERRORS, ERRORS)
    assert pytest.approx(P.T, abs=1e-15) == P
    assert np.linalg.eigvalsh(P).min() > 0.0
    assert math.hypot(*e.q_NB) == pytest.approx(1.0)
