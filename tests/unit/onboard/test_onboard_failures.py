"""What a vehicle does whose parts fail in flight."""

import math

import pytest
from onboard_flights import after, hovering, place

from sitl.model.failures import INTERMITTENT, OFF, STUCK, WRONG
from sitl.vehicle import Vehicle


def failing(name: str = "yawsitter", **failures: float) -> Vehicle:
    vehicle = hovering(20.0, name)
    vehicle.failures = vehicle.failures._replace(**failures)
    return vehicle


def rotors(vehicle: Vehicle) -> tuple[float, float]:
    s = vehicle.snapshot().truth
    return s.rotor_left_rad_s, s.rotor_right_rad_s


def test_a_motor_that_is_off_stops_and_the_vehicle_falls() -> None:
    vehicle = failing(motor_left=OFF)
    after(vehicle, 2.0)
    left, right = rotors(vehicle)
    assert abs(left) < 1.0 < abs(right)
    assert place(vehicle)[2] > -15.0


def test_both_motors_stuck_keep_their_speed_whatever_is_asked_of_them() -> None:
    vehicle = failing("yawsitter-real", motor_left=STUCK, motor_right=STUCK)
    before = rotors(vehicle)
    assert vehicle.commander.land().ok
    after(vehicle, 1.0)
    assert rotors(vehicle) == pytest.approx(before, rel=1e-3)


@pytest.mark.parametrize("kind", [OFF, STUCK])
def test_one_flap_lost_is_flown_with_the_other(kind: float) -> None:
    vehicle = failing(flap_left=kind)
    stuck = vehicle.snapshot().truth.flap_left_rad
    after(vehicle, 10.0)
    assert vehicle.snapshot().truth.flap_left_rad == pytest.approx(0.0 if kind == OFF else stuck, abs=1e-6)
    assert place(vehicle)[2] == pytest.approx(-20.0, abs=1.0)


def test_without_satellites_the_estimate_drifts_and_comes_back_with_them() -> None:
    def error(vehicle: Vehicle) -> float:
        s = vehicle.snapshot()
        return math.hypot(s.nav.north_m - s.truth.north_m, s.nav.east_m - s.truth.east_m)

    vehicle = failing("yawsitter-real", gnss=OFF)
    after(vehicle, 30.0)
    lost = error(vehicle)
    assert lost > 2.0
    vehicle.failures = vehicle.failures._replace(gnss=0.0)
    after(vehicle, 20.0)
    assert error(vehicle) < 0.5 * lost


def test_a_receiver_that_is_wrong_leads_the_vehicle_astray_by_as_much() -> None:
    vehicle = failing("yawsitter-real", gnss=WRONG)
    after(vehicle, 40.0)
    assert place(vehicle)[0] == pytest.approx(-10.0, abs=2.0)


def test_a_receiver_heard_now_and_then_suffices() -> None:
    vehicle = failing("yawsitter-real", gnss=INTERMITTENT)
    heard = set()
    after(vehicle, 30.0, lambda v: heard.add(v.snapshot().gnss_heard))
    assert heard == {True, False}
    assert math.dist(place(vehicle), (0.0, 0.0, -20.0)) < 4.0


def test_a_restart_mends_everything() -> None:
    vehicle = failing(motor_left=OFF)
    vehicle.reset()
    assert not any(vehicle.failures)
