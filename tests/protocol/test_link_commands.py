"""Commands: what each does, and that each is answered exactly once."""

import math
from typing import Any

import pytest
from mavlink_pair import Station, Wire, World

from sitl.geodesy import GeoPoint, to_global
from sitl.mavlink.actions import TABLE
from sitl.mavlink.codec import mav
from sitl.mavlink.identity import Identity
from sitl.onboard.modes import Landed, Mode
from sitl.onboard.plan import MissionItem
from sitl.vehicle_spec import VehicleSpec

NAN = math.nan
ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
UNSUPPORTED_FRAME = 9

ALL_COMMANDS = sorted(
    value
    for name, value in vars(mav).items()
    if name.startswith("MAV_CMD_") and isinstance(value, int) and not name.endswith("ENUM_END")
)
WAYPOINT = MissionItem(3, 16, 0, 1, 0.0, 0.5, 0.0, NAN, 556985000, 373595000, 5.0)


def ask_int(world: World, station: Station, command: int, **fields: Any) -> list[int]:
    """COMMAND_INT; the results of its acknowledgements."""
    station.forget()
    station.send("COMMAND_INT", target_system=1, target_component=1, command=command, **fields)
    world.run(0.05)
    return [ack.result for ack in station.all("COMMAND_ACK") if ack.command == command]


@pytest.mark.parametrize("form", ["COMMAND_LONG", "COMMAND_INT"])
def test_every_command_there_is_gets_exactly_one_terminal_answer(world: World, form: str) -> None:
    station = world.station()
    for command in ALL_COMMANDS:
        station.forget()
        station.send(form, target_system=1, target_component=1, command=command)
        world.step()
        acks = station.all("COMMAND_ACK")
        assert [ack.command for ack in acks] == [command]
        assert acks[0].result in (ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED, UNSUPPORTED_FRAME), command
        if command not in TABLE:
            assert acks[0].result == UNSUPPORTED, command


@pytest.mark.parametrize("command", [mav.MAV_CMD_DO_VTOL_TRANSITION, mav.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, 84, 65535])
def test_what_is_not_done_is_unsupported(world: World, command: int) -> None:
    assert world.station().ask(command, 1) == [UNSUPPORTED]


def test_arming_and_disarming(world: World) -> None:
    station = world.station()
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]
    assert world.vehicle.commander.armed
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0) == [ACCEPTED]
    assert not world.vehicle.commander.armed


def test_disarming_in_the_air_needs_force(world: World) -> None:
    station = world.station()
    world.take_off(station)
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0) == [REJECTED]
    assert world.vehicle.commander.armed
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196) == [ACCEPTED]
    assert not world.vehicle.commander.armed


@pytest.mark.parametrize("params", [(2,), (NAN,), (-1,), (1, 5), (1, math.inf), (1, 0, 7)])
def test_arming_with_parameters_that_mean_nothing_is_denied(world: World, params: tuple[float, ...]) -> None:
    station = world.station()
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, *params) == [DENIED]
    assert not world.vehicle.commander.armed
    assert station.texts()[-1]


def test_unset_parameters_may_be_not_a_number(world: World) -> None:
    assert world.station().ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1, NAN, NAN, NAN, NAN, NAN, NAN) == [ACCEPTED]


MODES = {
    Mode.POSITION: (3, 0),
    Mode.TAKEOFF: (4, 2),
    Mode.HOLD: (4, 3),
    Mode.RETURN: (4, 5),
    Mode.LAND: (4, 6),
}


@pytest.mark.parametrize("mode", MODES)
def test_modes_are_set_in_both_forms_of_the_command_and_by_message(world: World, mode: Mode) -> None:
    main, sub = MODES[mode]
    packed = main << 16 | sub << 24
    station = world.station()
    other = 33816576 if mode is not Mode.TAKEOFF else 50593792
    for request in ("two numbers", "packed", "message"):
        station.ask(mav.MAV_CMD_DO_SET_MODE, 1, other)
        assert world.vehicle.commander.mode is not mode
        if request == "two numbers":
            assert station.ask(mav.MAV_CMD_DO_SET_MODE, 1, main, sub) == [ACCEPTED]
        elif request == "packed":
            assert station.ask(mav.MAV_CMD_DO_SET_MODE, 1, packed) == [ACCEPTED]
        else:
            station.forget()
            station.send("SET_MODE", target_system=1, base_mode=1, custom_mode=packed)
            world.run(0.05)
            assert station.all("COMMAND_ACK") == []
        assert world.vehicle.commander.mode is mode
        assert [m.custom_mode for m in station.all("HEARTBEAT")][-1] == packed
        assert [m.custom_mode for m in station.all("CURRENT_MODE")][-1] == packed


@pytest.mark.parametrize("params", [(1, 9), (1, 4, 77), (0, 4, 3), (1, -3), (1, 4, 2.5), (1, 1e12), (81,)])
def test_modes_that_are_not_there_are_denied(world: World, params: tuple[float, ...]) -> None:
    station = world.station()
    assert station.ask(mav.MAV_CMD_DO_SET_MODE, *params) == [DENIED]
    assert world.vehicle.commander.mode is Mode.HOLD


def test_a_refused_set_mode_message_is_explained_in_a_text(world: World) -> None:
    station = world.station()
    station.send("SET_MODE", target_system=1, base_mode=1, custom_mode=9 << 16)
    world.run(0.05)
    assert any("9/0" in text for text in station.texts())


def test_offboard_without_a_stream_is_denied_with_one_text_that_says_so(world: World) -> None:
    station = world.station()
    station.forget()
    assert station.ask(mav.MAV_CMD_DO_SET_MODE, 1, 6) == [DENIED]
    assert len([text for text in station.texts() if "no target" in text]) == 1


@pytest.mark.parametrize(
    ("standard", "mode"), [(1, Mode.POSITION), (5, Mode.RETURN), (7, Mode.LAND), (8, Mode.TAKEOFF)]
)
def test_standard_modes_are_the_vehicles_own(world: World, standard: int, mode: Mode) -> None:
    assert world.station().ask(mav.MAV_CMD_DO_SET_STANDARD_MODE, standard) == [ACCEPTED]
    assert world.vehicle.commander.mode is mode


@pytest.mark.parametrize("standard", [0, 2, 3, 4, 99, NAN])
def test_standard_modes_that_the_vehicle_has_not_are_denied(world: World, standard: float) -> None:
    assert world.station().ask(mav.MAV_CMD_DO_SET_STANDARD_MODE, standard) == [DENIED]


@pytest.mark.parametrize("height", [2.0, None])
def test_take_off_climbs_to_the_altitude_above_the_sea_or_to_the_default(world: World, height: float | None) -> None:
    """As QGroundControl sends it (before arming, AMSL), and as MAVSDK does (NaN)."""
    station = world.station()
    home = world.vehicle.commander.home.alt_amsl_m
    amsl = home + height if height is not None else NAN
    assert station.ask(mav.MAV_CMD_NAV_TAKEOFF, -1, 0, 0, NAN, NAN, NAN, amsl) == [ACCEPTED]
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]
    world.speed = 10.0
    world.run_until(lambda: world.vehicle.commander.mode is Mode.HOLD, 5.0)
    world.run(0.2)
    wanted = height if height is not None else world.vehicle.parameters["MIS_TAKEOFF_ALT"]
    assert -world.vehicle.snapshot().nav.down_m == pytest.approx(wanted, abs=0.1)


@pytest.mark.parametrize(("frame", "z"), [(5, 192.0), (0, 192.0), (6, 2.0), (3, 2.0), (11, 2.0), (1, -2.0)])
def test_take_off_as_command_int_obeys_its_frame(world: World, frame: int, z: float) -> None:
    station = world.station()
    taken: list[Any] = []
    world.vehicle.commander.takeoff = lambda *args: taken.append(args) or world.vehicle.commander.hold()
    unset = 2**31 - 1
    fields = {"param4": NAN, "x": unset, "y": unset, "z": z, "frame": frame}
    assert ask_int(world, station, mav.MAV_CMD_NAV_TAKEOFF, **fields) == [ACCEPTED]
    assert taken == [(pytest.approx(192.0), None)]


def test_a_frame_that_is_not_known_is_named_as_the_reason(world: World) -> None:
    station = world.station()
    assert ask_int(world, station, mav.MAV_CMD_NAV_TAKEOFF, frame=20) == [UNSUPPORTED_FRAME]


def test_take_off_and_landing_elsewhere_are_denied(world: World) -> None:
    station = world.station()
    lat, lon = to_global(world.vehicle.commander.origin, 500.0, 0.0)
    assert station.ask(mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, lat, lon, 200.0) == [DENIED]
    assert station.ask(mav.MAV_CMD_NAV_LAND, 0, 0, 0, NAN, lat, lon, 0) == [DENIED]
    assert station.ask(mav.MAV_CMD_NAV_LAND, 0, 0, 0, NAN, 91.0, lon, 0) == [DENIED]
    lat, lon = to_global(world.vehicle.commander.origin, 0.0, 0.0)
    assert station.ask(mav.MAV_CMD_NAV_LAND, 0, 0, 0, NAN, lat, lon, 0) == [ACCEPTED]


@pytest.mark.parametrize("command", [mav.MAV_CMD_NAV_LAND, mav.MAV_CMD_NAV_RETURN_TO_LAUNCH])
def test_land_and_return_change_the_mode(world: World, command: int) -> None:
    station = world.station()
    world.take_off(station)
    assert station.ask(command) == [ACCEPTED]
    assert world.vehicle.commander.mode in (Mode.LAND, Mode.RETURN)
    world.speed = 10.0
    world.run_until(lambda: not world.vehicle.commander.armed, 10.0)
    assert [m.landed_state for m in station.all("EXTENDED_SYS_STATE")][-1] == 1
    assert world.vehicle.commander.landed is Landed.ON_GROUND


def test_reposition_flies_to_the_point_in_both_forms_and_every_frame(world: World) -> None:
    station = world.station()
    world.take_off(station)
    commander = world.vehicle.commander
    asked: list[Any] = []
    commander.guided.reposition = lambda point, *args: asked.append((*point, *args)) or commander.hold()
    lat, lon = to_global(commander.origin, 30.0, -20.0)
    x, y = round(lat * 1e7), round(lon * 1e7)
    command = mav.MAV_CMD_DO_REPOSITION
    for frame, z in ((5, 194.0), (6, 4.0), (0, 194.0), (3, 4.0), (10, 4.0)):
        fields = {"param1": -1, "param2": 1, "param4": 1.5, "x": x, "y": y, "z": z, "frame": frame}
        assert ask_int(world, station, command, **fields) == [ACCEPTED]
    assert ask_int(world, station, command, param2=1, param4=1.5, x=300000, y=-200000, z=-4.0, frame=1) == [ACCEPTED]
    for north, east, down, heading, speed in asked:
        assert (north, east, down) == pytest.approx((30.0, -20.0, -4.0), abs=0.02)
        assert (heading, speed) == (1.5, None)
    asked.clear()
    assert station.ask(command, 2.5, 1, 0, NAN, lat, lon, 194.0) == [ACCEPTED]
    north, east, down, heading, speed = asked[0]
    assert (north, east, down) == pytest.approx((30.0, -20.0, -4.0), abs=0.5)  # a float's latitude
    assert (heading, speed) == (None, 2.5)


def test_reposition_without_any_position_is_a_pause(world: World) -> None:
    """QGroundControl's pause."""
    station = world.station()
    world.take_off(station)
    station.ask(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    assert station.ask(mav.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, NAN, NAN, NAN) == [ACCEPTED]
    assert world.vehicle.commander.mode is Mode.HOLD


@pytest.mark.parametrize("unset", [0.0, NAN])
def test_loitering_nowhere_in_particular_is_hold(world: World, unset: float) -> None:
    station = world.station()
    station.ask(mav.MAV_CMD_DO_SET_MODE, 1, 4, 5)
    assert station.ask(mav.MAV_CMD_NAV_LOITER_UNLIM, *(unset,) * 7) == [
        ACCEPTED
    ]  # as scripts send it, on the ground too
    assert world.vehicle.commander.mode is Mode.HOLD


def test_reposition_with_an_altitude_alone_keeps_the_place(world: World) -> None:
    station = world.station()
    world.take_off(station)
    home = world.vehicle.commander.home.alt_amsl_m
    assert station.ask(mav.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, NAN, NAN, home + 4.0) == [ACCEPTED]
    world.speed = 10.0
    world.run(1.0)
    nav = world.vehicle.snapshot().nav
    assert (nav.north_m, nav.east_m, nav.down_m) == pytest.approx((0.0, 0.0, -4.0), abs=0.2)


def test_reposition_outside_hold_needs_the_change_of_mode(world: World) -> None:
    station = world.station()
    world.take_off(station)
    station.ask(mav.MAV_CMD_NAV_LAND)
    assert station.ask(mav.MAV_CMD_DO_REPOSITION, -1, 0, 0, NAN, NAN, NAN, 195.0) == [REJECTED]
    assert world.vehicle.commander.mode is Mode.LAND


def test_a_relative_yaw_turns_from_the_present_heading(world: World) -> None:
    station = world.station()
    world.take_off(station)
    asked: list[Any] = []
    commander = world.vehicle.commander
    commander.guided.reposition = lambda point, *args: asked.append((*point, *args)) or commander.hold()
    yaw = world.endpoint._link.view().attitude.yaw
    station.ask(mav.MAV_CMD_DO_REPOSITION, -1, 3, 0, 0.5, NAN, NAN, NAN)
    assert asked[0][3] == pytest.approx(yaw + 0.5, abs=1e-3)


def test_pause_and_continue(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace([WAYPOINT])
    assert station.ask(mav.MAV_CMD_DO_PAUSE_CONTINUE, 1) == [ACCEPTED]
    assert world.vehicle.commander.mode is Mode.MISSION
    assert station.ask(mav.MAV_CMD_DO_PAUSE_CONTINUE, 0) == [ACCEPTED]
    assert world.vehicle.commander.mode is Mode.HOLD
    assert station.ask(mav.MAV_CMD_DO_PAUSE_CONTINUE, NAN) == [DENIED]


def test_a_mission_starts_from_the_item_asked_for(world: World) -> None:
    station = world.station()
    assert station.ask(mav.MAV_CMD_MISSION_START, 0, 0) == [REJECTED]
    world.vehicle.mission.replace([WAYPOINT] * 4)
    assert station.ask(mav.MAV_CMD_MISSION_START, 2, 3) == [ACCEPTED]
    assert world.vehicle.mission.current == 2
    for params in ((9, 0), (-1, 0), (1.5, 0), (0, 1)):
        assert station.ask(mav.MAV_CMD_MISSION_START, *params) == [DENIED]


def test_the_current_item_is_set_and_told_at_once(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace([WAYPOINT] * 4)
    world.run(0.05)
    station.forget()
    assert station.ask(mav.MAV_CMD_DO_SET_MISSION_CURRENT, 3) == [ACCEPTED]
    assert station.all("MISSION_CURRENT")[0].seq == 3
    assert station.ask(mav.MAV_CMD_DO_SET_MISSION_CURRENT, -1, 1) == [ACCEPTED]
    assert world.vehicle.mission.current == 3
    assert station.ask(mav.MAV_CMD_DO_SET_MISSION_CURRENT, 4) == [FAILED]
    assert station.ask(mav.MAV_CMD_DO_SET_MISSION_CURRENT, 1.5) == [DENIED]
    assert station.ask(mav.MAV_CMD_DO_SET_MISSION_CURRENT, 1, 5) == [DENIED]


def test_speed_is_changed_kept_or_taken_back_to_the_default(world: World) -> None:
    station = world.station()
    asked: list[float] = []
    world.vehicle.commander.change_speed = lambda speed: asked.append(speed) or world.vehicle.commander.hold()
    for params in ((1, 2.0, -1), (0, -1, -1), (1, -2, NAN)):
        assert station.ask(mav.MAV_CMD_DO_CHANGE_SPEED, *params) == [ACCEPTED]
    assert asked == [2.0, world.vehicle.parameters["MPC_XY_CRUISE"]]
    for params in ((2, 1.0), (1, 0.0), (1, -5.0), (1, 2.0, 50.0)):
        assert station.ask(mav.MAV_CMD_DO_CHANGE_SPEED, *params) == [DENIED]


def test_home_is_set_here_or_there_and_told_at_once(world: World) -> None:
    station = world.station()
    origin = world.vehicle.commander.origin
    lat, lon = to_global(origin, 12.0, 7.0)
    x, y = round(lat * 1e7), round(lon * 1e7)
    station.forget()
    fields = {"param4": 90.0, "x": x, "y": y, "z": 193.0, "frame": 5}
    assert ask_int(world, station, mav.MAV_CMD_DO_SET_HOME, **fields) == [ACCEPTED]
    home = station.all("HOME_POSITION")[0]
    assert (home.latitude, home.longitude, home.altitude) == (x, y, 193_000)
    assert (home.x, home.y, home.z) == pytest.approx((12.0, 7.0, -3.0), abs=0.02)
    assert home.q == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)), abs=1e-5)
    assert station.ask(mav.MAV_CMD_DO_SET_HOME, 1) == [ACCEPTED]
    assert world.vehicle.commander.home.lat_deg == pytest.approx(origin.lat_deg)
    assert station.ask(mav.MAV_CMD_DO_SET_HOME, 0, 0, 0, 0, NAN, NAN, NAN) == [DENIED]
    assert station.ask(mav.MAV_CMD_DO_SET_HOME, 0, 0, 0, 0, 95.0, 10.0, 0.0) == [DENIED]
    assert station.ask(mav.MAV_CMD_DO_SET_HOME, 7, 0, 0, 0, lat, lon, 0.0) == [DENIED]


@pytest.mark.parametrize(
    ("identity", "frame", "altitude_m"),
    [(Identity.PX4, 3, 195.0), (Identity.PX4, 6, 385.0), (Identity.GENERIC, 3, 385.0)],
)
def test_mavsdk_s_home_above_the_sea_in_a_relative_frame_is_read_as_a_px4_does(
    spec: VehicleSpec, identity: Identity, frame: int, altitude_m: float
) -> None:
    world = World(spec, identity=identity)
    fields = {"x": 556_985_000, "y": 373_595_000, "z": 195.0, "frame": frame}
    assert ask_int(world, world.station(), mav.MAV_CMD_DO_SET_HOME, **fields) == [ACCEPTED]
    assert world.vehicle.commander.home.alt_amsl_m == pytest.approx(altitude_m)


def test_prearm_checks_are_run_and_their_failure_told(world: World) -> None:
    station = world.station()
    assert station.ask(mav.MAV_CMD_RUN_PREARM_CHECKS) == [ACCEPTED]
    world.vehicle.parameters.set("GF_MAX_HOR_DIST", 10.0)
    world.vehicle.commander.set_home(GeoPoint(55.7, 37.3595, 190.0))
    station.forget()
    assert station.ask(mav.MAV_CMD_RUN_PREARM_CHECKS) == [ACCEPTED]
    assert any("outside the fence" in text for text in station.texts())
    world.vehicle.commander.set_home(None)
    station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert station.ask(mav.MAV_CMD_RUN_PREARM_CHECKS) == [REJECTED]


def test_flight_termination_can_be_asked_about_and_done(world: World) -> None:
    station = world.station()
    world.take_off(station)
    assert station.ask(mav.MAV_CMD_DO_FLIGHTTERMINATION, 0) == [FAILED]
    assert world.vehicle.commander.armed
    assert station.ask(mav.MAV_CMD_DO_FLIGHTTERMINATION, 1) == [ACCEPTED]
    assert not world.vehicle.commander.armed


def test_reboot_and_shutdown_are_requested_only_while_disarmed(world: World) -> None:
    station, endpoint = world.station(), world.endpoint
    station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert station.ask(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == [REJECTED]
    assert not endpoint.reboot_requested
    station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    assert station.ask(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 0) == [ACCEPTED]
    assert station.ask(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 3) == [DENIED]
    assert not endpoint.reboot_requested
    assert not endpoint.shutdown_requested
    assert station.ask(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == [ACCEPTED]
    assert endpoint.reboot_requested
    assert not endpoint.shutdown_requested
    assert station.ask(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 2) == [ACCEPTED]
    assert endpoint.shutdown_requested


def test_storage_resets_parameters_and_mission_while_disarmed(world: World) -> None:
    station, p = world.station(), world.vehicle.parameters
    p.set("RTL_RETURN_ALT", 9.0)
    world.vehicle.mission.replace([WAYPOINT])
    for params in ((0, 0), (1, 1), (-1, -1)):
        assert station.ask(mav.MAV_CMD_PREFLIGHT_STORAGE, *params) == [ACCEPTED]
    assert p["RTL_RETURN_ALT"] == 9.0
    assert station.ask(mav.MAV_CMD_PREFLIGHT_STORAGE, 2) == [ACCEPTED]
    assert p["RTL_RETURN_ALT"] == 5.0
    assert world.vehicle.mission.items
    assert station.ask(mav.MAV_CMD_PREFLIGHT_STORAGE, -1, 2) == [ACCEPTED]
    assert not world.vehicle.mission.items
    assert station.ask(mav.MAV_CMD_PREFLIGHT_STORAGE, 9) == [DENIED]
    station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    assert station.ask(mav.MAV_CMD_PREFLIGHT_STORAGE, 2) == [REJECTED]


def test_a_repetition_is_answered_again_but_not_carried_out_again(world: World) -> None:
    station = world.station()
    calls: list[int] = []
    arm = world.vehicle.commander.arm
    world.vehicle.commander.arm = lambda force=False: calls.append(1) or arm(force)
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]
    for confirmation in (1, 2, 3):
        assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1, confirmation=confirmation) == [ACCEPTED]
    assert len(calls) == 1


def test_a_repetition_with_other_parameters_or_after_a_while_is_a_new_command(world: World) -> None:
    station = world.station()
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [ACCEPTED]
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, confirmation=1) == [ACCEPTED]
    assert not world.vehicle.commander.armed
    world.run(11.0)
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, confirmation=1) == [ACCEPTED]
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1, confirmation=1) == [ACCEPTED]
    assert world.vehicle.commander.armed


def test_a_repeated_request_sends_its_message_again(world: World) -> None:
    station = world.station()
    station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 148)
    station.forget()
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 148, confirmation=1) == [ACCEPTED]
    assert len(station.all("AUTOPILOT_VERSION")) == 1


def test_the_same_refusal_is_explained_once_and_not_with_every_repetition(world: World) -> None:
    station = world.station()
    station.forget()
    for _ in range(10):
        station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 5)
    assert len([text for text in station.texts() if text.startswith("Arming")]) == 1
    world.run(5.0)
    station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 5)
    assert len([text for text in station.texts() if text.startswith("Arming")]) == 2


@pytest.mark.parametrize("command", sorted(TABLE))
@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_infinite_parameters_are_denied(world: World, command: int, value: float) -> None:
    station = world.station()
    for index in range(7):
        params = [0.0] * 7
        params[index] = value
        assert station.ask(command, *params) == [DENIED]


def test_commands_of_a_lossy_link_arrive_with_repetitions(world: World) -> None:
    up, down = Wire(drop=0.3, duplicate=0.2, jitter_s=0.05, seed=3), Wire(drop=0.3, jitter_s=0.05, seed=4)
    station = world.station(up=up, down=down)
    for wanted in (1, 0, 1, 0):
        station.forget()
        for confirmation in range(20):
            station.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, wanted, confirmation=confirmation)
            world.run(0.2)
            if station.all("COMMAND_ACK"):
                break
        assert world.vehicle.commander.armed == bool(wanted)
