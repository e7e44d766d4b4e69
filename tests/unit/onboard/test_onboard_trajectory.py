"""Trajectories: continuous, within limits, and the same to the onboard logic as to the cascade."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sitl.control.reference import Trajectory, sample
from sitl.onboard.circles import Circle, turns_at_rest
from sitl.onboard.trajectory import Limits, Motion, at, heading_to, plan, stopping, to_point

LIMITS = Limits(3.0, 2.0, 1.0, 1.2, 2.0, 1.0, 4.0, math.radians(45.0))
REST = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
STILL = (0.0, 0.0, 0.0)


def within(limit: float) -> st.SearchStrategy[float]:
    return st.floats(-limit, limit).map(lambda x: round(x, 3))


def vectors(*limits: float) -> st.SearchStrategy[tuple[float, float, float]]:
    return st.tuples(*(within(limit) for limit in limits))


motions = st.builds(
    Motion, vectors(5.0, 5.0, 5.0), vectors(2.0, 2.0, 1.0), vectors(0.8, 0.8, 0.8), within(7.0), within(0.7)
)
courses = st.one_of(st.none(), within(7.0))


def sampled(path: Trajectory, count: int = 400) -> np.ndarray:
    times = np.linspace(path.start_s[0], path.end_s - 1e-9, count)
    return np.array([at(path, t) for t in times])


def peaks(path: Trajectory) -> dict[str, float]:
    x = sampled(path)
    return {
        "speed": float(np.hypot(x[:, 3], x[:, 4]).max()),
        "climb": float(-x[:, 5].min()),
        "descent": float(x[:, 5].max()),
        "acceleration": float(np.hypot(x[:, 6], x[:, 7]).max()),
        "upward": float(-x[:, 8].min()),
        "downward": float(x[:, 8].max()),
        "jerk": float(max(np.hypot(x[:, 9], x[:, 10]).max(), abs(x[:, 11]).max())),
        "turn": float(abs(x[:, 13]).max()),
    }


def assert_within(path: Trajectory, start: Motion, arrival: tuple[float, float, float] = STILL) -> None:
    v, a, m, found = start.velocity_N, start.acceleration_N, LIMITS, peaks(path)
    gained = [0.5 * x * x / m.jerk_m_s3 for x in (math.hypot(*a[:2]), a[2])]  # while the start's acceleration ends
    bounds = {
        "speed": max(m.speed_m_s, math.hypot(*v[:2]), math.hypot(*arrival[:2])) + gained[0],
        "climb": max(m.climb_m_s, -v[2], -arrival[2]) + gained[1],
        "descent": max(m.descent_m_s, v[2], arrival[2]) + gained[1],
        "acceleration": max(m.acceleration_m_s2, math.hypot(*a[:2])),
        "upward": max(m.climb_m_s2, -a[2]),
        "downward": max(m.descent_m_s2, a[2]),
        "jerk": m.jerk_m_s3,
        "turn": max(m.heading_rad_s, abs(start.heading_rate_rad_s)),
    }
    over = {name: (found[name], bounds[name]) for name in bounds if found[name] > 1.04 * bounds[name] + 1e-6}
    assert not over


def assert_continuous(path: Trajectory) -> None:
    """Position, velocity, acceleration and heading agree on both sides of every joint."""
    for joint in path.start_s[1:]:
        before, behind = at(path, joint - 1e-9), at(path, joint + 1e-9)
        assert before[:9] == pytest.approx(behind[:9], abs=1e-5)
        assert before[12:] == pytest.approx(behind[12:], abs=1e-5)


def assert_starts_as(path: Trajectory, start: Motion) -> None:
    r = at(path, path.start_s[0])
    assert r[0:3] == pytest.approx(start.position_N, abs=1e-9)
    assert r[3:6] == pytest.approx(start.velocity_N, abs=2e-3)
    assert r.heading_rad == pytest.approx(start.heading_rad)
    assert r.heading_rate_rad_s == pytest.approx(start.heading_rate_rad_s, abs=2e-3)


@settings(max_examples=200, deadline=None)
@example(Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.001), (0.0, 0.0, 0.0), 0.0), (0.0, 0.0, 0.0), None)
@given(motions, vectors(30.0, 30.0, 20.0), courses)
def test_a_flight_from_any_motion_keeps_to_the_limits_and_ends_at_its_point(
    start: Motion, target: tuple[float, float, float], course: float | None
) -> None:
    path = to_point(10.0, start, target, course, LIMITS)
    assert_starts_as(path, start)
    assert_continuous(path)
    assert_within(path, start)
    end = at(path, path.end_s - 1e-6)
    assert end[:3] == pytest.approx(target, abs=1e-4)
    assert end[3:9] == pytest.approx((0.0,) * 6, abs=1e-3)
    if course is not None:
        assert math.cos(end.heading_rad - course) == pytest.approx(1.0, abs=1e-6)


@settings(max_examples=200, deadline=None)
@given(motions)
def test_a_stop_from_any_motion_keeps_to_the_limits_and_goes_ahead(start: Motion) -> None:
    path = stopping(10.0, start, LIMITS)
    assert_starts_as(path, start)
    assert_within(path, start)
    assert at(path, path.end_s - 1e-6)[3:9] == pytest.approx((0.0,) * 6, abs=1e-3)


@settings(max_examples=100, deadline=None)
@given(motions, vectors(30.0, 30.0, 20.0), vectors(2.0, 1.0, 0.9))
def test_a_point_is_passed_within_the_limits(
    start: Motion, target: tuple[float, float, float], arrival: tuple[float, float, float]
) -> None:
    path = to_point(10.0, start, target, None, LIMITS, arrival)
    assert_continuous(path)
    assert_within(path, start, arrival)


@settings(max_examples=100, deadline=None)
@given(motions, vectors(30.0, 30.0, 20.0), courses, st.floats(-0.1, 1.2))
def test_the_onboard_logic_and_the_cascade_see_the_same_reference(
    start: Motion, target: tuple[float, float, float], course: float | None, share: float
) -> None:
    path = to_point(10.0, start, target, course, LIMITS)
    t = 10.0 + share * (path.end_s - 10.0)
    assert tuple(at(path, t)) == pytest.approx(tuple(sample(path, t)), abs=1e-9)


def test_a_circle_of_many_pieces_reads_the_same_to_the_cascade() -> None:
    path = turns_at_rest(1.0, Circle((0.0, 0.0, -3.0), 2.0), 0.3, 3.0, 0.0, LIMITS)
    for t in (0.0, 1.0, float(path.start_s[7]), 17.123, path.end_s, path.end_s + 1.0):
        assert tuple(at(path, t)) == pytest.approx(tuple(sample(path, t)), abs=1e-9)


def test_from_rest_the_way_is_straight_and_as_quick_as_the_tightest_limit_allows() -> None:
    path = to_point(0.0, REST, (30.0, 10.0, -5.0), 1.0, LIMITS)
    x = sampled(path)
    assert x[:, 1] == pytest.approx(x[:, 0] / 3.0, abs=1e-9)
    assert x[:, 2] == pytest.approx(-x[:, 0] / 6.0, abs=1e-9)
    assert peaks(path)["speed"] == pytest.approx(3.0, rel=0.01)
    assert path.start_s.size == 1


def test_a_moving_start_does_not_swing_out_while_a_long_climb_goes_on() -> None:
    start = REST._replace(velocity_N=(3.0, 0.0, 0.0))
    path = plan(0.0, start, LIMITS, level_N=(6.0, 0.0), down_m=-60.0)
    assert sampled(path)[:, 0].max() < 6.5
    assert path.end_s > 40.0


def test_a_turn_that_takes_longer_than_the_way_goes_on_alone() -> None:
    path = to_point(0.0, REST, (0.1, 0.0, 0.0), 3.0, LIMITS)
    halfway = at(path, 0.6 * path.end_s)
    assert halfway[3:6] == STILL
    assert halfway.heading_rate_rad_s > 0.1
    assert peaks(path)["turn"] <= LIMITS.heading_rad_s * 1.01


def test_a_heading_that_is_turning_stops_ahead_and_never_swings_back() -> None:
    path = stopping(0.0, REST._replace(heading_rate_rad_s=0.7), LIMITS)
    x = sampled(path)
    assert (np.diff(x[:, 12]) >= -1e-12).all()
    assert x[-1, 12] > 0.1
    assert x[-1, 13] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("start", "target", "reached"), [(3.0, -3.0, -3.0 + 2 * math.pi), (0.1, 6.2, 6.2 - 2 * math.pi)]
)
def test_a_heading_is_reached_the_short_way_round(start: float, target: float, reached: float) -> None:
    assert heading_to(start, target) == pytest.approx(reached)


def test_headings_of_many_turns_are_wrapped_to_the_short_way() -> None:
    assert abs(heading_to(20.0, -20.0) - 20.0) <= math.pi


def test_a_circle_keeps_its_radius_and_the_limits() -> None:
    path = turns_at_rest(0.0, Circle((1.0, 2.0, -3.0), 2.0), 0.5, -2.0, 0.3, LIMITS)
    x, found = sampled(path, 2000), peaks(path)
    assert np.hypot(x[:, 0] - 1.0, x[:, 1] - 2.0) == pytest.approx(2.0, abs=1e-4)
    assert found["speed"] <= 3.0
    assert 1.1 < found["acceleration"] <= 1.21
    assert found["jerk"] <= 4.1
    assert_continuous(path)
    turned = np.unwrap(np.arctan2(x[:, 1] - 2.0, x[:, 0] - 1.0))
    assert turned[-1] - turned[0] == pytest.approx(-4.0 * math.pi, abs=1e-3)


def test_after_its_end_a_trajectory_rests_where_it_is() -> None:
    path = to_point(0.0, REST, (1.0, 2.0, -3.0), None, LIMITS)
    assert tuple(at(path, path.end_s + 5.0)) == pytest.approx((1.0, 2.0, -3.0, *(0.0,) * 11))
