"""The pacers, with wall time made up."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.daemon.clock import LAG_MAX_S, SLICE_US, TURN_S, Lateness, Pacing, Paused, Scaled, Unbounded

STEP_US = 2000


def test_real_time_grants_a_microsecond_for_a_microsecond() -> None:
    pacer = Scaled(1.0, now_us=5_000_000, wall_s=100.0)
    assert pacer.due_us(5_000_000, 100.1) == pytest.approx(5_100_000, abs=1)


def test_ten_times_real_time_grants_ten_for_one() -> None:
    pacer = Scaled(10.0, now_us=0, wall_s=100.0)
    assert pacer.due_us(0, 100.1) == pytest.approx(1_000_000, abs=10)


def test_simulation_follows_wall_time_whenever_the_turns_come() -> None:
    pacer, now_us = Scaled(1.0, 0, 0.0), 0
    for wall_s in (0.0041, 0.0083, 0.0190, 0.0202, 0.1):
        now_us = pacer.due_us(now_us, wall_s)
    assert now_us == pytest.approx(100_000, abs=1)


def test_turns_come_on_an_absolute_grid_so_that_lateness_does_not_add_up() -> None:
    pacer = Scaled(1.0, 0, wall_s=50.0)
    assert pacer.wake_s(50.0) == pytest.approx(50.0 + TURN_S)
    assert pacer.wake_s(50.0 + TURN_S + 0.0015) == pytest.approx(50.0 + 2 * TURN_S)
    assert pacer.wake_s(50.0 + 10 * TURN_S - 1e-9) == pytest.approx(50.0 + 11 * TURN_S)


def test_a_short_stall_is_caught_up() -> None:
    pacer = Scaled(1.0, 0, 0.0)
    assert pacer.due_us(0, 0.2) == pytest.approx(200_000, abs=1)
    assert pacer.slipped_s == 0.0


def test_a_long_stall_is_given_up_and_counted() -> None:
    pacer = Scaled(2.0, 0, 0.0)
    due = pacer.due_us(0, 10.0)
    assert due == pytest.approx(2.0 * LAG_MAX_S * 1e6)
    assert pacer.slipped_s == pytest.approx(10.0 - LAG_MAX_S)
    assert pacer.due_us(due, 10.1) - due == pytest.approx(200_000, abs=2)


def test_as_fast_as_possible_grants_a_slice_at_once() -> None:
    pacer = Unbounded()
    assert pacer.due_us(40_000, 1.0) == 40_000 + SLICE_US
    assert pacer.wake_s(1.0) <= 1.0


def test_a_paused_simulation_stands_still() -> None:
    pacer = Paused(7_000, STEP_US)
    assert pacer.due_us(7_000, 1e6) == 7_000
    assert not pacer.stepping(7_000)


@given(milliseconds=st.integers(1, 60_000), step_us=st.sampled_from([500, 2000, 4000, 20_000]))
def test_a_step_runs_the_whole_control_steps_that_cover_it(milliseconds: int, step_us: int) -> None:
    pacer, now_us = Paused(0, step_us), 0
    pacer.step(0, milliseconds)
    while pacer.stepping(now_us):
        due = pacer.due_us(now_us, 0.0)
        assert now_us < due <= now_us + SLICE_US
        now_us = due
    assert now_us % step_us == 0
    assert 0 <= now_us - milliseconds * 1000 < step_us


def test_a_change_of_speed_makes_no_jump() -> None:
    pacing = Pacing(STEP_US, 0, 0.0)
    now_us = pacing.due_us(0, 0.1)
    pacing.set(10.0, False, 0, now_us, 0.1)
    assert pacing.due_us(now_us, 0.1) == now_us
    assert pacing.due_us(now_us, 0.2) - now_us == pytest.approx(1_000_000, abs=10)


def test_the_same_settings_again_change_nothing() -> None:
    pacing = Pacing(STEP_US, 0, 0.0)
    pacing.set(1.0, False, 0, 0, 0.1)
    assert pacing.due_us(0, 0.2) == pytest.approx(200_000, abs=1)


def test_time_spent_paused_is_not_caught_up() -> None:
    pacing = Pacing(STEP_US, 0, 0.0)
    pacing.set(1.0, True, 0, 0, 0.0)
    assert pacing.due_us(0, 50.0) == 0
    pacing.set(1.0, False, 0, 0, 50.0)
    assert pacing.due_us(0, 50.1) == pytest.approx(100_000, abs=1)
    assert pacing.slipped_s == 0.0


def test_steps_run_only_while_paused() -> None:
    pacing = Pacing(STEP_US, 0, 0.0)
    pacing.set(1.0, False, 100, 0, 0.0)
    assert not pacing.stepping(0)
    pacing.set(1.0, True, 100, 0, 0.0)
    assert pacing.stepping(0)
    assert not pacing.stepping(100_000)


def test_a_pending_step_does_not_wait() -> None:
    pacing = Pacing(STEP_US, 0, 0.0)
    pacing.set(1.0, True, 100, 0, 5.0)
    assert pacing.wake_s(0, 5.0) == 5.0
    assert pacing.wake_s(100_000, 5.0) > 5.0


def test_slipped_time_is_kept_over_changes_of_speed() -> None:
    pacing = Pacing(STEP_US, 0, 0.0)
    now_us = pacing.due_us(0, 10.0)
    pacing.set(0.0, False, 0, now_us, 10.0)
    pacing.set(5.0, False, 0, now_us, 10.0)
    assert pacing.slipped_s == pytest.approx(10.0 - LAG_MAX_S)


def test_only_a_paced_run_has_deadlines() -> None:
    pacing = Pacing(STEP_US, 0, 0.0)
    assert pacing.has_deadlines
    pacing.set(0.0, False, 0, 0, 0.0)
    assert not pacing.has_deadlines
    pacing.set(0.0, True, 0, 0, 0.0)
    assert not pacing.has_deadlines


def test_a_turn_more_than_a_turn_late_is_an_overrun() -> None:
    lateness = Lateness()
    lateness.record(1.0, 1.0 + 0.9 * TURN_S)
    lateness.record(2.0, 2.0 + 1.5 * TURN_S)
    assert (lateness.turns, lateness.overruns) == (2, 1)
    assert lateness.worst_s == pytest.approx(1.5 * TURN_S)
