"""QGroundControl's way to connect and to fly, played against the real daemon over UDP."""

import contextlib
import math
from collections.abc import Iterator

import pytest
from qgroundcontrol import QGroundControl
from recorded import recorded

from sitl.mavlink.codec import mav

pytestmark = pytest.mark.e2e

ACCEPTED = mav.MAV_RESULT_ACCEPTED
HOME = 55.6985, 37.3595, 190.0
METRE_DEG = 1.0 / 111_319.5
FENCE, RALLY, MISSION = mav.MAV_MISSION_TYPE_FENCE, mav.MAV_MISSION_TYPE_RALLY, mav.MAV_MISSION_TYPE_MISSION
RELATIVE = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT


@pytest.fixture(scope="module")
def qgc(tmp_path_factory) -> Iterator[QGroundControl]:
    """Connected; shared by the tests, which fly on from each other."""
    folder = tmp_path_factory.mktemp("qgroundcontrol")
    with (
        recorded("QGroundControl", folder, "--speed", "3") as running,
        contextlib.closing(QGroundControl(running)) as station,
    ):
        station.connect()
        yield station


def place(north_m: float, east_m: float = 0.0) -> tuple[float, float]:
    return HOME[0] + north_m * METRE_DEG, HOME[1] + east_m * METRE_DEG / math.cos(math.radians(HOME[0]))


def item(command: int, lat: float, lon: float, z: float, frame: int = RELATIVE, **params: float) -> dict[str, float]:
    return {"command": command, "frame": frame, "x": round(lat * 1e7), "y": round(lon * 1e7), "z": z, **params}


def altitude(qgc: QGroundControl, amsl_m: float) -> None:
    what = f"altitude {amsl_m:g} m"
    qgc.wait(lambda f: f.name == "GLOBAL_POSITION_INT" and abs(f.message.alt * 1e-3 - amsl_m) < 0.2, what)


def airborne(qgc: QGroundControl) -> None:
    if not qgc.armed:
        assert qgc.takeoff(HOME[2] + 3.0) == ACCEPTED
        altitude(qgc, HOME[2] + 3.0)
        in_mode(qgc, "Hold")


def in_mode(qgc: QGroundControl, name: str) -> None:
    qgc.wait(lambda f: f.name == "HEARTBEAT" and f.message.custom_mode == qgc.modes[name], f"mode {name}")


def test_it_connects_and_learns_what_there_is(qgc: QGroundControl) -> None:
    assert qgc.capabilities & mav.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    assert qgc.capabilities & mav.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    assert set(qgc.modes) >= {"Position", "Takeoff", "Hold", "Mission", "Return", "Land", "Offboard"}
    described = {entry["name"] for entry in qgc.metadata["parameter"]["parameters"]}
    assert set(qgc.parameters) <= described
    assert (qgc.mission, qgc.fence, qgc.rally) == ([], [], [])


def test_what_it_has_no_use_for_is_refused_at_once(qgc: QGroundControl) -> None:
    for name in ("COMPONENT_INFORMATION", "CAMERA_INFORMATION", "GIMBAL_MANAGER_INFORMATION"):
        result, answer = qgc.request_message(name)
        assert result != ACCEPTED
        assert answer is None


def test_a_parameter_is_written_and_shown(qgc: QGroundControl) -> None:
    assert qgc.set_parameter("POS_X_P", 1.25) == 1.25
    assert qgc.set_parameter("NAV_DLL_ACT", 1) == 1
    assert qgc.set_parameter("NAV_DLL_ACT", 0) == 0


def test_the_take_off_slider_takes_off_before_it_arms(qgc: QGroundControl) -> None:
    assert qgc.takeoff(HOME[2] + 3.0) == ACCEPTED
    altitude(qgc, HOME[2] + 3.0)
    in_mode(qgc, "Hold")
    assert qgc.armed


def test_go_to_pause_altitude_speed_and_orbit(qgc: QGroundControl) -> None:
    airborne(qgc)
    lat, lon = place(6.0)
    assert qgc.go_to(lat, lon, HOME[2] + 3.0) == ACCEPTED
    qgc.wait(lambda f: f.name == "GLOBAL_POSITION_INT" and abs(f.message.lat - lat * 1e7) < 20, "the place")
    assert qgc.change_speed(2.0) == ACCEPTED
    assert qgc.go_to(*place(0.0), HOME[2] + 3.0) == ACCEPTED
    assert qgc.pause() == ACCEPTED
    in_mode(qgc, "Hold")
    assert qgc.change_altitude(HOME[2] + 5.0) == ACCEPTED
    altitude(qgc, HOME[2] + 5.0)
    assert qgc.orbit(*place(0.0), 4.0, HOME[2] + 5.0) == ACCEPTED
    qgc.wait(lambda f: f.name == "ORBIT_EXECUTION_STATUS", "the circle")
    assert qgc.pause() == ACCEPTED


def test_plan_fence_and_rally_points_go_up_and_come_back(qgc: QGroundControl) -> None:
    corners = [place(80, 80), place(80, -80), place(-80, -80), place(-80, 80)]
    inside = mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    fence = [item(inside, *corner, 0.0, mav.MAV_FRAME_GLOBAL, param1=4.0) for corner in corners]
    rally = [item(mav.MAV_CMD_NAV_RALLY_POINT, *place(0.0, 3.0), 4.0)]
    free = {"param4": math.nan}
    plan = [
        item(mav.MAV_CMD_NAV_TAKEOFF, *place(0.0), 4.0, **free),
        item(mav.MAV_CMD_DO_CHANGE_SPEED, 0.0, 0.0, 0.0, mav.MAV_FRAME_MISSION, param1=1.0, param2=3.0, param3=-1.0),
        item(mav.MAV_CMD_NAV_WAYPOINT, *place(5.0), 4.0, **free),
        item(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0.0, 0.0, 0.0, mav.MAV_FRAME_MISSION),
    ]
    for kind, items in ((MISSION, plan), (FENCE, fence), (RALLY, rally)):
        assert qgc.write(kind, items) == mav.MAV_MISSION_ACCEPTED
        assert [(i.command, i.x, i.y, i.z) for i in qgc.load(kind)] == [
            (i["command"], i["x"], i["y"], i["z"]) for i in items
        ]
    assert qgc.write(RALLY, []) == mav.MAV_MISSION_ACCEPTED
    assert qgc.write(FENCE, []) == mav.MAV_MISSION_ACCEPTED


def test_the_mission_slider_flies_the_plan_and_comes_home(qgc: QGroundControl) -> None:
    airborne(qgc)
    assert qgc.start_mission() == ACCEPTED
    qgc.wait(lambda f: f.name == "MISSION_ITEM_REACHED" and f.message.seq == 2, "the waypoint")
    qgc.wait(lambda f: f.name == "HEARTBEAT" and not qgc.armed, "disarmed at home")


def test_the_return_and_land_buttons_change_the_mode(qgc: QGroundControl) -> None:
    airborne(qgc)
    qgc.set_mode("Return")
    qgc.set_mode("Hold")
    qgc.set_mode("Land")
    qgc.wait(lambda f: f.name == "HEARTBEAT" and not qgc.armed, "disarmed on the ground")
