"""References: they hit their points at rest, and their derivatives are derivatives."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs_tools.reference import PEAK_ACCELERATION, PEAK_SPEED, ZERO, Circle, Reference, TimedPoint, Waypoints

RAMPED = Circle(radius_m=2, altitude_m=1, climb_s=5, lap_s=50, ramp_s=5, bearing_rad=math.pi)
CONSTANT = Circle(radius_m=2, altitude_m=1, climb_s=5, lap_s=50, bearing_rad=math.pi)
LEGS = Waypoints([TimedPoint(0, ZERO), TimedPoint(4, (1, -2, -3)), TimedPoint(10, (20, 5, -3)), TimedPoint(12, ZERO)])

coordinate = st.floats(-50, 50)
point = st.tuples(coordinate, coordinate, coordinate)


@given(st.lists(st.tuples(st.floats(0.5, 20), point), min_size=1, max_size=6))
def test_every_waypoint_is_hit_at_its_time_with_zero_velocity_and_acceleration(legs: list) -> None:
    points, t = [TimedPoint(0.0, ZERO)], 0.0
    for span, at in legs:
        t += span
        points.append(TimedPoint(t, at))
    reference = Waypoints(points)
    for waypoint in points:
        for side in (-1e-9, 0.0, 1e-9):
            position, velocity, acceleration = reference.at(waypoint.t_s + side)
            assert position == pytest.approx(waypoint.at_m, abs=1e-6)
            assert velocity == pytest.approx(ZERO, abs=1e-5)
            assert acceleration == pytest.approx(ZERO, abs=1e-3)


@pytest.mark.parametrize("reference", [LEGS, RAMPED, CONSTANT], ids=["waypoints", "ramped circle", "constant circle"])
@pytest.mark.parametrize("t", [0.7, 2.0, 3.9, 5.8, 7.3, 9.4, 11.1, 30.0, 51.0, 54.9])
def test_velocity_and_acceleration_are_the_derivatives_of_position(reference: Reference, t: float) -> None:
    h = 1e-4
    before, now, after = reference.at(t - h), reference.at(t), reference.at(t + h)
    for k in range(3):
        assert (after.position_m[k] - before.position_m[k]) / (2 * h) == pytest.approx(now.velocity_m_s[k], abs=1e-6)
        slope = (after.velocity_m_s[k] - before.velocity_m_s[k]) / (2 * h)
        assert slope == pytest.approx(now.acceleration_m_s2[k], abs=1e-6)


def test_a_rest_to_rest_leg_peaks_at_the_documented_speed_and_acceleration() -> None:
    leg = Waypoints([TimedPoint(0, ZERO), TimedPoint(10, (20, 0, 0))])
    speeds = [leg.at(k / 1000).velocity_m_s[0] for k in range(10001)]
    accelerations = [leg.at(k / 1000).acceleration_m_s2[0] for k in range(10001)]
    assert max(speeds) == pytest.approx(PEAK_SPEED * 2.0, rel=1e-9)
    assert max(accelerations) == pytest.approx(PEAK_ACCELERATION * 0.2, rel=1e-6)


def test_a_reference_rests_before_its_start_and_after_its_end() -> None:
    assert LEGS.at(-1.0) == (ZERO, ZERO, ZERO)
    assert LEGS.at(99.0) == (ZERO, ZERO, ZERO)
    position, velocity, acceleration = RAMPED.at(60.0)
    assert position == pytest.approx((0, 0, -1), abs=1e-9)
    assert velocity == pytest.approx(ZERO, abs=1e-12)
    assert acceleration == pytest.approx(ZERO, abs=1e-12)


def test_the_circle_keeps_its_radius_and_height_all_the_way_round() -> None:
    for circle in (RAMPED, CONSTANT):
        for k in range(501):
            north, east, down = circle.at(5 + k / 10).position_m
            assert math.hypot(north + 2, east) == pytest.approx(2)
            assert down == -1


def test_the_ramped_lap_joins_the_climb_and_the_stop_without_a_jump() -> None:
    for t in (5.0, 10.0, 50.0, 55.0):
        before, after = RAMPED.at(t - 1e-9), RAMPED.at(t + 1e-9)
        for a, b in zip(before, after, strict=True):
            assert a == pytest.approx(b, abs=1e-6)


def test_the_constant_lap_starts_and_stops_at_full_speed() -> None:
    speed = 2 * math.pi * 2 / 50
    assert CONSTANT.at(5.0).velocity_m_s == pytest.approx((0, speed, 0), abs=1e-12)
    assert math.hypot(*CONSTANT.at(55.0 - 1e-9).velocity_m_s) == pytest.approx(speed)
    assert CONSTANT.peak_speed_m_s == pytest.approx(speed)


def test_an_anticlockwise_lap_goes_the_other_way_round() -> None:
    west = Circle(radius_m=2, altitude_m=1, climb_s=5, lap_s=50, bearing_rad=math.pi, direction=-1)
    assert west.at(17.5).position_m == pytest.approx((-2, -2, -1))
    assert CONSTANT.at(17.5).position_m == pytest.approx((-2, 2, -1))
