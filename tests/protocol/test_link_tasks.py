"""Commands that take time: progress, the one result at the end, and how they are cancelled."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from mavlink_pair import Station, World

from sitl.geodesy import to_global
from sitl.mavlink.codec import mav
from sitl.onboard.modes import Mode

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS, CANCELLED = range(7)
NAN = math.nan
pytestmark = pytest.mark.compiled


@pytest.fixture
def flying(make_world: Callable[..., World]) -> World:
    world = make_world()
    world.take_off(world.station())
    return world


def acks(station: Station, command: int) -> list[Any]:
    return [m for m in station.all("COMMAND_ACK") if m.command == command]


def cancel(world: World, station: Station, command: int) -> None:
    station.send("COMMAND_CANCEL", target_system=1, target_component=1, command=command)
    world.run(0.05)


@pytest.mark.parametrize(
    ("command", "params"),
    [
        (mav.MAV_CMD_NAV_LOITER_TURNS, (1, 0, 2.0, 0, NAN, NAN, NAN)),
        (mav.MAV_CMD_NAV_LOITER_TIME, (20.0, 0, 0, 0, NAN, NAN, NAN)),
        (mav.MAV_CMD_NAV_LOITER_TO_ALT, (0, 0, 0, 0, NAN, NAN, 196.0)),
        (mav.MAV_CMD_CONDITION_YAW, (120.0, 20.0, 1, 0)),
    ],
)
def test_progress_is_told_twice_a_second_and_the_result_once(flying: World, command: int, params: tuple) -> None:
    (station,) = flying.stations
    assert station.ask(command, *params) == [IN_PROGRESS]
    flying.speed = 2.0
    flying.run_until(lambda: acks(station, command)[-1].result != IN_PROGRESS, 40.0)
    results = [m.result for m in acks(station, command)]
    assert results == [IN_PROGRESS] * (len(results) - 1) + [ACCEPTED]
    percents = [m.progress for m in acks(station, command)[:-1]]
    assert percents == sorted(percents)
    assert percents[0] < 20 < percents[-1] < 100
    flying.run(2.0)
    assert len(acks(station, command)) == len(results)
    assert flying.vehicle.commander.mode is Mode.HOLD


def test_a_cancelled_command_is_answered_cancelled_and_the_vehicle_holds(flying: World) -> None:
    (station,) = flying.stations
    command = mav.MAV_CMD_NAV_LOITER_TURNS
    station.ask(command, 10, 0, 3.0, 0, NAN, NAN, NAN)
    flying.run(1.0)
    cancel(flying, station, command)
    assert acks(station, command)[-1].result == CANCELLED
    before = len(acks(station, command))
    cancel(flying, station, command)
    flying.run(1.0)
    assert len(acks(station, command)) == before
    assert flying.vehicle.commander.mode is Mode.HOLD


def test_only_who_asked_for_it_cancels_a_command(flying: World) -> None:
    (station,) = flying.stations
    other = flying.station()
    station.ask(mav.MAV_CMD_NAV_LOITER_TIME, 100, 0, 0, 0, NAN, NAN, NAN)
    cancel(flying, other, mav.MAV_CMD_NAV_LOITER_TIME)
    flying.run(1.0)
    assert acks(station, mav.MAV_CMD_NAV_LOITER_TIME)[-1].result == IN_PROGRESS


def test_a_command_that_something_else_replaces_has_failed(flying: World) -> None:
    (station,) = flying.stations
    station.ask(mav.MAV_CMD_NAV_LOITER_TIME, 100, 0, 0, 0, NAN, NAN, NAN)
    assert station.ask(mav.MAV_CMD_NAV_LAND, 0, 0, 0, NAN, NAN, NAN, 0) == [ACCEPTED]
    flying.run(1.0)
    assert acks(station, mav.MAV_CMD_NAV_LOITER_TIME)[-1].result == FAILED


def test_a_repetition_is_answered_with_progress_and_does_not_begin_anew(flying: World) -> None:
    (station,) = flying.stations
    command, params = mav.MAV_CMD_NAV_LOITER_TIME, (10.0, 0, 0, 0, NAN, NAN, NAN)
    station.ask(command, *params)
    task = flying.vehicle.commander.guided.task
    flying.run(1.2)
    assert station.ask(command, *params, confirmation=1) == [IN_PROGRESS]
    assert flying.vehicle.commander.guided.task is task


@pytest.mark.parametrize("command", [mav.MAV_CMD_NAV_TAKEOFF, mav.MAV_CMD_NAV_LAND, mav.MAV_CMD_DO_ORBIT])
def test_changes_of_mode_are_accepted_at_once(flying: World, command: int) -> None:
    """QGroundControl arms when the take-off's result comes."""
    (station,) = flying.stations
    assert station.ask(command, 3.0 if command == mav.MAV_CMD_DO_ORBIT else 0, NAN, 0, NAN, NAN, NAN, NAN) == [ACCEPTED]


def test_an_orbit_is_flown_and_told(flying: World) -> None:
    (station,) = flying.stations
    commander = flying.vehicle.commander
    lat, lon = to_global(commander.origin, 5.0, 0.0)
    station.send(
        "COMMAND_INT", target_system=1, target_component=1, frame=5, command=mav.MAV_CMD_DO_ORBIT,
        param1=-4.0, param2=1.0, param3=0, param4=NAN, x=round(lat * 1e7), y=round(lon * 1e7), z=193.0,
    )  # fmt: skip
    flying.run(1.2)
    assert acks(station, mav.MAV_CMD_DO_ORBIT)[-1].result == ACCEPTED
    status = station.all("ORBIT_EXECUTION_STATUS")[-1]
    assert (status.radius, status.z) == (-4.0, 193.0)
    assert (status.x, status.y) == pytest.approx((lat * 1e7, lon * 1e7), abs=2)
    assert station.all("HEARTBEAT")[-1].custom_mode == 3 << 16 | 1 << 24
    station.ask(mav.MAV_CMD_DO_PAUSE_CONTINUE, 0)
    station.forget()
    flying.run(1.0)
    assert station.all("ORBIT_EXECUTION_STATUS") == []


@pytest.mark.parametrize(
    ("command", "params"),
    [
        (mav.MAV_CMD_DO_ORBIT, (3.0, 1.0, 4, 0, NAN, NAN, NAN)),
        (mav.MAV_CMD_DO_ORBIT, (3.0, -1.0, 0, 0, NAN, NAN, NAN)),
        (mav.MAV_CMD_DO_ORBIT, (3.0, NAN, 0, 0, 95.0, 0.0, NAN)),
        (mav.MAV_CMD_NAV_LOITER_TURNS, (0, 0, 2.0, 0, NAN, NAN, NAN)),
        (mav.MAV_CMD_NAV_LOITER_TO_ALT, (0, 0, 0, 0, NAN, NAN, NAN)),
        (mav.MAV_CMD_CONDITION_YAW, (NAN, 0, 0, 0)),
        (mav.MAV_CMD_CONDITION_YAW, (10.0, 0, 3, 0)),
        (mav.MAV_CMD_DO_SET_ROI_LOCATION, (0, 0, 0, 0, NAN, NAN, 0)),
        (mav.MAV_CMD_DO_SET_ROI, (1, 0, 0, 0, 0, 0, 0)),
    ],
)
def test_what_makes_no_sense_is_denied_with_a_reason(flying: World, command: int, params: tuple) -> None:
    (station,) = flying.stations
    station.forget()
    assert station.ask(command, *params) == [DENIED]
    assert any("refused" in text for text in station.texts())


def test_a_place_is_faced_until_told_otherwise(flying: World) -> None:
    (station,) = flying.stations
    lat, lon = to_global(flying.vehicle.commander.origin, 0.0, 30.0)
    assert station.ask(mav.MAV_CMD_DO_SET_ROI_LOCATION, 0, 0, 0, 0, lat, lon, 190.0) == [ACCEPTED]
    flying.speed = 10.0
    flying.run(0.6)
    assert station.all("ATTITUDE")[-1].yaw == pytest.approx(math.pi / 2, abs=0.05)
    assert station.ask(mav.MAV_CMD_DO_SET_ROI_NONE) == [ACCEPTED]


def test_the_missions_landing_is_flown_on_request_if_it_has_one(flying: World) -> None:
    (station,) = flying.stations
    assert station.ask(mav.MAV_CMD_DO_LAND_START) == [DENIED]
