"""MAVProxy flying the real daemon over UDP, and what it can and can't do with either identity."""

import importlib.util
from collections.abc import Iterator

import pytest
from mavproxy import STANDARD_MODULES, MavProxy
from recorded import recorded

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif(not importlib.util.find_spec("MAVProxy"), reason="MAVProxy is installed by `make setup` alone"),
]

HOME_AMSL_M = 190.0
PLAN = """QGC WPL 110
0\t1\t3\t22\t0\t0\t0\tnan\t55.6985\t37.3595\t3\t1
1\t0\t3\t16\t0\t0.5\t0\tnan\t55.69854\t37.3595\t3\t1
2\t0\t3\t16\t0\t0.5\t0\tnan\t55.69854\t37.35956\t4\t1
3\t0\t3\t21\t0\t0\t0\tnan\t55.69854\t37.35956\t0\t1
"""


@pytest.fixture(scope="module", params=["px4", "generic"])
def identity(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def proxy(identity: str, tmp_path_factory) -> Iterator[MavProxy]:
    """Connected, with the parameters that it fetches by itself; shared by all tests of one identity."""
    folder = tmp_path_factory.mktemp("mavproxy")
    client = "MAVProxy" if identity == "px4" else None
    with recorded(client, folder, "--speed", "5", "--identity", identity) as running:
        connected = MavProxy(running.port, folder)
        try:
            connected.hear(f"online system {running.instance + 1}")
            connected.hear(r"^Received (\d+) parameters")
            yield connected
        finally:
            connected.close()


def wait_for_mode(proxy: MavProxy, identity: str, name: str, number: int) -> None:
    """MAVProxy's prompt shows its own name for a mode where it takes the vehicle for a PX4, else the number."""
    prompt = name if identity == "px4" else rf"Mode\({number}\)"
    proxy.poll("status HEARTBEAT", rf"{prompt}> .*custom_mode : {number}\b")


def test_all_modules_that_it_loads_by_itself_work(proxy: MavProxy) -> None:
    proxy.command("module list", *(rf"^(\S+> )?{name}: " for name in STANDARD_MODULES))
    assert "Failed to load module" not in proxy.said
    assert "Traceback" not in proxy.said
    assert "fence breach" not in proxy.said
    assert "YawSitter SITL" in proxy.said


def test_parameters_are_fetched_shown_and_set(proxy: MavProxy) -> None:
    total = int(proxy.command("param fetch", r"Requested parameter list", r"Received (\d+) parameters")[1])
    assert total > 70
    proxy.type("param set pos_x_p 1.25")  # it writes names in upper case
    proxy.poll("param show POS_X_P", r"POS_X_P +1\.25$")


def test_whole_numbers_are_understood_from_a_px4_alone(proxy: MavProxy, identity: str) -> None:
    """They travel bytewise, as AUTOPILOT_VERSION says; MAVProxy goes by the autopilot's name and doesn't ask."""
    if identity == "px4":
        proxy.type("param set COM_OBL_RC_ACT 4")
        proxy.poll("param show COM_OBL_RC_ACT", r"COM_OBL_RC_ACT +4$")
    else:
        proxy.command("param set COM_OBL_RC_ACT 4", r"Failed to set COM_OBL_RC_ACT to 4")
        proxy.poll("param show COM_OBL_RC_ACT", r"COM_OBL_RC_ACT +7\.0\d+e-45$")


def test_modes_by_name_are_beyond_it_and_by_number_they_are_not(proxy: MavProxy, identity: str) -> None:
    if identity == "px4":
        proxy.command("mode RTL", r"ERROR in command \['RTL'\]: required argument is not a float")  # nothing is sent
        set_mode = {number: f"long DO_SET_MODE 1 4 {number >> 24} 0 0 0 0" for number in (84148224, 50593792)}
    else:
        proxy.command("mode AUTO", "DO_SET_MODE: DENIED", "there is no mode 10/0")  # ArduPlane's number
        set_mode = {number: f"mode {number}" for number in (84148224, 50593792)}
    for name, number in (("RTL", 84148224), ("LOITER", 50593792)):
        proxy.command(set_mode[number], "DO_SET_MODE: ACCEPTED")
        wait_for_mode(proxy, identity, name, number)


def test_a_plan_goes_up_and_comes_back_the_same(proxy: MavProxy, tmp_path) -> None:
    there, back = tmp_path / "there.txt", tmp_path / "back.txt"
    there.write_text(PLAN)
    proxy.command(f"wp load {there}", "Sent all 4 waypoints", "TYPE_MISSION: ACCEPTED")
    proxy.command(f"wp save {back}", "Saved 4 waypoints")
    assert numbers(back.read_text()) == numbers(PLAN)
    proxy.command("wp set 1", "waypoint 1")


def numbers(plan: str) -> list[list[str]]:
    """Every number of a plan file, as text that doesn't depend on how many digits were written."""
    return [[f"{float(value):.7g}" for value in line.split()] for line in plan.splitlines()[1:]]


def test_it_takes_off_flies_the_plan_lands_and_disarms(proxy: MavProxy, identity: str) -> None:
    proxy.command("arm throttle", "COMPONENT_ARM_DISARM: ACCEPTED")
    proxy.command("takeoff 3", "NAV_TAKEOFF: DENIED", r"3\.0 m AMSL")  # above sea level, as for a PX4
    proxy.command(f"takeoff {HOME_AMSL_M + 3}", "NAV_TAKEOFF: ACCEPTED")
    proxy.poll("status GLOBAL_POSITION_INT", r"relative_alt : (29\d\d|30\d\d)\b")
    wait_for_mode(proxy, identity, "LOITER", 50593792)
    proxy.command("guided 55.69853 37.3595 193", "DO_REPOSITION: ACCEPTED")
    proxy.command("setspeed 3", "DO_CHANGE_SPEED: ACCEPTED")
    proxy.command("long MISSION_START 0 0 0 0 0 0 0", "MISSION_START: ACCEPTED", "waypoint 1")
    proxy.command("pause", "DO_PAUSE_CONTINUE: ACCEPTED")
    wait_for_mode(proxy, identity, "LOITER", 50593792)
    proxy.command("resume", "DO_PAUSE_CONTINUE: ACCEPTED", "waypoint 3", "DISARMED")


def test_fences_and_rally_points_are_loaded_and_listed(proxy: MavProxy, tmp_path) -> None:
    fence, rally = tmp_path / "fence.txt", tmp_path / "rally.txt"
    corners = ((55.70, 37.36), (55.70, 37.35), (55.69, 37.35), (55.69, 37.36))
    lines = [f"{k}\t0\t0\t5001\t4\t0\t0\t0\t{lat}\t{lon}\t0\t1" for k, (lat, lon) in enumerate(corners)]
    fence.write_text("\n".join(["QGC WPL 110", *lines, ""]))
    rally.write_text("QGC WPL 110\n0\t0\t3\t5100\t0\t0\t0\t0\t55.6985\t37.3596\t4\t1\n")
    proxy.command(f"fence load {fence}", "TYPE_FENCE: ACCEPTED")
    proxy.command("fence list", "Requesting 4 fence items", r"5001 0 55\.69")
    proxy.command("fence clear", "TYPE_FENCE: ACCEPTED")
    proxy.command(f"rally load {rally}", "TYPE_RALLY: ACCEPTED")
    proxy.command("rally list", "Requesting 1 rally items", r"5100 3 55\.6985")
    proxy.command("rally clear", "TYPE_RALLY: ACCEPTED")


def test_the_rest_of_its_questions_are_answered(proxy: MavProxy) -> None:
    proxy.command("ping", r"ping response: [\d.]+ms")
    proxy.command("wp clear", "TYPE_MISSION: ACCEPTED")
    proxy.command("ftp list /", r"^ D ")
