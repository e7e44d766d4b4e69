"""Message rates and messages on request."""

import itertools
from collections.abc import Callable

import pytest
from mavlink_pair import World

from sitl.mavlink.codec import by_name, mav
from sitl.mavlink.endpoint import PortKind
from sitl.mavlink.streams import STREAMS

DENIED = mav.MAV_RESULT_DENIED


# Hz by name on the ground stations' and the onboard port: PX4's mavlink_main.cpp and px4-rc.mavlink
PX4_RATES = {
    "ATTITUDE": (50, 100),
    "ATTITUDE_QUATERNION": (50, 50),
    "ATTITUDE_TARGET": (50, 10),
    "LOCAL_POSITION_NED": (50, 30),
    "GLOBAL_POSITION_INT": (50, 50),
    "POSITION_TARGET_LOCAL_NED": (50, 10),
    "SERVO_OUTPUT_RAW": (50, 10),
    "ODOMETRY": (0, 30),
    "HIGHRES_IMU": (0, 50),
    "VFR_HUD": (4, 10),
    "ALTITUDE": (1, 10),
    "SYS_STATUS": (1, 5),
    "EXTENDED_SYS_STATE": (1, 5),
    "NAMED_VALUE_FLOAT": (3 * 1, 3 * 10),  # three names each
    "DEBUG_VECT": (3 * 1, 3 * 10),
    "HIL_STATE_QUATERNION": (0, 0),
    "SIM_STATE": (0, 0),
    "UTM_GLOBAL_POSITION": (0, 0),
}


@pytest.mark.parametrize("port", [0, 1])
def test_default_rates_are_px4s_by_port(world: World, port: int) -> None:
    station = world.station(kind=(PortKind.GCS, PortKind.ONBOARD)[port])
    station.forget()
    world.run(4.0)
    for name, rates in PX4_RATES.items():
        assert len(station.all(name)) == pytest.approx(4 * rates[port], abs=4, rel=0.02), name


def test_two_ground_stations_and_a_program_on_board_have_each_its_own_rates(world: World) -> None:
    wanted = {  # Hz
        world.station(kind=PortKind.GCS): {"ATTITUDE": 10.0, "VFR_HUD": 50.0, "GPS_RAW_INT": 20.0},
        world.station(kind=PortKind.GCS, system=254): {"ATTITUDE": 33.0, "VFR_HUD": 5.0, "ODOMETRY": 12.0},
        world.station(kind=PortKind.ONBOARD, system=245): {"ATTITUDE": 80.0, "VFR_HUD": 25.0, "SIM_STATE": 40.0},
    }
    for station, rates in wanted.items():
        for name, rate_Hz in rates.items():
            assert station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, by_name(name).id, round(1e6 / rate_Hz)) == [0]
    for station in wanted:
        station.forget()
    world.run(10.0)
    for station, rates in wanted.items():
        for name, rate_Hz in rates.items():
            assert len(station.all(name)) / 10.0 == pytest.approx(rate_Hz, rel=0.05), name
        assert not station.all("COMMAND_ACK")
        assert bool(station.all("SIM_STATE")) == ("SIM_STATE" in rates)
        numbers = [frame.sequence for frame in station.heard]
        assert all((b - a) % 256 == 1 for a, b in itertools.pairwise(numbers))


def test_a_viewer_hears_heartbeats_and_the_true_state_and_no_other_stream(make_world: Callable[..., World]) -> None:
    world = make_world(static_peers=[(PortKind.VIEWER, ("127.0.0.1", 5000))])
    viewer = world.station(kind=PortKind.VIEWER, greeting=False)
    world.run(4.0)
    assert {frame.name for frame in viewer.heard} == {"HEARTBEAT", "HIL_STATE_QUATERNION"}
    assert len(viewer.all("HIL_STATE_QUATERNION")) == pytest.approx(100, abs=2)


def test_more_streams_than_the_loop_can_bear_are_denied(world: World) -> None:
    station = world.station()
    numbers = sorted({stream.definition.id for stream in STREAMS})
    answers = [station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1000)[0] for number in numbers]
    assert answers[:3] == [0, 0, 0]
    assert answers[-3:] == [DENIED] * 3
    assert any("messages a second" in text for text in station.texts())


@pytest.mark.parametrize("name", sorted({s.definition.name for s in STREAMS} - {"ORBIT_EXECUTION_STATUS"}))
def test_every_stream_can_be_requested_and_set(world: World, name: str) -> None:
    station = world.station()
    number = by_name(name).id
    assert station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, -1) == [0]
    station.forget()
    world.run(0.3)
    assert station.all(name) == []
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, number) == [0]
    times = 3 if name in ("DEBUG_VECT", "NAMED_VALUE_FLOAT") else 1
    assert len(station.all(name)) == times
    assert station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 100_000) == [0]
    station.forget()
    world.run(1.0)
    assert len(station.all(name)) == pytest.approx(10 * times, abs=3)


def test_the_interval_in_force_is_told(world: World) -> None:
    station = world.station()
    for message_id, expected in ((30, 10_000), (115, -1), (77, 0)):
        station.forget()
        assert station.ask(mav.MAV_CMD_GET_MESSAGE_INTERVAL, message_id) == [0]
        [m] = station.all("MESSAGE_INTERVAL")
        assert (m.message_id, m.interval_us) == (message_id, expected)
    station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, 30, 40_000)
    station.forget()
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 244, 30) == [0]
    assert station.all("MESSAGE_INTERVAL")[0].interval_us == 40_000
    station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, 30, 0)
    station.forget()
    station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 244, 30)
    assert station.all("MESSAGE_INTERVAL")[0].interval_us == 10_000


@pytest.mark.parametrize(
    ("message_id", "interval"),
    [(77, 1e5), (9999, 1e5), (30, -7), (30, float("nan")), (float("nan"), 1e5), (30.5, 1e5), (30, 1e13), (-1, 0)],
)
def test_impossible_intervals_are_denied_and_change_nothing(world: World, message_id: float, interval: float) -> None:
    station = world.station()
    assert station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval) == [DENIED]
    (peer,) = world.endpoint.peers
    assert peer.schedule.interval(30) == 10_000


def test_a_data_stream_request_sets_the_rate_of_its_group(world: World) -> None:
    station = world.station()
    station.send("REQUEST_DATA_STREAM", target_system=1, req_stream_id=10, req_message_rate=5, start_stop=1)
    world.run(0.05)
    station.forget()
    world.run(2.0)
    assert len(station.all("ATTITUDE")) == pytest.approx(10, abs=1)
    assert len(station.all("LOCAL_POSITION_NED")) == pytest.approx(60, abs=2)
    station.send("REQUEST_DATA_STREAM", target_system=1, req_stream_id=0, req_message_rate=0, start_stop=0)
    world.run(0.05)
    station.forget()
    world.run(1.0)
    assert station.all("ATTITUDE") == station.all("VFR_HUD") == []
    assert station.all("SYSTEM_TIME") == []
    assert station.all("GPS_GLOBAL_ORIGIN")  # belongs to no group


def test_connecting_ground_stations_get_what_they_ask_for_or_a_refusal(world: World) -> None:
    """The order in which QGroundControl asks."""
    station = world.station(kind=PortKind.GCS)
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 148) == [0]
    [version] = station.all("AUTOPILOT_VERSION")
    assert version.flight_sw_version & 0xFF == 0  # FIRMWARE_VERSION_TYPE_DEV
    assert version.vendor_id != 0
    assert version.capabilities & mav.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    assert version.capabilities & mav.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    assert version.capabilities & mav.MAV_PROTOCOL_CAPABILITY_FTP
    assert version.capabilities & mav.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    assert version.capabilities & mav.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 300) == [0]
    assert station.all("PROTOCOL_VERSION")[0].version == 200
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 435, 0) == [0]
    modes = station.all("AVAILABLE_MODES")
    assert [m.mode_index for m in modes] == list(range(1, 9))
    assert {m.number_modes for m in modes} == {8}
    assert {m.custom_mode for m in modes} == {
        16973824,
        196608, 33816576, 50593792, 67371008, 84148224, 100925440, 393216,
    }  # fmt: skip
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 437) == [0]  # AVAILABLE_MODES_MONITOR
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 397) == [0]
    assert station.all("COMPONENT_METADATA")[0].uri.startswith("mftp://")
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 395) == [DENIED]  # COMPONENT_INFORMATION, its forerunner


def test_one_mode_may_be_asked_for_alone_and_no_mode_that_is_not_there(world: World) -> None:
    station = world.station()
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 435, 4) == [0]
    assert [m.mode_name for m in station.all("AVAILABLE_MODES")] == ["Mission"]
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 435, 9) == [DENIED]


@pytest.mark.parametrize(
    ("command", "name"),
    [(410, "HOME_POSITION"), (519, "PROTOCOL_VERSION"), (520, "AUTOPILOT_VERSION")],
)
def test_the_older_request_commands_still_work(world: World, command: int, name: str) -> None:
    station = world.station()
    station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, 242, -1)
    station.forget()
    assert station.ask(command) == [0]
    assert len(station.all(name)) == 1


@pytest.mark.parametrize("message_id", [float("nan"), -1, 77, 1e9])
def test_messages_that_cannot_be_had_are_denied(world: World, message_id: float) -> None:
    assert world.station().ask(mav.MAV_CMD_REQUEST_MESSAGE, message_id) == [DENIED]


def test_streams_start_over_when_simulation_time_is_set_back(make_world: Callable[..., World]) -> None:
    world = make_world()
    station = world.station()
    world.run(2.0)
    world.vehicle.now_us = 0
    world._simulated_us = 0.0
    station.forget()
    world.run(1.0)
    assert len(station.all("ATTITUDE")) > 90


def test_a_diverged_simulation_keeps_the_link_up(world: World) -> None:
    station = world.station()
    real = world.vehicle.snapshot
    nan = float("nan")

    def broken() -> object:
        s = real()
        return s._replace(nav=s.nav._replace(qw=nan, north_m=1e300, down_m=nan, v_east_m_s=-1e300))

    world.vehicle.snapshot = broken
    station.forget()
    world.run(1.5)
    assert station.all("HEARTBEAT")
    assert station.all("SYS_STATUS")
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [0]
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 32) == [DENIED]  # 1e300 m fit no float
