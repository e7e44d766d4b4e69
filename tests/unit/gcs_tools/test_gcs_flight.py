"""The flight's script, against a stand-in vehicle and a bad link."""

import math
from itertools import pairwise

import pytest
from gcs_tools_stand_in import Pair, StandIn

from gcs_tools import yaml_plan
from gcs_tools.client import LOST_S, Client
from gcs_tools.flight import Flight
from gcs_tools.plan import Home, Plan, Uploaded
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

HOP = """\
name: hop
kind: waypoints
duration_s: 6
key_times_s: [2, 4]
waypoints:
  - {t_s: 0, at_m: [0, 0, 0]}
  - {t_s: 2, at_m: [0, 0, -2]}
  - {t_s: 4, at_m: [3, -1, -2]}
  - {t_s: 6, at_m: [3, -1, 0]}
"""
HOP_JERK_M_S3 = 60.0 * 3.0 / 2.0**3  # at the ends of its longest move, along north
CLIMB = """\
name: climb
kind: waypoints
duration_s: 3
heading_deg: null
waypoints:
  - {t_s: 0, at_m: [0, 0, 0]}
  - {t_s: 2, at_m: [0, 0, -2]}
"""
ITEMS = """\
name: items
kind: mission
limit_s: 60
items:
  - {do: takeoff, at_m: [0, 0, -3]}
  - {do: waypoint, at_m: [4, 0, -3], hold_s: 1}
  - {do: land, at_m: [4, 0]}
"""


def plan(text: str = HOP) -> Plan:
    return yaml_plan.loads(text, "test.yaml")


def flight(
    text: str = HOP, *, vehicle: StandIn | None = None, speed: float = 1.0, loss: float = 0.0
) -> tuple[Flight, StandIn, Pair]:
    vehicle = vehicle or StandIn()
    client = Client()
    return Flight(plan(text), client), vehicle, Pair(client, vehicle, speed=speed, loss=loss)


def fault(made: Flight) -> str:
    assert made.client.fault is not None, "the flight succeeded"
    message = str(made.client.fault)
    assert "\n" not in message
    return message


def flown(made: Flight) -> None:
    assert made.client.fault is None, made.client.fault


def test_a_streamed_flight_goes_from_the_first_heartbeat_to_disarming() -> None:
    made, vehicle, pair = flight()
    phases = []

    def watch() -> bool:
        if not phases or phases[-1] != made.phase:
            phases.append(made.phase)
        return made.client.finished

    pair.run(watch)
    flown(made)
    assert phases == ["connecting", "configuring", "preparing", "flying", "landing", "done"]
    assert not vehicle.armed
    assert made.measured_s == 6.0
    assert made.progress == 1.0


def test_a_vehicle_that_follows_exactly_is_measured_without_error() -> None:
    made, _, pair = flight()
    pair.run()
    metrics = made.metrics()
    assert metrics.max_overshoot == pytest.approx((0, 0, 0), abs=1e-5)
    assert metrics.waypoints[1].target == pytest.approx((3, -1, -2))
    assert metrics.largest_gap_s == pytest.approx(0.02)
    assert metrics.ranges == {
        "roll_deg": [1, 1],
        "pitch_deg": [95, 95],
        "yaw_deg": [-2, -2],
        "thrust_N": [11, 11],
        "flap_deg": [-3, 4],
    }


def test_a_vehicle_that_lags_is_measured_by_how_much() -> None:
    """A vehicle a tenth of a second late is behind by 0.1 s times the speed it should have."""
    made, vehicle, pair = flight()
    vehicle.behind = 5
    pair.run()
    assert made.metrics().max_overshoot[0] == pytest.approx(0.1 * 1.875 * 3 / 2, rel=0.01)


@pytest.mark.parametrize("speed", [0.5, 1.0, 8.0])
def test_targets_come_every_twenty_milliseconds_of_the_vehicles_time_whatever_its_speed(speed: float) -> None:
    made, vehicle, pair = flight(speed=speed)
    pair.run()
    flown(made)
    stamps = [m.time_boot_ms for _, m in vehicle.targets]
    steps = [b - a for a, b in pairwise(stamps)]
    regular = [step for step in steps if 18 <= step <= 22]
    assert len(regular) > 0.97 * len(steps)
    assert max(steps) <= 60


def test_every_target_is_evaluated_for_the_instant_it_is_stamped_with() -> None:
    made, vehicle, pair = flight()
    pair.run()
    assert made.t0_s is not None
    reference = plan().reference  # type: ignore[union-attr]
    for came_s, m in vehicle.targets:
        assert m.time_boot_ms * 1e-3 == pytest.approx(came_s, abs=0.021)
        wanted = reference.at(m.time_boot_ms * 1e-3 - made.t0_s)
        assert (m.x, m.y, m.z) == pytest.approx(wanted.position_m, abs=1e-6)
        assert (m.vx, m.vy, m.vz) == pytest.approx(wanted.velocity_m_s, abs=1e-6)
        assert (m.afx, m.afy, m.afz) == pytest.approx(wanted.acceleration_m_s2, abs=1e-6)


def test_the_heading_is_left_to_the_vehicle_where_the_plan_says_so() -> None:
    with_heading, vehicle, pair = flight()
    pair.run()
    flown(with_heading)
    assert {m.type_mask for _, m in vehicle.targets} == {0x800}
    without, vehicle, pair = flight(CLIMB)
    pair.run()
    flown(without)
    assert {m.type_mask for _, m in vehicle.targets} == {0xC00}


def test_offboard_is_asked_for_after_a_second_of_targets_and_arming_after_that() -> None:
    made, vehicle, pair = flight()
    pair.run(lambda: vehicle.mode == "offboard")
    assert vehicle.targets[-1][0] - vehicle.targets[0][0] >= 1.0
    assert not vehicle.armed
    pair.run(lambda: vehicle.armed)
    pair.run(lambda: made.t0_s is not None)
    assert made.t_s < 0.0


def test_a_flight_that_ends_in_the_air_is_landed() -> None:
    made, vehicle, pair = flight(CLIMB)
    pair.run()
    flown(made)
    assert [m.command for m in vehicle.commands if m.command == mav.MAV_CMD_NAV_LAND]
    assert not vehicle.armed
    assert made.measured_s == 3.0


def test_a_flight_that_ends_on_the_ground_is_disarmed_there() -> None:
    _, vehicle, pair = flight()
    pair.run()
    assert not [m for m in vehicle.commands if m.command == mav.MAV_CMD_NAV_LAND]
    assert vehicle.commands[-1].command == mav.MAV_CMD_SET_MESSAGE_INTERVAL
    assert not vehicle.armed


def test_streams_that_were_changed_go_back_to_their_defaults() -> None:
    made, vehicle, pair = flight()
    pair.run(lambda: made.phase == "flying")
    assert vehicle.intervals["LOCAL_POSITION_NED"] == 20_000
    assert vehicle.intervals["ATTITUDE"] == -1
    pair.run()
    assert set(vehicle.intervals.values()) == {0}


@pytest.mark.parametrize("command", [mav.MAV_CMD_DO_SET_MODE, mav.MAV_CMD_COMPONENT_ARM_DISARM])
def test_a_lost_answer_is_asked_for_again_with_a_higher_confirmation(command: int) -> None:
    vehicle = StandIn()
    vehicle.unanswered[command] = 2
    made, _, pair = flight(vehicle=vehicle)
    pair.run()
    flown(made)
    assert [m.confirmation for m in vehicle.commands if m.command == command][:3] == [0, 1, 2]


def test_an_answer_that_never_comes_ends_the_flight() -> None:
    vehicle = StandIn()
    vehicle.unanswered[mav.MAV_CMD_COMPONENT_ARM_DISARM] = 99
    made, _, pair = flight(vehicle=vehicle)
    pair.run()
    assert fault(made) == "the vehicle doesn't answer COMPONENT_ARM_DISARM"


@pytest.mark.parametrize("seed", range(5))
def test_a_link_that_loses_and_repeats_a_fifth_of_everything_only_costs_samples(seed: int) -> None:
    client, vehicle = Client(), StandIn()
    made = Flight(plan(), client)
    pair = Pair(client, vehicle, loss=0.2, seed=seed)
    pair.run()
    flown(made)
    stamps_s = sorted({m.time_boot_ms * 1e-3 for _, m in vehicle.targets})
    unheard_s = max(after - before for before, after in pairwise(stamps_s))
    # until the next target comes the vehicle goes on along the last one's position, velocity and acceleration
    strayed_m = HOP_JERK_M_S3 * unheard_s**3 / 6.0
    assert max(made.metrics().max_overshoot) <= strayed_m + 1e-5
    assert unheard_s < 0.3


def test_an_arming_that_is_refused_for_a_while_is_tried_again() -> None:
    vehicle = StandIn()
    arm = mav.MAV_CMD_COMPONENT_ARM_DISARM
    vehicle.refuse[arm] = (mav.MAV_RESULT_TEMPORARILY_REJECTED, "arming refused: moving")
    made, _, pair = flight(vehicle=vehicle)
    pair.run(lambda: [m.command for m in vehicle.commands].count(arm) == 3)
    vehicle.refuse.clear()
    pair.run()
    flown(made)


def test_an_arming_refused_for_good_is_reported_with_the_vehicles_reason() -> None:
    vehicle = StandIn()
    reason = "arming refused: the vehicle has tipped over"
    vehicle.refuse[mav.MAV_CMD_COMPONENT_ARM_DISARM] = (mav.MAV_RESULT_TEMPORARILY_REJECTED, reason)
    made, _, pair = flight(vehicle=vehicle)
    pair.run()
    assert fault(made) == f"arming: refused for now by the vehicle: {reason}"
    assert made.measured_s is None
    assert set(vehicle.intervals.values()) == {0}


def test_what_the_vehicle_cannot_do_is_not_asked_for_twice() -> None:
    vehicle = StandIn()
    vehicle.refuse[mav.MAV_CMD_DO_SET_MODE] = (mav.MAV_RESULT_UNSUPPORTED, "")
    made, _, pair = flight(vehicle=vehicle)
    pair.run()
    assert fault(made) == "mode offboard: not supported by the vehicle"
    assert [m.command for m in vehicle.commands].count(mav.MAV_CMD_DO_SET_MODE) == 1


def test_a_vehicle_that_falls_silent_ends_the_flight_soon_and_says_so() -> None:
    made, vehicle, pair = flight()
    pair.run(lambda: made.t_s > 3.0)
    vehicle.silent, silent_s = True, pair.wall_s
    pair.run()
    assert fault(made) == "nothing heard from the vehicle for 3 s"
    assert pair.wall_s - silent_s < LOST_S + 0.2


def test_no_vehicle_at_all_is_reported() -> None:
    vehicle = StandIn()
    vehicle.silent = True
    made, _, pair = flight(vehicle=vehicle)
    pair.run()
    assert fault(made) == "no vehicle heard in 10 s"


def test_a_vehicle_that_leaves_offboard_is_not_fought_over() -> None:
    made, vehicle, pair = flight()
    pair.run(lambda: made.t_s > 2.5)
    vehicle.say("offboard targets lost: hold")
    vehicle.set(mode="hold")
    pair.run()
    assert "left offboard mode for hold at t = 2." in fault(made)
    assert "offboard targets lost: hold" in fault(made)
    assert not [m for m in vehicle.commands if m.command == mav.MAV_CMD_NAV_LAND]


def test_a_vehicle_that_disarms_in_flight_is_reported_with_its_last_words() -> None:
    made, vehicle, pair = flight()
    pair.run(lambda: made.t_s > 2.5)
    vehicle.say("the vehicle has tipped over: motors stopped")
    vehicle.set(armed=False)
    pair.run()
    assert "disarmed at t = 2." in fault(made)
    assert "tipped over" in fault(made)


def test_a_vehicle_that_stands_elsewhere_is_not_flown() -> None:
    vehicle = StandIn()
    vehicle.position = (5.0, 3.0, 0.0)
    made, _, pair = flight(vehicle=vehicle)
    pair.run()
    assert fault(made) == "the vehicle stands at (5.00, 3.00, 0.00), 5.83 m from where this flight starts"
    assert not vehicle.targets


def test_a_vehicle_that_is_armed_already_is_not_taken_over() -> None:
    vehicle = StandIn()
    vehicle.armed = True
    made, _, pair = flight(vehicle=vehicle)
    pair.run()
    assert "armed already" in fault(made)
    assert vehicle.armed


def test_an_interrupted_flight_asks_the_vehicle_to_land() -> None:
    made, vehicle, pair = flight()
    pair.run(lambda: made.t_s > 2.0)
    made.give_up()
    pair.run()
    assert fault(made) == "interrupted"
    assert vehicle.commands[-1].command == mav.MAV_CMD_SET_MESSAGE_INTERVAL
    assert [m.command for m in vehicle.commands].count(mav.MAV_CMD_NAV_LAND) == 1
    assert not vehicle.armed


def test_a_paused_vehicle_is_waited_for() -> None:
    made, vehicle, pair = flight()
    pair.run(lambda: made.t_s > 2.0)
    sent = len(vehicle.targets)
    pair.pause(20.0)
    assert len(vehicle.targets) - sent <= 6
    pair.run()
    flown(made)
    assert made.metrics().max_overshoot == pytest.approx((0, 0, 0), abs=2e-3)


def test_a_mission_is_uploaded_verbatim_started_and_followed_to_its_end() -> None:
    made, vehicle, pair = flight(ITEMS)
    pair.run()
    flown(made)
    sent = plan(ITEMS)
    assert isinstance(sent, Uploaded)
    for got, item in zip(vehicle.items, sent.items, strict=True):
        for name, value in item._asdict().items():
            assert getattr(got, name) == pytest.approx(value, nan_ok=True)
    assert [round(t) for t, _ in made.reached] == [1, 2, 3]
    assert [place for _, place in made.reached] == [(0, 0, -3), (4, 0, -3), (4, 0, 0)]
    metrics = made.metrics()
    assert metrics.mae == pytest.approx((0, 0, 0), abs=1e-6)
    assert made.measured_s == pytest.approx(3.0, abs=0.1)


def test_a_mission_that_ends_in_the_air_is_landed() -> None:
    made, vehicle, pair = flight(ITEMS.replace("  - {do: land, at_m: [4, 0]}\n", ""))
    pair.run()
    flown(made)
    assert not vehicle.armed
    assert [m.command for m in vehicle.commands].count(mav.MAV_CMD_NAV_LAND) == 1


def test_a_refused_mission_is_reported_in_the_vehicles_words() -> None:
    vehicle = StandIn()
    vehicle.refuse_mission = (mav.MAV_MISSION_INVALID_PARAM7, "Item 1, param7 refused: altitude is beyond 10 km")
    made, _, pair = flight(ITEMS, vehicle=vehicle)
    pair.run()
    assert fault(made) == "the vehicle refuses the mission: Item 1, param7 refused: altitude is beyond 10 km"
    assert not vehicle.armed


def test_what_the_vehicle_says_again_and_again_is_noted_once() -> None:
    vehicle = StandIn()
    vehicle.refuse[mav.MAV_CMD_COMPONENT_ARM_DISARM] = (mav.MAV_RESULT_TEMPORARILY_REJECTED, "outside the fence")
    made, _, pair = flight(ITEMS, vehicle=vehicle)
    pair.run()
    assert len([m for m in vehicle.commands if m.command == mav.MAV_CMD_COMPONENT_ARM_DISARM]) > 5
    assert made.notes.count("vehicle says: outside the fence") == 1


def test_a_refused_mission_without_a_word_is_reported_by_its_result() -> None:
    vehicle = StandIn()
    vehicle.refuse_mission = (mav.MAV_MISSION_NO_SPACE, "")
    made, _, pair = flight(ITEMS, vehicle=vehicle)
    pair.run()
    assert fault(made) == "the vehicle refuses the mission: no space"


def test_a_mission_survives_a_bad_link() -> None:
    made, vehicle, pair = flight(ITEMS, loss=0.15)
    pair.run()
    flown(made)
    assert len(vehicle.items) == 3


def test_a_mission_that_takes_too_long_is_given_up_and_landed() -> None:
    made, vehicle, pair = flight(ITEMS.replace("limit_s: 60", "limit_s: 1.5"))
    pair.run()
    assert fault(made).startswith("the mission isn't done after 1.5 s, at item")
    assert [m.command for m in vehicle.commands].count(mav.MAV_CMD_NAV_LAND) == 1


def test_a_vehicle_that_leaves_its_mission_is_reported() -> None:
    made, vehicle, pair = flight(ITEMS)
    pair.run(lambda: vehicle.mode == "mission")
    vehicle.say("ground stations lost: hold")
    vehicle.set(mode="hold")
    pair.run()
    assert "left mission mode for hold" in fault(made)


def test_a_plan_drawn_on_another_continent_is_refused() -> None:
    client, vehicle = Client(), StandIn()
    drawn = plan(ITEMS)
    assert isinstance(drawn, Uploaded)
    made = Flight(drawn._replace(home=Home(47.4, 8.5, 488.0)), client)
    Pair(client, vehicle).run()
    assert fault(made).startswith("the plan's home is 2")
    assert "km from the vehicle's" in fault(made)
    assert not vehicle.items


def test_another_vehicles_frames_are_left_alone() -> None:
    made, _, pair = flight()
    other = StandIn(system=7)
    pair.run(lambda: made.phase == "preparing")
    other.position = (math.nan, 0.0, 0.0)
    other.intervals["LOCAL_POSITION_NED"] = 20_000
    for data in other.turn(50.0):
        made.client.receive(data, pair.wall_s)
    pair.run()
    flown(made)
    assert made.client.system == 1


def test_a_ground_stations_heartbeat_is_no_vehicle() -> None:
    client = Client()
    made = Flight(plan(), client)
    beat = codec.message("HEARTBEAT", type=mav.MAV_TYPE_GCS, autopilot=mav.MAV_AUTOPILOT_INVALID)
    for system, component in ((255, 190), (255, 1), (3, 190), (3, 1)):
        assert not client.receive(codec.Encoder(system, component).encode(beat), 0.0)
    assert client.system is None
    assert made.phase == "connecting"
