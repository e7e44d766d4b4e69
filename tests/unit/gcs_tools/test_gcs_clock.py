"""The vehicle's time, told from what arrives."""

import random

import pytest

from gcs_tools.clock import AHEAD_S, VehicleClock


def test_without_delay_the_estimate_is_exact() -> None:
    clock = VehicleClock()
    for k in range(200):
        clock.hear(3.0 + 0.02 * k, 100.0 + 0.02 * k)
    assert clock.at(100.0 + 0.02 * 199) == pytest.approx(3.0 + 0.02 * 199, abs=1e-9)
    assert clock.rate == pytest.approx(1.0)


@pytest.mark.parametrize("speed", [0.5, 1.0, 10.0])
def test_late_arrivals_are_not_believed_and_the_vehicles_speed_is_found(speed: float) -> None:
    clock, late = VehicleClock(), random.Random(1)
    for k in range(400):
        wall = 0.02 * k
        clock.hear(speed * wall, wall + abs(late.gauss(0, 0.002)) + (0.05 if k % 37 == 0 else 0.0))
    assert clock.rate == pytest.approx(speed, rel=0.02)
    assert clock.at(7.985) == pytest.approx(speed * 7.985, abs=0.006 * speed)


def test_the_estimate_stops_a_little_past_the_newest_stamp() -> None:
    clock = VehicleClock()
    for k in range(100):
        clock.hear(0.02 * k, 0.02 * k)
    assert clock.at(50.0) == pytest.approx(0.02 * 99 + AHEAD_S)


def test_a_vehicle_that_was_paused_is_followed_again_at_once() -> None:
    clock = VehicleClock()
    for k in range(100):
        clock.hear(0.02 * k, 0.02 * k)
    for k in range(100):
        clock.hear(2.0 + 0.02 * k, 12.0 + 0.02 * k)
    assert clock.at(14.0) == pytest.approx(4.0, abs=0.05)


def test_a_restarted_vehicle_starts_the_clock_afresh() -> None:
    clock = VehicleClock()
    clock.hear(500.0, 1.0)
    clock.hear(0.1, 2.0)
    assert clock.at(2.05) == pytest.approx(0.15)


def test_when_is_the_inverse_of_at() -> None:
    clock = VehicleClock()
    for k in range(100):
        clock.hear(5.0 * 0.02 * k, 7.0 + 0.02 * k)
    assert clock.at(clock.when(9.95)) == pytest.approx(9.95)


def test_asking_before_anything_was_heard_is_an_error() -> None:
    assert not VehicleClock().known
    with pytest.raises(LookupError):
        VehicleClock().at(0.0)
