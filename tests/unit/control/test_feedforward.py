"""What a reference needs, against its trims solved to the end."""

import numpy as np
import pytest

from sitl.control.feedforward import Course, invert, reference_needs
from sitl.control.reference import Trajectory, sample
from sitl.frames import GRAVITY_M_S2
from sitl.vehicle_spec import load_vehicle

A = load_vehicle("yawsitter").airframe.airframe
WEIGHT = A.mass_kg * GRAVITY_M_S2
ZERO = (0.0, 0.0, 0.0)
LOOK_S, STEP_S = 0.02, 0.002
# 20 m to the north and 10 m up in ten seconds, minimum jerk
MOVE = np.zeros((1, 4, 6))
MOVE[0, 0, 3:] = 20.0 * np.array((10.0, -15.0, 6.0)) / 10.0 ** np.arange(3, 6)
MOVE[0, 2, 3:] = -0.5 * MOVE[0, 0, 3:]
TRAJECTORY = Trajectory(np.zeros(1), MOVE, 10.0)


def pitch_at(t_s: float) -> float:
    """Of the trim that the move needs [rad]."""
    r = sample(TRAJECTORY, t_s)
    force = (A.mass_kg * r.a_north_m_s2, 0.0, A.mass_kg * r.a_down_m_s2 - WEIGHT)
    return invert(A, force, (r.v_north_m_s, 0.0, r.v_down_m_s), 0.0, 1.7, WEIGHT, 60).pitch_rad


def test_carried_on_from_step_to_step_attitude_and_rates_are_those_of_the_trims_solved_to_the_end() -> None:
    hover = invert(A, (0.0, 0.0, -WEIGHT), ZERO, 0.0, 1.7, WEIGHT, 60)
    course = Course(hover, hover, hover)
    for k in range(2001):
        t_s = k * STEP_S
        course, rates, _ = reference_needs(A, sample(TRAJECTORY, t_s), course, True)
        if k % 100 == 0 and k > 0:
            before, now, after = (pitch_at(t_s + d) for d in (-LOOK_S, 0.0, LOOK_S))
            assert course.now.pitch_rad == pytest.approx(now, abs=1e-4)
            assert rates == pytest.approx((0.0, (after - before) / (2.0 * LOOK_S), 0.0), abs=2e-4)


def test_a_reference_that_jumps_is_caught_up_with_in_a_hundredth_of_a_second() -> None:
    rest, t_s = sample(TRAJECTORY, -1.0), 4.0
    hover = invert(A, (0.0, 0.0, -WEIGHT), ZERO, 0.0, 1.7, WEIGHT, 60)
    course, _, _ = reference_needs(A, rest, Course(hover, hover, hover), True)
    for _ in range(5):
        course, rates, _ = reference_needs(A, sample(TRAJECTORY, t_s), course, True)
    before, now, after = (pitch_at(t_s + d) for d in (-LOOK_S, 0.0, LOOK_S))
    assert course.now.pitch_rad == pytest.approx(now, abs=1e-3)
    assert rates[1] == pytest.approx((after - before) / (2.0 * LOOK_S), abs=1e-2)
