"""How much a sender may send."""

import pytest

from sitl.mavlink.limits import BYTES, UNLIMITED, Allowance, cost


def test_a_burst_is_taken_at_once_and_the_rate_from_there_on() -> None:
    allowance = Allowance(100.0, 20.0)
    assert sum(allowance.take(5.0) for _ in range(1000)) == 20
    assert sum(allowance.take(5.0 + k * 1e-3) for k in range(1, 1001)) == pytest.approx(100, abs=1)


def test_nothing_is_saved_up_beyond_the_burst_however_long_the_silence() -> None:
    allowance = Allowance(100.0, 20.0)
    allowance.take(0.0)
    assert sum(allowance.take(1e6) for _ in range(1000)) == 20


def test_what_was_charged_is_paid_back_before_more_is_taken() -> None:
    allowance = Allowance(100.0, 20.0)
    assert allowance.take(0.0)
    allowance.charge(119.0)
    assert not allowance.take(1.0)
    assert allowance.take(1.02)


def test_a_clock_that_stands_or_goes_back_gives_nothing() -> None:
    allowance = Allowance(100.0, 1.0)
    assert allowance.take(10.0)
    assert not allowance.take(10.0)
    assert not allowance.take(5.0)


def test_without_limits_everything_is_taken() -> None:
    allowance = Allowance(UNLIMITED.peer_Hz, UNLIMITED.peer_burst)
    assert all(allowance.take(0.0) for _ in range(10_000))


def test_a_datagram_costs_its_frames_and_long_rubbish_its_length() -> None:
    assert cost(b"x", 0) == 1
    assert cost(bytes(100), 3) == 3
    assert cost(bytes(60_000), 0) == 60_000 // BYTES
