"""When each stream of a peer is due."""

import pytest

from sitl.mavlink.codec import by_name
from sitl.mavlink.streams import BY_ID, DEFAULT, OFF, STREAMS, TOTAL_MAX_HZ, PortKind, Schedule, group_members

ATTITUDE, DEBUG_VECT = by_name("ATTITUDE").id, by_name("DEBUG_VECT").id
HIL_STATE = by_name("HIL_STATE_QUATERNION").id
(ATTITUDE_PLACE,) = BY_ID[ATTITUDE]


def count(schedule: Schedule, place: int, until_us: int, step_us: int) -> int:
    return sum(schedule.take(now).count(place) for now in range(step_us, until_us + 1, step_us))


@pytest.mark.parametrize("kind", PortKind)
def test_every_stream_flows_at_its_default_rate(kind: PortKind) -> None:
    schedule = Schedule(kind, 0)
    counts = dict.fromkeys(range(len(STREAMS)), 0)
    for now_us in range(0, 20_000_000, 1000):
        for place in schedule.take(now_us):
            counts[place] += 1
    for place, stream in enumerate(STREAMS):
        assert counts[place] == pytest.approx(stream.rates_Hz.get(kind, 0) * 20, abs=1), stream.definition.name


def test_nothing_is_due_before_its_time() -> None:
    schedule = Schedule(PortKind.ONBOARD, 0)
    schedule.take(0)
    assert schedule.next_us == 10_000
    assert schedule.take(9_999) == []
    assert schedule.take(10_000) == [ATTITUDE_PLACE]


def test_a_late_look_finds_each_stream_once_and_keeps_its_grid() -> None:
    schedule = Schedule(PortKind.ONBOARD, 0)
    schedule.take(0)
    assert schedule.take(995_000).count(ATTITUDE_PLACE) == 1
    assert schedule.take(999_999).count(ATTITUDE_PLACE) == 0
    assert schedule.take(1_000_000).count(ATTITUDE_PLACE) == 1


def test_a_rate_that_does_not_divide_the_step_is_met_on_average() -> None:
    schedule = Schedule(PortKind.ONBOARD, 0)
    schedule.set_interval(ATTITUDE, 30_000, 0)
    schedule.take(0)
    assert count(schedule, ATTITUDE_PLACE, 30_000_000, 20_000) == 1000


def test_an_interval_of_minus_one_is_off_and_zero_the_default() -> None:
    schedule = Schedule(PortKind.ONBOARD, 0)
    schedule.set_interval(ATTITUDE, OFF, 0)
    assert count(schedule, ATTITUDE_PLACE, 1_000_000, 5000) == 0
    assert schedule.interval(ATTITUDE) == OFF
    schedule.set_interval(ATTITUDE, DEFAULT, 1_000_000)
    assert schedule.interval(ATTITUDE) == 10_000


def test_the_default_of_an_optional_stream_is_off() -> None:
    schedule = Schedule(PortKind.GCS, 0)
    schedule.set_interval(HIL_STATE, 40_000, 0)
    assert schedule.interval(HIL_STATE) == 40_000
    schedule.set_interval(HIL_STATE, DEFAULT, 0)
    assert schedule.interval(HIL_STATE) == OFF


def test_one_interval_holds_for_all_three_names_of_debug_vect() -> None:
    schedule = Schedule(PortKind.ONBOARD, 0)
    schedule.set_interval(DEBUG_VECT, 50_000, 0)
    assert [schedule.intervals_us[place] for place in BY_ID[DEBUG_VECT]] == [50_000] * 3


def test_a_viewer_gets_the_true_state_and_no_other_stream() -> None:
    schedule = Schedule(PortKind.VIEWER, 0)
    assert {STREAMS[place].definition.id for place in schedule.take(0)} == {HIL_STATE}


def test_rates_that_would_swamp_the_loop_together_are_refused_and_change_nothing() -> None:
    schedule = Schedule(PortKind.ONBOARD, 0)
    granted = [schedule.set_interval(message_id, 1000, 0) for message_id in BY_ID]
    assert granted[0]
    assert not granted[-1]
    assert sum(1e6 / interval for interval in schedule.intervals_us if interval > 0) <= TOTAL_MAX_HZ
    assert schedule.set_interval(ATTITUDE, OFF, 0)


def test_a_message_that_cannot_be_streamed_is_refused() -> None:
    with pytest.raises(KeyError):
        Schedule(PortKind.ONBOARD, 0).set_interval(by_name("COMMAND_ACK").id, 1000, 0)


def test_the_group_of_all_holds_every_other_group() -> None:
    assert group_members(10) == {ATTITUDE, by_name("ATTITUDE_QUATERNION").id}
    assert group_members(10) < group_members(0)
    assert group_members(99) == set()
