"""What the dashboard of `gcs watch` shows, from a vehicle's bytes to lines of text."""

import math
import re

import pytest
from gcs_tools_stand_in import StandIn
from watched import Air, row

from gcs_tools.client import Client
from gcs_tools.watch.seen import CHOSEN
from gcs_tools.watch.station import Station
from sitl.mavlink import codec
from sitl.mavlink.codec import mav


def flying() -> StandIn:
    vehicle = StandIn()
    vehicle.armed, vehicle.position = True, (1.0, 2.0, -3.0)
    vehicle.say("SITL 1: simulated 'tail-sitter'", mav.MAV_SEVERITY_INFO)
    return vehicle


def test_a_screen_of_24_lines_shows_the_vehicle_its_motion_and_its_actuators() -> None:
    air = Air(StandIn())
    air.vehicles[0].position = (1.0, 2.0, -3.0)
    air.vehicles[0].say("SITL 1: simulated 'tail-sitter'", mav.MAV_SEVERITY_INFO)
    screen = air.fly(3.0).screen()
    assert row(screen, "tail-sitter").startswith("tail-sitter · system 1 HOLD disarmed")
    assert row(screen, "position").startswith("position 1.000 2.000 -3.000 m left 5.00N ▕")
    assert "right 6.00N ▕" in row(screen, "right")
    assert "flap l -3.00° ▕" in row(screen, "flap l")
    assert row(screen, "φ θ ψ").startswith("φ θ ψ 1.00 95.00 -2.00 ° θ − 90 +5.00°")
    assert "11.00 N" in row(screen, "thrust ")
    assert row(screen, "height ").endswith("3.00 m ≤ 3.50")
    assert "q quit" in screen


def test_an_error_compares_position_and_reference_at_the_same_instant() -> None:
    air = Air(StandIn()).fly(1.0)
    vehicle = air.vehicles[0]
    vehicle.intervals = {}
    vehicle.set(armed=True)
    for ms in (1000, 1040):
        vehicle.send("POSITION_TARGET_LOCAL_NED", time_boot_ms=ms, x=2e-3 * ms, y=1.0, z=-5.0, vx=2.0)
    vehicle.send("LOCAL_POSITION_NED", time_boot_ms=1100, x=2.2 + 0.03, y=1.04, z=-5.0)
    screen = air.fly(0.1).screen()
    assert row(screen, "error ").startswith("error 0.030 0.040 0.000 |0.050| m")


def test_nothing_is_compared_where_nothing_is_to_be_followed() -> None:
    air = Air(StandIn()).fly(1.0)
    vehicle = air.vehicles[0]
    vehicle.intervals = {}
    vehicle.set(armed=True)
    vehicle.send("POSITION_TARGET_LOCAL_NED", time_boot_ms=1000, x=float("nan"))
    vehicle.send("LOCAL_POSITION_NED", time_boot_ms=1000)
    assert row(air.fly(0.1).screen(), "error").startswith("error – – –")


def test_a_wide_screen_has_a_map_and_every_message_of_the_link() -> None:
    air = Air(flying()).fly(3.0)
    screen = air.screen(140, 40)
    assert "map · north up" in screen
    assert "⌂" in screen
    assert re.search(r"POSITION_TARGET_LOCAL_NED +1\d\.\d +2\d\d$", screen, re.MULTILINE)
    assert "map" not in air.screen(80, 24)


@pytest.mark.parametrize("state", ["nobody", "standing", "flying", "lost", "many"])
def test_every_size_of_a_terminal_is_drawn_on(state: str) -> None:
    vehicles = {"nobody": [], "many": [StandIn(k) for k in range(1, 30)]}.get(state, [flying()])
    air = Air(*vehicles)
    if state != "standing":
        air.fly(2.0)
        for vehicle in air.vehicles:
            vehicle.silent = state == "lost"
        air.fly(4.0)
    for width, height in (
        (1, 1),
        (2, 9),
        (9, 2),
        (20, 5),
        (47, 24),
        (80, 10),
        (115, 31),
        (116, 3),
        (116, 24),
        (301, 90),
    ):
        air.screen(width, height)


def test_a_lost_vehicle_says_since_when_and_is_asked_anew_when_it_is_back() -> None:
    air = Air(flying()).fly(3.0)
    vehicle = air.vehicles[0]
    vehicle.silent = True
    screen = air.fly(6.0).screen()
    assert "LOST for 0:0" in screen
    assert row(screen, "position").startswith("position 1.000")
    vehicle.silent, vehicle.intervals = False, {}
    screen = air.fly(3.0).screen()
    assert "LOST" not in screen
    assert "heard again after 6 s" in screen
    assert vehicle.intervals["LOCAL_POSITION_NED"] == CHOSEN["LOCAL_POSITION_NED"]


def test_streams_that_nobody_looks_at_are_off_and_back_at_the_vehicles_own_rates_afterwards() -> None:
    air = Air(StandIn()).fly(1.0)
    vehicle = air.vehicles[0]
    assert vehicle.intervals["HIGHRES_IMU"] == -1
    assert vehicle.intervals["DEBUG_VECT"] == 100_000
    air.station.leave()
    air.fly(0.1)
    assert set(vehicle.intervals.values()) == {0}


def test_a_vehicle_faster_than_real_time_is_asked_for_no_more_a_second() -> None:
    air = Air(StandIn(), speed=10.0).fly(6.0)
    assert air.vehicles[0].intervals["LOCAL_POSITION_NED"] == pytest.approx(1_000_000, rel=0.1)
    assert "10.0" in row(air.screen(), "×")


def test_frames_that_never_came_are_counted_by_their_numbers() -> None:
    air = Air(StandIn()).fly(2.0)
    assert "lost 0.0 %" in air.screen()
    air.lost = set(range(air.datagrams, air.datagrams + 2000, 5))
    air.fly(30.0)
    loss = air.seen.traffic.loss(air.wall_s)
    assert loss == pytest.approx(0.2, abs=0.02)
    assert "lost 20" in air.screen() or "lost 19" in air.screen()


def test_a_vehicle_that_started_again_has_lost_nothing_by_counting_anew() -> None:
    air = Air(flying()).fly(5.0)
    encoder = air.vehicles[0].encoder
    encoder.sequence = (encoder.sequence + 100) & 0xFF
    air.vehicles[0].say("SITL 1: simulated 'tail-sitter'", mav.MAV_SEVERITY_INFO)
    assert "lost 0.0 %" in air.fly(3.0).screen()


def test_the_round_trip_is_told() -> None:
    air = Air(StandIn()).fly(3.0)
    assert air.seen.instruments.round_trip_s == pytest.approx(0.0, abs=1e-6)
    assert "trip 0.0 ms" in air.screen()


def test_flight_time_counts_the_vehicles_seconds_from_arming_to_disarming() -> None:
    air = Air(StandIn(), speed=5.0).fly(2.0)
    air.vehicles[0].set(armed=True)
    assert "flight 0:20" in air.fly(4.1).screen()
    air.vehicles[0].set(armed=False)
    assert "flight 0:20" in air.fly(3.0).screen()
    assert "flight ≥ 0:0" in Air(flying()).fly(2.0).screen()


def test_mission_progress_stands_as_item_and_bar() -> None:
    air = Air(flying()).fly(1.0)
    air.vehicles[0].intervals = {}
    air.vehicles[0].send("MISSION_CURRENT", seq=2, total=8, mission_state=3)
    told = row(air.fly(0.02).screen(), "mission")
    assert "item 3 of 8 ▕" in told
    assert "under way" in told
    air.vehicles[0].send("MISSION_CURRENT", total=65535, mission_state=1)
    assert "no mission" in air.fly(0.02).screen()


def test_a_vehicle_that_is_not_ready_is_asked_why() -> None:
    vehicle = StandIn()
    vehicle.ready = False
    vehicle.refuse[mav.MAV_CMD_RUN_PREARM_CHECKS] = (mav.MAV_RESULT_ACCEPTED, "the vehicle has tipped over")
    screen = Air(vehicle).fly(3.0).screen()
    assert " not ready: the vehicle has tipped over" in screen


def test_parts_that_are_not_well_are_named() -> None:
    air = Air(StandIn()).fly(0.5)
    gps, gyro = mav.MAV_SYS_STATUS_SENSOR_GPS, mav.MAV_SYS_STATUS_SENSOR_3D_GYRO
    present = {"onboard_control_sensors_present": gps | gyro, "onboard_control_sensors_enabled": gps | gyro}
    air.vehicles[0].intervals["SYS_STATUS"] = -1
    air.vehicles[0].send("SYS_STATUS", **present, onboard_control_sensors_health=gyro)
    assert " not well: gps" in air.fly(0.02).screen()


def test_a_failsafe_is_shown() -> None:
    air = Air(flying()).fly(0.5)
    air.vehicles[0].send("HEARTBEAT", autopilot=12, custom_mode=4 << 16 | 5 << 24, system_status=5, base_mode=128)
    assert "RETURN ARMED FAILSAFE" in " ".join(air.fly(0.02).screen().split())
    air.vehicles.append(StandIn(2))
    assert row(air.fly(0.1).screen(100, 24), "▶ 1 return").endswith("FAILSAFE")


def test_texts_are_coloured_by_severity_and_repeated_ones_stand_once() -> None:
    vehicle = flying()
    air = Air(vehicle).fly(1.0)
    vehicle.say("battery empty", mav.MAV_SEVERITY_CRITICAL)
    for _ in range(3):
        vehicle.say("gusty", mav.MAV_SEVERITY_WARNING)
    air.fly(0.1)
    assert row(air.screen(), "gusty").endswith("gusty (×3)")
    assert "\x1b[1;31mbattery empty" in air.styled()
    assert "\x1b[33mgusty" in air.styled()


def test_a_text_cannot_act_on_the_terminal() -> None:
    vehicle = flying()
    air = Air(vehicle).fly(1.0)
    vehicle.say("\x1b[2Jgone\x07")
    assert "·[2Jgone·" in air.fly(0.1).screen()


def test_a_vehicle_without_an_answer_to_stream_requests_is_shown_with_what_it_tells() -> None:
    vehicle = StandIn()
    vehicle.intervals = {"LOCAL_POSITION_NED": 100_000}
    vehicle.unanswered = {mav.MAV_CMD_SET_MESSAGE_INTERVAL: 9999, mav.MAV_CMD_REQUEST_MESSAGE: 9999}
    screen = Air(vehicle).fly(10.0).screen()
    assert "the vehicle doesn't answer SET_MESSAGE_INTERVAL" in screen
    assert row(screen, "position").startswith("position 0.000")


def test_who_waits_is_told_what_may_be_wrong() -> None:
    screen = Air(system=7).fly(4.0).screen(hint="start one")
    assert "waiting for system 7 at udpin:127.0.0.1:14550 0:03" in " ".join(screen.split())
    assert "start one" in screen


def test_each_vehicle_has_a_row_and_the_chosen_one_is_shown_in_full() -> None:
    air = Air(*(StandIn(k) for k in (5, 3, 4)))
    air.vehicles[1].position = (7.0, 8.0, -9.0)
    air.fly(3.0)
    air.station.choose(0)
    air.vehicles[2].silent = True
    screen = air.fly(5.0).screen()
    assert "3 vehicles" in screen
    assert row(screen, "▶ 3").startswith("▶ 3 hold 7.00 8.00 9.00")
    assert "LOST 0:0" in row(screen, "2 4 hold")
    assert row(screen, "position").startswith("position 7.000 8.000")
    air.station.move(-1)
    assert "· system 5" in air.fly(1.0).screen()
    assert air.vehicles[0].intervals["ATTITUDE"] == 100_000
    assert air.vehicles[1].intervals["ATTITUDE"] == -1


def test_a_table_longer_than_the_screen_shows_those_around_the_chosen_one() -> None:
    air = Air(*(StandIn(k) for k in range(1, 41))).fly(2.0)
    air.station.choose(30)
    screen = air.screen()
    assert "40 vehicles, 28 to 33 of them" in screen
    assert row(screen, "▶ 31")


def test_the_vehicle_asked_for_is_waited_for_while_others_are_listed() -> None:
    air = Air(StandIn(2), system=9).fly(2.0)
    assert "waiting for system 9" in air.screen()
    air.vehicles.append(StandIn(9))
    assert "· system 9" in air.fly(2.0).screen()


@pytest.mark.parametrize("name", ["HEARTBEAT", "TIMESYNC"])
def test_what_all_vehicles_hear_is_said_once_a_second_however_many_there_are(name: str) -> None:
    air = Air(*(StandIn(k) for k in range(1, 4))).fly(2.0)
    parser, said = codec.Parser(), 0
    for _ in range(100):
        air.wall_s += 0.02
        for data in air.station.poll(air.wall_s):
            said += sum(frame.name == name for frame in parser.feed(data))
    assert 1 <= said <= 2


def test_a_vehicle_whose_clock_stands_still_is_shown_as_it_stands() -> None:
    vehicle = StandIn()
    vehicle.flows = False
    vehicle.position = (4.0, 0.0, 0.0)
    screen = Air(vehicle).fly(4.0).screen()
    assert row(screen, "position").startswith("position 4.000")
    assert "stands still" in screen


def test_it_ends_after_the_time_asked_for() -> None:
    air = Air(flying())
    air.station = Station(Client, seconds=3.0)
    assert not air.fly(2.9).station.finished
    assert air.fly(0.2).station.finished


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3e38])
def test_numbers_that_are_none_are_shown_as_they_come(value: float) -> None:
    air = Air(flying()).fly(1.0)
    vehicle = air.vehicles[0]
    vehicle.intervals = {}
    xyz = {"x": value, "y": value, "z": value}
    speeds = {"vx": value, "vy": value, "vz": value}
    for _ in range(2):
        vehicle.send("POSITION_TARGET_LOCAL_NED", time_boot_ms=1000, **xyz, **speeds)
        vehicle.send("LOCAL_POSITION_NED", time_boot_ms=1000, **xyz, **speeds)
        vehicle.send("ATTITUDE", roll=value, pitch=value, yaw=value)
        for name in ("YXZ_DEG", "THRUST_N", "FLAP_DEG"):
            vehicle.send("DEBUG_VECT", name=name, **xyz)
        vehicle.send("WIND_COV", wind_x=value, wind_y=value, wind_z=value)
        vehicle.send("ESTIMATOR_STATUS", pos_horiz_accuracy=value, pos_vert_accuracy=value)
        air.fly(1.0)
        for size in ((80, 24), (140, 40)):
            air.screen(*size)


def test_it_sleeps_while_nobody_is_heard() -> None:
    air = Air().fly(0.02)
    assert air.station.next_deadline == pytest.approx(air.wall_s + 1.0)
