"""The small pictures of the dashboard, and the keys that it takes."""

import math

import pytest

from gcs_tools.watch import gauges, track_map
from gcs_tools.watch.keys import decode
from gcs_tools.watch.traces import Trace
from gcs_tools.watch.traffic import Traffic
from sitl.mavlink import codec

NAN = math.nan


@pytest.mark.parametrize(
    ("share", "drawn"), [(0.0, "    "), (0.5, "██  "), (1.0, "████"), (7.0, "████"), (-1.0, "    "), (0.28125, "█▏  ")]
)
def test_a_bar_fills_from_the_left(share: float, drawn: str) -> None:
    assert gauges.bar(share, 4) == drawn


@pytest.mark.parametrize(
    ("share", "drawn"),
    [
        (0.0, "   ┃   "),
        (1.0, "   ┃███"),
        (-9.0, "███┃   "),
        (0.5, "   ┃█▌ "),
        (-0.5, " ▐█┃   "),
        (NAN, "   ┃   "),
    ],
)
def test_a_balance_fills_from_its_zero_mark(share: float, drawn: str) -> None:
    assert gauges.balance(share, 7) == drawn


def test_a_sparkline_has_a_column_a_value_and_a_gap_where_nothing_was_heard() -> None:
    assert gauges.sparkline([0.0, 4.0, None, 8.0], 1, 0.0, 8.0) == ["▁▄ █"]
    assert gauges.sparkline([0.0, 4.0, None, 8.0], 2, 0.0, 8.0) == ["   █", "▁█ █"]


def test_a_trace_keeps_a_value_a_second() -> None:
    worst, newest = Trace(max), Trace()
    for value, wall_s in ((3.0, 10.0), (1.0, 10.9), (5.0, 12.1)):
        worst.put(value, wall_s)
        newest.put(value, wall_s)
    assert worst.last(4, 12.5) == [None, 3.0, None, 5.0]
    assert newest.last(4, 12.5) == [None, 1.0, None, 5.0]
    assert newest.last(3, 14.0) == [5.0, None, None]


def test_a_map_has_north_up_and_east_to_the_right() -> None:
    drawn = track_map.draw([(0.0, 0.0), (10.0, 0.0)], [("⌂", (0.0, 0.0)), ("↑", (10.0, 5.0))], 20, 10)
    at = {mark: place for place, mark in drawn.marks.items()}
    assert at["↑"][0] < at["⌂"][0]
    assert at["↑"][1] > at["⌂"][1]
    assert drawn.metres_a_cell == pytest.approx(0.8)


def test_the_end_of_a_scale_is_a_round_number() -> None:
    assert [gauges.nice(x) for x in (0.011, 0.9, 10.2, 47.0, 0.0)] == pytest.approx([0.012, 1.0, 12.0, 50.0, 1.0])


def test_a_counter_that_has_gone_round_is_not_taken_for_a_repetition() -> None:
    traffic, encoder, parser = Traffic(), codec.Encoder(1, 1), codec.Parser()
    for k in range(700):
        always_alike, never = codec.message("EXTENDED_SYS_STATE"), codec.message("SYSTEM_TIME", time_boot_ms=k)
        for frame in parser.feed(encoder.encode(never if k % 4 else always_alike)):
            traffic.hear(frame, k * 0.01)
    assert traffic.loss(7.0) == 0.0


def test_keys_are_read_however_the_terminal_sends_them() -> None:
    assert decode("q") == ["quit"]
    assert decode("\x1b[A\x1bOB\x1b[C3 ") == ["previous", "next", "next", "3", "pause"]
    assert decode("\x1b[5~x0é") == []


def test_what_rounds_to_nothing_has_no_sign() -> None:
    assert [gauges.fixed(x, 2) for x in (-0.001, 0.0, -0.006, 1.5)] == ["0.00", "0.00", "-0.01", "1.50"]
    assert gauges.fixed(2.0, 1, signed=True) == "+2.0"
    assert gauges.fixed(-3.4e38, 2) == "-3.4e+38"
