"""pymavlink's own helpers (mavutil, mavparm, mavwp, mavftp, signing) against the real daemon over UDP."""

import contextlib
import json
import lzma
import math
import os
import time
from collections.abc import Iterator

import pytest
from recorded import Running, recorded

os.environ.setdefault("MAVLINK20", "1")
from pymavlink import mavftp, mavparm, mavutil, mavwp

pytestmark = pytest.mark.e2e

SPEED = 5
ANSWER_S = 20.0
REPEAT_S = 2.0
ACCEPTED = mavutil.mavlink.MAV_RESULT_ACCEPTED
SET_MODE, START = mavutil.mavlink.MAV_CMD_DO_SET_MODE, mavutil.mavlink.MAV_CMD_MISSION_START
ARM, REBOOT = mavutil.mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavutil.mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN


def connect(running: Running) -> mavutil.mavudp:
    """As a script does: a connection that knows its vehicle."""
    link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{running.port}", dialect="common", source_system=250)
    until(
        lambda: (beat(link), link.wait_heartbeat(timeout=0.5), link.target_system == running.instance + 1)[-1],
        "heartbeat",
    )
    link.mav.request_data_stream_send(*target(link), mavutil.mavlink.MAV_DATA_STREAM_ALL, 4, 1)
    return link


def beat(link) -> None:
    link.mav.heartbeat_send(mavutil.mavlink.MAV_TYPE_GCS, mavutil.mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)


def until(condition, what: str) -> None:
    end_s = time.monotonic() + ANSWER_S
    while not condition():
        assert time.monotonic() < end_s, f"not within {ANSWER_S:g} s: {what}"


@pytest.fixture(scope="module")
def running(tmp_path_factory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("pymavlink")
    with recorded("pymavlink", folder, "--speed", str(SPEED), onboard=True) as running:
        yield running


@pytest.fixture(scope="module")
def shared(running) -> Iterator[mavutil.mavudp]:
    with contextlib.closing(connect(running)) as link:
        yield link


@pytest.fixture
def link(shared):
    """The connection, with nothing left in it of what came while nobody read."""
    beat(shared)
    while shared.recv_match(blocking=False):
        pass
    return shared


def heard(link, kind: str, limit_s: float = ANSWER_S, **fields):
    """The next message of a kind with these fields."""
    end_s = time.monotonic() + limit_s
    while time.monotonic() < end_s:
        beat(link)
        m = link.recv_match(type=kind, blocking=True, timeout=0.5)
        if m is not None and all(getattr(m, name) == value for name, value in fields.items()):
            return m
    raise AssertionError(f"no {kind} with {fields} in {limit_s:g} s")


def asked(link, send, kind: str, **fields):
    """The answer to what `send` sends, which is repeated: datagrams get lost on a busy machine."""
    for _ in range(round(ANSWER_S / REPEAT_S)):
        send()
        with contextlib.suppress(AssertionError):
            return heard(link, kind, REPEAT_S, **fields)
    raise AssertionError(f"no {kind} with {fields} in {ANSWER_S:g} s")


def command(link, number: int, *params: float) -> int:
    """COMMAND_LONG; its result."""
    return acknowledged(link, number, lambda: link.mav.command_long_send(*target(link), number, 0, *seven(params)))


def acknowledged(link, number: int, send) -> int:
    return asked(link, send, "COMMAND_ACK", command=number).result


def target(link) -> tuple[int, int]:
    return link.target_system, link.target_component


def seven(params: tuple[float, ...]) -> tuple[float, ...]:
    return (*params, *(0.0,) * (7 - len(params)))


def in_mode(link, name: str) -> None:
    until(lambda: (beat(link), link.wait_heartbeat(timeout=1.0), link.flightmode == name)[-1], f"mode {name}")


def test_the_heartbeat_tells_whom_to_speak_to_and_the_mode_by_name(link) -> None:
    assert link.target_system == link.sysid
    assert link.flightmode == "LOITER"
    assert link.mode_mapping()["LOITER"][1:] == (4, 3)


def test_modes_are_set_by_name_and_by_helper(link) -> None:
    for name in ("RTL", "LOITER"):
        assert acknowledged(link, SET_MODE, lambda name=name: link.set_mode(name)) == ACCEPTED
        in_mode(link, name)
    assert acknowledged(link, mavutil.mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, link.set_mode_rtl) == ACCEPTED
    in_mode(link, "RTL")
    assert acknowledged(link, mavutil.mavlink.MAV_CMD_NAV_LOITER_UNLIM, link.set_mode_loiter) == ACCEPTED
    in_mode(link, "LOITER")


def test_all_parameters_are_fetched(link) -> None:
    total = asked(link, link.param_fetch_all, "PARAM_VALUE").param_count
    assert total > 70

    def complete() -> bool:
        link.recv_match(type="PARAM_VALUE", blocking=True, timeout=1.0)
        beat(link)
        link.param_fetch_all()  # does nothing within 2 s
        return len([name for name in link.params if not name.startswith("_")]) == total

    until(complete, "all parameters")
    read = asked(link, lambda: link.param_fetch_one("POS_X_P"), "PARAM_VALUE", param_id="POS_X_P")
    assert read.param_value == link.params["POS_X_P"]


def test_parameters_are_set_saved_and_loaded_by_mavparm(link, tmp_path) -> None:
    values, path = mavparm.MAVParmDict(), str(tmp_path / "gains.parm")
    integer = mavutil.mavlink.MAV_PARAM_TYPE_INT32
    assert values.mavset(link, "POS_X_P", 1.25)
    assert values.mavset(link, "COM_OBL_RC_ACT", 4, parm_type=integer)
    read = asked(link, lambda: link.param_fetch_one("COM_OBL_RC_ACT"), "PARAM_VALUE", param_id="COM_OBL_RC_ACT")
    assert read.param_type == integer
    values.save(path, wildcard="POS_*")
    assert values.mavset(link, "POS_X_P", 2.0)
    loaded = mavparm.MAVParmDict()
    assert loaded.load(path, mav=link, check=False)
    read = asked(link, lambda: link.param_fetch_one("POS_X_P"), "PARAM_VALUE", param_id="POS_X_P")
    assert read.param_value == 1.25


def test_it_arms_takes_off_and_knows_where_it_is(link) -> None:
    assert acknowledged(link, ARM, link.arducopter_arm) == ACCEPTED
    link.motors_armed_wait()
    unset = math.nan
    assert command(link, mavutil.mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, unset, unset, unset, unset) == ACCEPTED
    until(lambda: (beat(link), link.location(relative_alt=True).alt > 2.4)[-1], "take-off height")
    assert link.location().alt == pytest.approx(192.5, abs=0.3)
    assert link.location().lat == pytest.approx(55.6985, abs=1e-5)


def test_a_plan_goes_up_by_mavwp_and_is_flown_to_its_landing(link, tmp_path) -> None:
    plan = mavwp.MAVWPLoader(*target(link))
    mavlink = mavutil.mavlink
    for number, north_m, height_m in ((16, 3.0, 3.0), (16, 0.0, 3.0), (21, 0.0, 0.0)):
        lat, frame = 55.6985 + north_m / 111_319.5, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
        item = (number, 0, 1, 0.0, 0.5 if number == 16 else 0.0, 0.0, math.nan, lat, 37.3595, height_m)
        plan.add(mavlink.MAVLink_mission_item_message(*target(link), plan.count(), frame, *item))
    assert asked(link, link.waypoint_clear_all_send, "MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    asked(link, lambda: link.waypoint_count_send(plan.count()), "MISSION_REQUEST_INT", seq=0)
    for seq in range(1, plan.count()):
        asked(link, lambda seq=seq: link.mav.send(plan.wp(seq - 1)), "MISSION_REQUEST_INT", seq=seq)
    last = asked(link, lambda: link.mav.send(plan.wp(plan.count() - 1)), "MISSION_ACK")
    assert last.type == mavlink.MAV_MISSION_ACCEPTED

    assert asked(link, link.waypoint_request_list_send, "MISSION_COUNT").count == plan.count()
    for seq in range(plan.count()):
        item = asked(link, lambda seq=seq: link.waypoint_request_send(seq), "MISSION_ITEM_INT", seq=seq)
        assert item.x == pytest.approx(plan.wp(seq).x * 1e7, abs=20)  # its floats resolve no more
    link.mav.mission_ack_send(*target(link), mavlink.MAV_MISSION_ACCEPTED)

    asked(link, lambda: link.waypoint_set_current_send(1), "MISSION_CURRENT", seq=1)
    assert acknowledged(link, START, link.set_mode_auto) == ACCEPTED
    in_mode(link, "MISSION")
    link.motors_disarmed_wait()
    assert link.location(relative_alt=True).alt == pytest.approx(0.0, abs=0.2)


def test_files_are_listed_and_read_by_mavftp(link, tmp_path) -> None:
    ftp = mavftp.MAVFTP(link, link.target_system, link.target_component)
    assert ftp.cmd_list(["/"]).error_code == mavftp.FtpError.Success
    assert "metadata" in [entry.name for entry in ftp.list_result]
    listed = ftp.cmd_list(["/metadata"])
    assert listed.error_code == mavftp.FtpError.Success
    names = [entry.name for entry in ftp.list_result if not entry.is_dir]
    assert names
    for name in names:
        local = tmp_path / name
        assert ftp.cmd_get([f"/metadata/{name}", str(local)]).error_code == mavftp.FtpError.Success
        assert ftp.process_ftp_reply("OpenFileRO").error_code == mavftp.FtpError.Success
        assert local.stat().st_size > 0
    parameters = json.loads(lzma.decompress((tmp_path / "parameter.json.xz").read_bytes()))
    assert "POS_X_P" in {entry["name"] for entry in parameters["parameters"]}


def test_it_reboots_at_the_helper_s_word(link) -> None:
    assert acknowledged(link, REBOOT, link.reboot_autopilot) == ACCEPTED
    until(lambda: heard(link, "ATTITUDE").time_boot_ms < 5000, "a clock near zero")


def test_signed_it_is_obeyed_and_unsigned_it_is_not(tmp_path) -> None:
    key = bytes(range(32))
    (tmp_path / "key").write_bytes(key)
    own = ("--signing-key", str(tmp_path / "key"), "--speed", str(SPEED))
    with recorded(None, tmp_path, *own, onboard=True) as running:
        with contextlib.closing(connect(running)) as stranger:  # HEARTBEAT is for everybody
            stranger.arducopter_arm()
            assert stranger.recv_match(type="COMMAND_ACK", blocking=True, timeout=2.0) is None
        with contextlib.closing(connect(running)) as link:
            link.setup_signing(key)
            assert acknowledged(link, ARM, link.arducopter_arm) == ACCEPTED
            link.motors_armed_wait()
            assert acknowledged(link, ARM, link.arducopter_disarm) == ACCEPTED
            link.motors_disarmed_wait()
        with contextlib.closing(connect(running)) as forger:
            forger.setup_signing(bytes(32), allow_unsigned_callback=lambda *_: True)
            forger.arducopter_arm()
            assert forger.recv_match(type="COMMAND_ACK", blocking=True, timeout=2.0) is None
