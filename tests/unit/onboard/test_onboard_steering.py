"""Attitudes and body rates flown in Offboard mode, from the ground and in the air."""

import math
from collections.abc import Callable

import pytest
from onboard_flights import NAN, after, hovering, place, standing, wait

from sitl.frames import GRAVITY_M_S2, body_quaternion, body_rates, euler_321, quaternion_from_321, wire_quaternion
from sitl.onboard.modes import Landed, Mode, Verdict
from sitl.onboard.offboard import AttitudeTarget
from sitl.quaternion import Vec3
from sitl.vehicle import Vehicle

STILL: Vec3 = (0.0, 0.0, 0.0)
HOVER_PITCH = 0.168  # the wing in the slipstream lifts toward the belly: without wind the vehicle hovers leaning back


def hover_thrust(vehicle: Vehicle) -> float:
    a = vehicle.spec.airframe.airframe
    return a.mass_kg * GRAVITY_M_S2 / (2.0 * a.thrust_max_N)


def level(thrust: float, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> AttitudeTarget:
    return AttitudeTarget(body_quaternion(*quaternion_from_321(roll, pitch, yaw)), STILL, thrust)


def attitude(vehicle: Vehicle) -> Vec3:
    """Roll, pitch, yaw of the multicopter frame."""
    n = vehicle.snapshot().nav
    return euler_321(*wire_quaternion(n.qw, n.qx, n.qy, n.qz))


def steer(vehicle: Vehicle, target: AttitudeTarget, seconds: float, watch: Callable[[], None] | None = None) -> None:
    until = vehicle.now_us + round(seconds * 1e6)
    while vehicle.now_us < until:
        assert vehicle.offboard.submit_attitude(target, vehicle.now_us).ok
        vehicle.advance(vehicle.now_us + 20_000)
        if vehicle.commander.mode is not Mode.OFFBOARD:
            assert vehicle.commander.set_mode(Mode.OFFBOARD).ok
        if watch:
            watch()


@pytest.mark.parametrize(
    ("roll", "pitch", "yaw"),
    [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, -0.2, 0.0), (0.1, 0.15, 1.2), (-0.15, 0.1, -2.5)],
)
def test_an_attitude_is_held_in_the_multicopters_frame(roll: float, pitch: float, yaw: float) -> None:
    vehicle = hovering(20.0)
    steer(vehicle, level(hover_thrust(vehicle), 0.0, 0.0, yaw), 4.0)
    steer(vehicle, level(hover_thrust(vehicle), roll, pitch, yaw), 1.0)
    assert attitude(vehicle) == pytest.approx((roll, pitch, yaw), abs=math.radians(3.0))


def test_positive_pitch_flies_backward_and_positive_roll_to_the_right() -> None:
    vehicle = hovering(20.0)
    steer(vehicle, level(hover_thrust(vehicle), roll=0.15, pitch=HOVER_PITCH + 0.15), 1.5)
    s = vehicle.snapshot().nav
    assert s.v_north_m_s < -0.7
    assert s.v_east_m_s > 0.7


@pytest.mark.parametrize(("factor", "sign"), [(1.1, -1.0), (0.9, 1.0)])
def test_thrust_beyond_hovers_climbs_and_less_sinks(factor: float, sign: float) -> None:
    vehicle = hovering(20.0)
    steer(vehicle, level(factor * hover_thrust(vehicle)), 1.0)
    assert sign * vehicle.snapshot().nav.v_down_m_s > 0.5


def test_hovers_thrust_keeps_the_height() -> None:
    vehicle = hovering(20.0)
    steer(vehicle, level(hover_thrust(vehicle)), 3.0)
    assert place(vehicle)[2] == pytest.approx(-20.0, abs=0.3)


@pytest.mark.parametrize("rates", [(0.0, 0.0, 0.5), (0.0, 0.0, -0.8), (0.3, 0.0, 0.0), (0.0, -0.3, 0.0)])
def test_body_rates_are_flown_about_the_multicopters_axes(rates: Vec3) -> None:
    vehicle = hovering(20.0)
    target = AttitudeTarget(None, body_rates(*rates), hover_thrust(vehicle))
    steer(vehicle, target, 0.5)
    n = vehicle.snapshot().nav
    assert (n.r_rad_s, n.q_rad_s, -n.p_rad_s) == pytest.approx(rates, abs=0.1)


def test_it_takes_off_from_the_ground_by_thrust_alone_and_lands_by_the_lack_of_it() -> None:
    vehicle = standing()
    assert vehicle.offboard.submit_attitude(level(0.0), vehicle.now_us).ok
    assert vehicle.commander.set_mode(Mode.OFFBOARD).ok
    assert vehicle.commander.arm().ok
    steer(vehicle, level(0.0), 1.0)
    assert vehicle.commander.standing
    steer(vehicle, level(1.15 * hover_thrust(vehicle)), 1.5)
    assert vehicle.commander.landed is Landed.IN_AIR
    assert place(vehicle)[2] < -0.5
    for _ in range(400):
        sink = vehicle.snapshot().nav.v_down_m_s
        steer(vehicle, level((1.0 + 0.3 * (sink - 0.4)) * hover_thrust(vehicle), pitch=HOVER_PITCH), 0.04)
        if vehicle.snapshot().feet_down:
            break
    steer(vehicle, level(0.0), 1.0)
    assert vehicle.commander.standing
    assert not vehicle.commander.tipped_over


def test_when_attitudes_stay_away_the_vehicle_holds_where_it_comes_to_rest() -> None:
    vehicle = hovering(20.0)
    steer(vehicle, level(hover_thrust(vehicle), pitch=-0.2), 1.0)
    wait(vehicle, lambda v: v.commander.mode is Mode.HOLD, 2.0)
    assert vehicle.commander.failsafe == "offboard targets lost"
    after(vehicle, 6.0)
    assert abs(vehicle.snapshot().nav.v_north_m_s) < 0.05
    assert attitude(vehicle)[:2] == pytest.approx((0.0, HOVER_PITCH), abs=0.01)


@pytest.mark.parametrize(
    "target",
    [
        AttitudeTarget((NAN, 0.0, 0.0, 0.0), STILL, 0.5),
        AttitudeTarget((0.0, 0.0, 0.0, 0.0), STILL, 0.5),
        AttitudeTarget(None, (NAN, 0.0, 0.0), 0.5),
        AttitudeTarget(None, STILL, NAN),
        AttitudeTarget(None, STILL, 1.2),
        AttitudeTarget(None, STILL, -0.1),
    ],
)
def test_an_attitude_that_makes_no_sense_is_denied(target: AttitudeTarget) -> None:
    vehicle = standing()
    assert vehicle.offboard.submit_attitude(target, vehicle.now_us).verdict is Verdict.DENIED
    assert vehicle.offboard.lost(vehicle.now_us)
