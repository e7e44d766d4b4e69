"""Offboard targets: their age, what they bind, and flights on them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onboard_flights import NAN, after, hovering, place, standing, stream, wait

from sitl.frames import heading
from sitl.onboard.modes import Landed, Mode, Verdict
from sitl.onboard.offboard import Offboard, OffboardTarget
from sitl.onboard.trajectory import at
from sitl.vehicle import Vehicle

HERE = OffboardTarget(None, position_N=(0.0, 0.0, -3.0))
NOTHING = (NAN, NAN, NAN)


def offboard() -> Offboard:
    return Offboard(standing().parameters, lambda point_N, what: "", 40.0, 12.0)


def in_offboard(first: OffboardTarget = HERE) -> Vehicle:
    vehicle = hovering()
    stream(vehicle, first, 1.2)
    assert vehicle.commander.set_mode(Mode.OFFBOARD).ok
    return vehicle


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        (OffboardTarget(None), "ignores everything"),
        (OffboardTarget(None, position_N=(math.inf, 0.0, 0.0)), "infinite"),
        (OffboardTarget(None, heading_rad=-math.inf, position_N=(0.0, 0.0, 0.0)), "infinite"),
        (OffboardTarget(None, velocity_N=(0.0, 1e7, 0.0)), "faster than sense"),
    ],
)
def test_a_target_without_sense_is_denied_and_the_old_one_stays(target: OffboardTarget, reason: str) -> None:
    o = offboard()
    o.submit(HERE, 0)
    outcome = o.submit(target, 20_000)
    assert outcome.verdict is Verdict.DENIED
    assert reason in outcome.reason
    assert (o.target, o.number) == (HERE, 1)


anything = st.one_of(st.floats(allow_nan=True, allow_infinity=True), st.just(NAN))
vectors = st.tuples(anything, anything, anything)


@settings(max_examples=200, deadline=None)
@given(st.one_of(st.none(), st.integers(-(2**40), 2**40)), vectors, vectors, vectors, anything, anything)
def test_no_target_whatever_its_numbers_raises_or_makes_a_reference_that_is_not_finite(
    stamp_us: int | None, p: tuple, v: tuple, a: tuple, course: float, rate: float
) -> None:
    o = OFFBOARD
    if o.submit(OffboardTarget(stamp_us, p, v, a, course, rate), 5_000_000).ok:
        path = o.trajectory(5_000_000, 0.3, (1.0, 2.0, -3.0))
        assert np.isfinite(path.coefficients).all()
        assert path.end_s >= 5.0
        assert set(o.follow()) <= {0.0, 1.0}


OFFBOARD = offboard()


def test_one_target_younger_than_the_loss_time_opens_offboard_and_silence_bars_it() -> None:
    o = offboard()
    assert o.lost(0)
    o.submit(HERE, 1_000_000)
    assert not o.lost(1_000_000)
    assert not o.lost(1_500_000)
    assert o.lost(1_500_001)


def test_a_target_is_carried_forward_by_its_age() -> None:
    o = offboard()
    o.submit(OffboardTarget(900_000, (1.0, 0.0, -3.0), (2.0, 0.0, 0.0), (1.0, 0.0, 0.0)), 1_000_000)
    r = at(o.trajectory(1_000_000, 0.0, (0.0, 0.0, 0.0)), 1.0)
    assert r.north_m == pytest.approx(1.0 + 0.2 + 0.005)
    assert r.v_north_m_s == pytest.approx(2.1)


sensible = st.one_of(st.floats(-50.0, 50.0), st.just(NAN))
moving = st.tuples(sensible, sensible, sensible)


@given(st.integers(700_000, 1_000_000), st.tuples(*(st.floats(-50.0, 50.0),) * 3), moving, moving, moving)
def test_a_heading_told_or_in_force_makes_the_same_course(
    stamp_us: int, p: tuple, v: tuple, before: tuple, a: tuple
) -> None:
    courses = []
    for told in (NAN, 0.7):
        o = offboard()
        o.submit(OffboardTarget(stamp_us - 50_000, p, v, before, told), 950_000)
        o.submit(OffboardTarget(stamp_us, p, v, a, told), 1_000_000)
        courses.append(o.trajectory(1_000_000, 0.7, (0.0, 0.0, 0.0)))
    one, other = courses
    assert np.array_equal(one.coefficients, other.coefficients)
    assert (one.start_s, one.end_s) == (other.start_s, other.end_s)


@pytest.mark.parametrize("stamp_us", [None, 60_000_000, 0])
def test_a_stamp_of_another_clock_means_now(stamp_us: int | None) -> None:
    o = offboard()
    o.submit(OffboardTarget(stamp_us, (1.0, 0.0, -3.0), (2.0, 0.0, 0.0)), 10_000_000)
    assert at(o.trajectory(10_000_000, 0.0, (0.0, 0.0, 0.0)), 10.0).north_m == pytest.approx(1.0)


def test_an_old_target_is_carried_a_fifth_of_a_second_and_still_moves() -> None:
    o = offboard()
    o.submit(OffboardTarget(9_400_000, (1.0, 0.0, -3.0), (2.0, 0.0, 0.0)), 10_000_000)
    r = at(o.trajectory(10_000_000, 0.0, (0.0, 0.0, 0.0)), 10.0)
    assert (r.north_m, r.v_north_m_s) == pytest.approx((1.4, 2.0))


def test_a_target_ahead_of_its_time_is_begun_now_on_its_own_course() -> None:
    o = offboard()
    o.submit(OffboardTarget(10_100_000, (1.0, 0.0, -3.0), (2.0, 0.0, 0.0)), 10_000_000)
    path = o.trajectory(10_000_000, 0.0, (0.0, 0.0, 0.0))
    assert at(path, 10.0).north_m == pytest.approx(0.8)
    assert at(path, 10.1).north_m == pytest.approx(1.0)


def test_targets_that_overtake_each_other_never_move_the_reference_back() -> None:
    o = offboard()
    o.submit(OffboardTarget(1_000_000, (1.0, 0.0, -3.0)), 1_010_000)
    assert o.submit(OffboardTarget(980_000, (0.5, 0.0, -3.0)), 1_015_000).ok
    assert o.target is not None
    assert o.target.position_N[0] == 1.0
    assert o.age_s(1_015_000) == 0.0  # the stream lives
    o.submit(OffboardTarget(1_020_000, (2.0, 0.0, -3.0)), 1_025_000)
    assert o.target.position_N[0] == 2.0


def test_a_clock_that_was_set_back_is_followed() -> None:
    o = offboard()
    o.submit(OffboardTarget(1_900_000, (1.0, 0.0, -3.0)), 1_000_000)
    o.submit(OffboardTarget(1_010_000, (2.0, 0.0, -3.0)), 1_020_000)
    assert o.target is not None
    assert o.target.position_N[0] == 2.0


def test_two_accelerations_tell_a_bounded_jerk() -> None:
    for change, jerk in ((0.1, 5.0), (10.0, 20.0)):
        o = offboard()
        o.submit(OffboardTarget(1_000_000, (0.0, 0.0, -3.0), acceleration_N=(0.0, 0.0, 0.0)), 1_000_000)
        o.submit(OffboardTarget(1_020_000, (0.0, 0.0, -3.0), acceleration_N=(change, 0.0, 0.0)), 1_020_000)
        assert at(o.trajectory(1_020_000, 0.0, (0.0, 0.0, 0.0)), 1.02).j_north_m_s3 == pytest.approx(jerk)


@pytest.mark.parametrize(
    ("target", "follow"),
    [
        (OffboardTarget(None, (1.0, 1.0, -1.0)), (1, 1, 1, 1, 1, 1)),
        (OffboardTarget(None, velocity_N=(1.0, 1.0, 0.0)), (0, 0, 0, 1, 1, 1)),
        (OffboardTarget(None, acceleration_N=(1.0, 0.0, 0.0)), (0, 0, 0, 0, 0, 0)),
        (OffboardTarget(None, (NAN, NAN, -2.0), (1.0, 0.0, NAN)), (0, 0, 1, 1, 1, 1)),
        (OffboardTarget(None, heading_rad=1.0), (1, 1, 1, 1, 1, 1)),
    ],
)
def test_an_axis_follows_what_the_target_binds_on_it(target: OffboardTarget, follow: tuple) -> None:
    o = offboard()
    o.submit(target, 0)
    assert o.follow() == follow


def test_a_target_of_a_heading_alone_holds_the_point_where_it_came_into_force() -> None:
    o = offboard()
    for k, here in enumerate(((1.0, 2.0, -3.0), (1.3, 2.0, -3.0), (1.6, 2.2, -3.0))):
        o.submit(OffboardTarget(None, heading_rad=1.0), 20_000 * k)
        r = at(o.trajectory(20_000 * k, 0.0, here), 0.02 * k)
        assert r[:3] == (1.0, 2.0, -3.0)
        assert r.heading_rad == 1.0
    o.enter()
    assert at(o.trajectory(40_000, 0.0, (5.0, 5.0, -5.0)), 0.04)[:3] == (5.0, 5.0, -5.0)


def test_a_heading_rate_without_heading_turns_at_that_rate_whatever_the_age_of_the_targets() -> None:
    o, course = offboard(), 0.0
    for k in range(50):
        now = 1_000_000 + 20_000 * k
        o.submit(OffboardTarget(now - 60_000, (0.0, 0.0, -3.0), heading_rate_rad_s=0.5), now)
        path = o.trajectory(now, course, (0.0, 0.0, -3.0))
        assert at(path, now * 1e-6).heading_rad == pytest.approx(course, abs=1e-9)
        course = at(path, now * 1e-6 + 0.02).heading_rad
    assert course == pytest.approx(0.5, rel=0.01)


# flights


def test_a_streamed_course_is_followed_closely() -> None:
    vehicle = in_offboard()

    def course(t: float) -> OffboardTarget:
        w = 0.5
        return OffboardTarget(
            round(start_us + t * 1e6),
            (2.0 * math.sin(w * t), 2.0 - 2.0 * math.cos(w * t), -3.0),
            (2.0 * w * math.cos(w * t), 2.0 * w * math.sin(w * t), 0.0),
            (-2.0 * w * w * math.sin(w * t), 2.0 * w * w * math.cos(w * t), 0.0),
        )

    start_us, errors = vehicle.now_us, []

    def watch(v: Vehicle) -> None:
        t = (v.now_us - start_us) * 1e-6
        if t > 5.0:
            errors.append(math.dist(place(v), course(t).position_N))

    stream(vehicle, course, 15.0, watch)
    assert max(errors) < 0.05


def test_between_two_targets_the_reference_goes_on_and_then_comes_to_rest_without_a_jump() -> None:
    vehicle, track = in_offboard(), []
    start_us = vehicle.now_us
    stream(
        vehicle,
        lambda t: OffboardTarget(round(start_us + t * 1e6), (0.5 * t, 0.0, -3.0), (0.5, 0.0, 0.0)),
        3.0,
    )
    after(vehicle, 0.48, lambda v: track.append(v.snapshot().reference))
    assert vehicle.commander.mode is Mode.OFFBOARD
    speeds = [r.v_north_m_s for r in track]
    assert speeds[5] == pytest.approx(0.5)
    assert np.abs(np.diff(speeds)).max() < 0.045  # 1.2 m/s² and a bit
    after(vehicle, 2.0, lambda v: track.append(v.snapshot().reference))
    assert vehicle.commander.mode is Mode.HOLD
    x = np.array(track)
    assert x[-1, 3] == pytest.approx(0.0, abs=1e-6)
    assert np.abs(np.diff(x[:, 0])).max() < 0.011
    assert (np.diff(x[:, 0]) >= -1e-9).all()


def test_a_pure_velocity_moves_and_hands_over_to_hold_where_the_vehicle_is_without_a_step() -> None:
    vehicle, track = in_offboard(), []
    stream(vehicle, OffboardTarget(None, velocity_N=(1.0, 0.0, 0.0)), 12.0)
    assert vehicle.snapshot().truth.v_north_m_s == pytest.approx(1.0, abs=0.1)
    assert place(vehicle)[2] == pytest.approx(-3.0, abs=0.3)
    begun = place(vehicle)[0]
    vehicle.commander.hold()
    after(vehicle, 4.0, lambda v: track.append(v.snapshot().reference))
    x = np.array(track)
    assert x[0, 0] - begun == pytest.approx(0.02, abs=0.005)
    assert x[0, 3] == pytest.approx(1.0, abs=0.01)
    assert np.abs(np.diff(x[:, 3])).max() < 0.025  # 1.2 m/s²
    assert np.abs(np.diff(x[:, 6])).max() < 0.085  # 4 m/s³
    assert vehicle.snapshot().truth.v_north_m_s == pytest.approx(0.0, abs=0.02)


def test_a_heading_alone_turns_on_the_spot() -> None:
    vehicle = in_offboard(OffboardTarget(None, heading_rad=0.0))
    stream(vehicle, lambda t: OffboardTarget(None, heading_rad=min(0.3 * t, 1.2)), 8.0)
    assert vehicle.commander.mode is Mode.OFFBOARD
    assert heading(*vehicle.snapshot().truth[6:10]) == pytest.approx(1.2, abs=0.02)
    assert place(vehicle) == pytest.approx((0.0, 0.0, -3.0), abs=0.05)


def test_a_stream_lifts_a_standing_vehicle_off_and_sets_it_down_armed() -> None:
    vehicle = standing()
    ground = OffboardTarget(None, (0.0, 0.0, 0.0))
    stream(vehicle, ground, 1.2)
    vehicle.commander.set_mode(Mode.OFFBOARD)
    vehicle.commander.arm()
    stream(vehicle, ground, 3.0)
    assert vehicle.commander.landed is Landed.ON_GROUND
    stream(vehicle, lambda t: OffboardTarget(None, (0.0, 0.0, -min(0.5 * t, 2.0))), 8.0)
    assert vehicle.commander.landed is Landed.IN_AIR
    assert place(vehicle)[2] == pytest.approx(-2.0, abs=0.1)
    stream(vehicle, lambda t: OffboardTarget(None, (0.0, 0.0, min(0.0, 0.4 * t - 2.0))), 12.0)
    assert (vehicle.commander.landed, vehicle.commander.armed) == (Landed.ON_GROUND, True)


def test_targets_that_stay_away_are_announced_and_acted_on() -> None:
    vehicle = in_offboard()
    wait(vehicle, lambda v: v.commander.mode is Mode.HOLD, 1.0)
    assert vehicle.commander.failsafe == "offboard targets lost"
    after(vehicle, 2.0)
    assert place(vehicle) == pytest.approx((0.0, 0.0, -3.0), abs=0.05)
