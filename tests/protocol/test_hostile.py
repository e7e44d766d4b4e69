"""The long lanes of `python -m benchmarks fuzz soak`, short: each can be run longer there."""

import statistics

import pytest

from benchmarks import fuzz, soak
from benchmarks.hostile import Hostile, Target, obeyed
from sitl.mavlink.codec import Parser, mav, message
from sitl.vehicle import Vehicle
from sitl.vehicle_spec import VehicleSpec


@pytest.mark.parametrize("vehicle", ["yawsitter", "yawsitter-real"])
def test_a_hovering_vehicle_holds_its_place_parameters_and_plan_under_hostile_datagrams(vehicle: str) -> None:
    flight = fuzz.hover(7, 15_000, vehicle)
    assert flight.drift_m < fuzz.DRIFT_M
    assert flight.changed == []
    assert flight.faults == 0
    assert flight.left_out < flight.datagrams / 10


def test_a_vehicle_that_does_as_every_datagram_says_stays_finite_and_answers() -> None:
    flight = fuzz.obey(7, 6_000)
    assert flight.changed == []
    assert flight.faults == 0


def test_what_a_vehicle_must_obey_is_left_out_and_nothing_else(spec: VehicleSpec) -> None:
    target = Target(1, 1, Vehicle(spec).parameters)
    to_us = {"target_system": 1, "target_component": 1}
    arm, gain = mav.MAV_CMD_COMPONENT_ARM_DISARM, {"param_id": "RATE_Y_P", "param_type": 9}
    commands = [
        message("COMMAND_LONG", command=arm, param1=1.0, **to_us),
        message("COMMAND_LONG", command=arm, param1=float("nan")),
        message("PARAM_SET", param_value=0.5, **gain, **to_us),
        message("MISSION_CLEAR_ALL", **to_us),
        message("SET_MODE", target_system=1, custom_mode=196608),
    ]
    harmless = [
        message("COMMAND_LONG", command=arm, param1=1.0, target_system=2, target_component=1),
        message("COMMAND_LONG", command=arm, param1=float("inf"), **to_us),
        message("COMMAND_LONG", command=mav.MAV_CMD_REQUEST_MESSAGE, param1=30.0, **to_us),
        message("PARAM_SET", param_value=float("nan"), **gain, **to_us),
        message("PARAM_SET", param_value=1e30, **gain, **to_us),
        message("SET_POSITION_TARGET_LOCAL_NED", x=1e6, coordinate_frame=1, **to_us),
        message("MANUAL_CONTROL", target=1, x=1000),
    ]
    assert [obeyed(m, target) for m in commands] == [True] * len(commands)
    assert [obeyed(m, target) for m in harmless] == [False] * len(harmless)


def test_the_hostile_row_holds_every_message_that_the_dialect_knows(spec: VehicleSpec) -> None:
    hostile, seen = iter(Hostile(1, Target(1, 1, Vehicle(spec).parameters))), set()
    for _ in range(8_000):
        seen |= {frame.id for frame in Parser().feed(next(hostile))}
    assert len(set(mav.mavlink_map) - seen) <= 3  # SET_MODE and its like are sent only to others


@pytest.mark.compiled
def test_missions_in_a_row_miss_no_item_and_leave_nothing_behind() -> None:
    flights = list(soak.soak(0.2))
    assert len(flights) >= 12
    assert sum(flight.missed for flight in flights) == 0
    memory = [flight.memory_MiB for flight in flights]
    assert statistics.mean(memory[-5:]) < 1.02 * statistics.mean(memory[3:8])
