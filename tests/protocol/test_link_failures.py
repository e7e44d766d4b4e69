"""INJECT_FAILURE over the link."""

import pytest
from mavlink_pair import World

from sitl.mavlink.codec import mav

ACCEPTED, REJECTED, DENIED, UNSUPPORTED = range(4)
INJECT = mav.MAV_CMD_INJECT_FAILURE
GPS, MOTOR, SERVO, LINK = 4, 101, 102, 105
OK, OFF, STUCK, GARBAGE, WRONG = range(5)


def test_failures_are_denied_until_the_parameter_allows_them(world: World) -> None:
    station = world.station()
    assert station.ask(INJECT, MOTOR, OFF, 1) == [DENIED]
    assert any("SYS_FAILURE_EN" in text for text in station.texts())
    assert not any(world.vehicle.failures)


@pytest.mark.parametrize(
    ("params", "failed"),
    [
        ((MOTOR, OFF, 0), {"motor_left": 1.0, "motor_right": 1.0}),
        ((MOTOR, STUCK, 2), {"motor_right": 2.0}),
        ((SERVO, OFF, 1), {"flap_left": 1.0}),
        ((GPS, WRONG, 0), {"gnss": 4.0}),
    ],
)
def test_parts_fail_as_asked_and_are_mended(world: World, params: tuple, failed: dict[str, float]) -> None:
    world.vehicle.parameters.set("SYS_FAILURE_EN", 1)
    station = world.station()
    assert station.ask(INJECT, *params) == [ACCEPTED]
    assert {name: value for name, value in world.vehicle.failures._asdict().items() if value} == failed
    assert any(text.startswith("failure: ") for text in station.texts())
    assert station.ask(INJECT, params[0], OK, params[2]) == [ACCEPTED]
    assert not any(world.vehicle.failures)


@pytest.mark.parametrize(
    "params",
    [(MOTOR, GARBAGE, 1), (MOTOR, OFF, 3), (MOTOR, OFF, 0.5), (SERVO, WRONG, 1), (0, OFF, 0), (LINK, STUCK, 0)],
)
def test_what_can_not_fail_that_way_is_unsupported(world: World, params: tuple) -> None:
    world.vehicle.parameters.set("SYS_FAILURE_EN", 1)
    assert world.station().ask(INJECT, *params) == [UNSUPPORTED]
    assert not any(world.vehicle.failures)


def test_without_satellites_there_is_no_fix_and_the_receiver_is_unhealthy(world: World) -> None:
    world.vehicle.parameters.set("SYS_FAILURE_EN", 1)
    station = world.station()
    station.ask(INJECT, GPS, OFF, 0)
    station.forget()
    world.run(1.1)
    fix, status = station.all("GPS_RAW_INT")[-1], station.all("SYS_STATUS")[-1]
    assert (fix.fix_type, fix.satellites_visible) == (1, 0)
    assert not status.onboard_control_sensors_health & mav.MAV_SYS_STATUS_SENSOR_GPS


def test_a_link_that_fails_is_silent_for_its_time_and_then_comes_back(world: World) -> None:
    world.vehicle.parameters.set("SYS_FAILURE_EN", 1)
    world.vehicle.parameters.set("SIM_LINK_OFF_T", 3.0)
    station = world.station()
    assert station.ask(INJECT, LINK, OFF, 0) == [ACCEPTED]
    station.forget()
    station.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    world.run(2.8)
    assert station.heard == []
    assert not world.vehicle.commander.armed
    world.run(1.5)
    assert station.all("HEARTBEAT")
    assert station.all("ATTITUDE")
