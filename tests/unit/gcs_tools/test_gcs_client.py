"""The client's pieces: texts, one-shot commands, connections as they are written, the watch line."""

import subprocess
import sys

import pytest
from gcs_tools_stand_in import Pair, StandIn

from gcs_tools import commands
from gcs_tools import plan as plans
from gcs_tools.client import Client, LinkError, Script
from gcs_tools.link import Connection, parse_connection
from gcs_tools.vehicle_state import VehicleState
from gcs_tools.watch import plain
from sitl.mavlink import codec
from sitl.mavlink.codec import mav


def run(client: Client, script: Script[str], vehicle: StandIn | None = None) -> tuple[str, StandIn]:
    vehicle = vehicle or StandIn()
    client.start(script)
    Pair(client, vehicle).run()
    if client.fault is not None:
        raise client.fault
    return client.result, vehicle


def text(content: str, identity: int = 0, piece: int = 0) -> object:
    return codec.message("STATUSTEXT", severity=4, text=content, id=identity, chunk_seq=piece)


def test_a_text_in_pieces_is_put_together() -> None:
    state = VehicleState()
    state.statustext(text("x" * 50, 9, 0), 1.0)
    assert not state.texts
    state.statustext(text("end", 9, 1), 1.0)
    assert state.texts[-1].text == "x" * 50 + "end"


def test_pieces_without_a_beginning_are_dropped() -> None:
    state = VehicleState()
    state.statustext(text("end", 9, 1), 1.0)
    state.statustext(text("whole"), 1.0)
    assert [t.text for t in state.texts] == ["whole"]


def test_the_vehicles_name_is_read_from_its_greeting() -> None:
    state = VehicleState()
    state.statustext(text("arming refused: not 'ready'"), 1.0)
    assert state.name is None
    state.statustext(text("YawSitter SITL 0.1.0: simulated 'yawsitter-real'"), 1.0)
    assert state.name == "yawsitter-real"


def test_reasons_are_those_told_since_the_question() -> None:
    state = VehicleState()
    state.statustext(text("old"), 1.0)
    state.statustext(text("new"), 2.0)
    state.statustext(text("new"), 2.1)
    assert state.reasons_since(1.5) == "new"


def test_arming_and_disarming_are_seen_in_force() -> None:
    client = Client()
    assert run(client, commands.arm(client))[0] == "armed"
    armed = StandIn()
    armed.armed = True
    client = Client()
    assert run(client, commands.disarm(client), armed)[0] == "disarmed"
    assert not armed.armed


def test_a_forced_disarming_carries_the_magic_number() -> None:
    client = Client()
    _, vehicle = run(client, commands.disarm(client, force=True))
    asked = [m for m in vehicle.commands if m.command == mav.MAV_CMD_COMPONENT_ARM_DISARM]
    assert (asked[0].param1, asked[0].param2) == (0.0, 21196.0)


def test_a_take_off_height_is_sent_as_an_altitude_above_sea_level() -> None:
    client = Client()
    said, vehicle = run(client, commands.takeoff(client, height_m=3.0, wait=False))
    asked = [m for m in vehicle.commands if m.command == mav.MAV_CMD_NAV_TAKEOFF]
    assert asked[0].param7 == pytest.approx(193.0)
    assert said == "taking off"
    assert vehicle.armed


def test_a_take_off_without_height_leaves_it_to_the_vehicle() -> None:
    client = Client()
    _, vehicle = run(client, commands.takeoff(client, height_m=None, wait=False))
    asked = [m for m in vehicle.commands if m.command == mav.MAV_CMD_NAV_TAKEOFF]
    assert asked[0].param7 != asked[0].param7


def test_a_landing_is_waited_for_until_disarmed() -> None:
    vehicle = StandIn()
    vehicle.armed, vehicle.position = True, (0.0, 0.0, -3.0)
    client = Client()
    assert run(client, commands.land(client, wait=True), vehicle)[0] == "landed and disarmed"


def test_a_refused_mode_names_the_reason() -> None:
    vehicle = StandIn()
    vehicle.refuse[mav.MAV_CMD_DO_SET_MODE] = (mav.MAV_RESULT_DENIED, "offboard refused: no targets")
    client = Client()
    with pytest.raises(LinkError, match=r"^mode offboard: refused by the vehicle: offboard refused: no targets$"):
        run(client, commands.mode(client, "offboard"), vehicle)


def test_a_mission_is_handed_over_and_started_on_the_ground_and_in_the_air() -> None:
    plan = plans.load("missions/rectangle-mission.yaml")
    for armed in (False, True):
        vehicle = StandIn()
        vehicle.armed = armed
        client = Client()
        assert run(client, commands.mission(client, plan), vehicle)[0] == "mission rectangle-mission under way"
        assert len(vehicle.items) == len(plan.items)
        assert vehicle.mode == "mission"
        assert vehicle.armed


def test_a_mission_drawn_for_another_town_stays_on_the_ground() -> None:
    plan = plans.load("missions/rectangle-mission.plan")
    client, vehicle = Client(), StandIn()
    with pytest.raises(LinkError, match=r"the plan's home is .* km from the vehicle's"):
        run(client, commands.mission(client, plan._replace(home=plans.Home(0.0, 0.0, 0.0))), vehicle)
    assert not vehicle.items
    assert not vehicle.armed


def test_a_vehicle_that_knows_no_fences_is_not_given_a_mission_that_has_one() -> None:
    client, vehicle = Client(), StandIn()
    with pytest.raises(LinkError, match="the download of the fence isn't answered"):
        run(client, commands.mission(client, plans.load("missions/rectangle-fenced.yaml")), vehicle)
    assert not vehicle.items
    assert not vehicle.armed


def test_the_newest_value_of_a_parameter_is_known_whoever_changed_it() -> None:
    client, vehicle = Client(), StandIn()
    run(client, client.connect(), vehicle)
    vehicle.parameters["RATE_Y_P"] = 0.75
    vehicle._value("RATE_Y_P")
    Pair(client, vehicle).turn()
    assert client.vehicle.parameters["RATE_Y_P"].value == 0.75


def test_a_vehicle_still_booting_is_waited_for() -> None:
    client, vehicle = Client(), StandIn()
    client.start(client.connect())
    client.poll(0.0)
    booting = codec.message("HEARTBEAT", autopilot=mav.MAV_AUTOPILOT_PX4, system_status=mav.MAV_STATE_BOOT)
    for k in range(10):
        client.receive(vehicle.encoder.encode(booting), float(k))
        client.poll(float(k))
    assert not client.finished
    vehicle.beat()
    for data in vehicle.turn(0.0):
        client.receive(data, 10.0)
    client.poll(10.0)
    assert client.finished
    assert client.fault is None


def test_garbage_and_other_peoples_acks_are_left_alone() -> None:
    client = Client()
    client.start(commands.arm(client))
    vehicle, pair = StandIn(), None
    vehicle.unanswered[mav.MAV_CMD_COMPONENT_ARM_DISARM] = 99
    pair = Pair(client, vehicle)
    pair.run(lambda: len(vehicle.commands) >= 1)
    command = mav.MAV_CMD_COMPONENT_ARM_DISARM
    foreign = codec.message("COMMAND_ACK", command=command, result=0, target_system=255, target_component=190)
    client.receive(vehicle.encoder.encode(foreign), pair.wall_s)
    client.receive(b"\xfd\x00garbage" * 9, pair.wall_s)
    pair.run()
    assert str(client.fault) == "the vehicle doesn't answer COMPONENT_ARM_DISARM"


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("udpin:127.0.0.1:14550", Connection(True, "127.0.0.1", 14550)),
        ("udpout:vehicle.local:18570", Connection(False, "vehicle.local", 18570)),
    ],
)
def test_a_connection_is_read(written: str, meant: Connection) -> None:
    assert parse_connection(written) == meant


@pytest.mark.parametrize("written", ["tcp:127.0.0.1:1", "udpin:14550", "udpin::14550", "udpin:h:0", "udpin:h:70000"])
def test_a_connection_that_is_none_says_what_is_allowed(written: str) -> None:
    with pytest.raises(ValueError, match=r"is not udpin:HOST:PORT or udpout:HOST:PORT"):
        parse_connection(written)


def test_the_watch_line_shows_mode_place_and_angles() -> None:
    client, vehicle = Client(), StandIn()
    vehicle.position = (1.0, 2.0, -3.0)
    vehicle.intervals = {"LOCAL_POSITION_NED": 20_000, "DEBUG_VECT": 100_000, "SYS_STATUS": 100_000}
    client.start(plain.until(client, 1.0))
    Pair(client, vehicle).run()
    line = plain.line(client)
    for part in ("mode: hold, disarmed", "north 1.000 east 2.000 down -3.000 m", "95.00°", "11.00 N", "ready: yes"):
        assert part in line


@pytest.mark.parametrize("module", ["fly", "tasks", "watch.run"])
def test_a_client_starts_without_the_vehicles_compiler(module: str) -> None:
    code = f"import sys, gcs_tools.{module}; print('numba' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert out.stdout == "False\n"
