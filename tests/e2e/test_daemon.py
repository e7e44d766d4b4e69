"""The real daemon in a process of its own, spoken to over real UDP."""

import os
import random
import signal
import socket
import subprocess
import time

import pytest
from daemon_process import BOOT_LIMIT_S, ROOT, Client, Daemon, command, free_instance, mavlink
from mcap.reader import make_reader
from pymavlink import mavutil

pytestmark = pytest.mark.e2e


@pytest.fixture
def daemon(tmp_path):
    with Daemon(tmp_path) as running:
        yield running


@pytest.fixture
def client(daemon):
    ground = Client(daemon)
    ground.until_ready()
    yield ground
    ground.close()


def test_the_usual_peer_hears_boot_then_standby_without_asking(tmp_path) -> None:
    instance = free_instance(range(4, 9))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 14540 + instance))  # where onboard programs listen
        ear.settimeout(5.0)
        with Daemon(tmp_path, instance=instance) as daemon:
            parser, states, end_s = mavlink.MAVLink(None), [], time.monotonic() + BOOT_LIMIT_S
            first_s = None
            while mavlink.MAV_STATE_STANDBY not in states and time.monotonic() < end_s:
                data, address = ear.recvfrom(65535)
                if address[1] != 14580 + instance:
                    continue
                first_s = first_s or time.monotonic() - daemon.started_s
                messages = parser.parse_buffer(data) or []
                states += [m.system_status for m in messages if m.get_type() == "HEARTBEAT"]
                assert all(m.get_srcSystem() == instance + 1 for m in messages)
    assert states[0] == mavlink.MAV_STATE_BOOT
    assert states[-1] == mavlink.MAV_STATE_STANDBY
    assert first_s < 5.0  # a second on an idle machine: benchmarks measure it


def test_whoever_writes_while_it_boots_is_answered(tmp_path) -> None:
    with Daemon(tmp_path) as daemon:
        ground = Client(daemon)
        boot = ground.wait("HEARTBEAT", BOOT_LIMIT_S)
        assert boot.type == 19
        ground.until_ready()
        ground.close()


def test_garbage_is_survived(daemon, client) -> None:
    chance = random.Random(1)
    frame = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(client.mav)
    for _ in range(2000):
        junk = chance.randbytes(chance.randrange(0, 300))
        broken = bytearray(frame)
        broken[chance.randrange(len(broken))] ^= 1 << chance.randrange(8)
        for data in (junk, b"\xfd" + junk, b"\xfe" + junk, bytes(broken), frame[: chance.randrange(len(frame))]):
            client.send_bytes(data)
    client.send_bytes(bytes(60_000))
    not_numbers = [float("nan"), float("inf"), float("-inf")] * 4
    client.send(
        mavlink.MAVLink_set_position_target_local_ned_message(0, daemon.instance + 1, 1, 1, 0, *not_numbers[:11])
    )
    before = client.boot_ms()
    client.wait(lambda m: m.get_type() == "ATTITUDE" and m.time_boot_ms > before + 200)
    assert daemon.process.poll() is None
    assert daemon.stop() == 0
    assert ", 0 faults" in daemon.log


def test_ctrl_c_ends_it_cleanly(daemon, client) -> None:
    assert daemon.stop(signal.SIGINT) == 0
    assert "Traceback" not in daemon.log
    assert "stopped after" in daemon.log


def test_sigterm_ends_it_cleanly_also_while_it_boots(tmp_path) -> None:
    with Daemon(tmp_path) as daemon:
        ground = Client(daemon)
        ground.wait("HEARTBEAT", BOOT_LIMIT_S)
        assert daemon.stop(signal.SIGTERM) == 0
        assert "Traceback" not in daemon.log
        ground.close()


def test_the_banner_names_ports_vehicle_and_state_folder(daemon, client) -> None:
    for part in (str(18570 + daemon.instance), str(14580 + daemon.instance), "yawsitter", str(daemon.state_dir)):
        assert part in daemon.log


def test_a_second_daemon_on_the_same_ports_says_which_and_what_to_do(daemon, client, tmp_path) -> None:
    with Daemon(tmp_path, instance=daemon.instance) as second:
        assert second.process.wait(20) == 2
        (line,) = second.log.splitlines()
    assert str(18570 + daemon.instance) in line
    assert f"--instance {daemon.instance + 1}" in line
    assert client.boot_ms() > 0  # the first one goes on


def test_a_second_daemon_on_the_same_state_folder_says_so_and_the_first_goes_on(daemon, client, tmp_path) -> None:
    with Daemon(tmp_path) as second:
        assert second.process.wait(20) == 2
        (line,) = second.log.splitlines()
    assert str(daemon.state_dir) in line
    assert f"process {daemon.process.pid}" in line
    assert client.boot_ms() > 0


def test_a_viewer_of_px4s_simulation_hears_the_true_state(tmp_path) -> None:
    instance = free_instance()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 19410 + instance))
        ear.settimeout(BOOT_LIMIT_S)
        with Daemon(tmp_path, "--hil-viewer", instance=instance) as daemon:
            parser, stamps, beats = mavlink.MAVLink(None), [], 0
            while len(stamps) < 26:
                data, address = ear.recvfrom(65535)
                assert address[1] == 19450 + instance, daemon.log
                for m in parser.parse_buffer(data) or []:
                    beats += m.get_type() == "HEARTBEAT"
                    if m.get_type() == "HIL_STATE_QUATERNION":
                        stamps.append(m.time_usec)
                        assert m.attitude_quaternion == pytest.approx((1, 0, 0, 0), abs=0.1)  # upright, belly north
    assert (stamps[-1] - stamps[0]) / 25 == pytest.approx(40_000, rel=0.05)
    assert beats


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--vehicle", "paperplane"], "yawsitter-real"),
        (["--vehicle", "nowhere/plane.yaml"], "nowhere/plane.yaml"),
        (["--home", "1,2"], "LAT,LON,ALT_AMSL,HEADING"),
        (["--set", "RATE_Y_P=1e9"], "RATE_Y_P"),
        (["--set", "NO_SUCH_NAME=1"], "NO_SUCH_NAME"),
        (["--wind", "99,0,0"], "-30 to 30"),
        (["--speed", "-1"], "max"),
        (["--gcs", "192.0.2.7:14550"], "--listen"),
        (["--record", "/proc/nowhere"], "--record"),
        (["--zenoh-endpoint", "nonsense"], "nonsense"),
    ],
)
def test_a_setting_that_can_t_be_used_is_one_line_and_status_2(arguments, named, tmp_path) -> None:
    own = ["--instance", str(free_instance()), "--state-dir", str(tmp_path)]
    done = subprocess.run(
        command("run", *own, *arguments), cwd=ROOT, capture_output=True, text=True, timeout=BOOT_LIMIT_S
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("sitl run: ")
    assert named in line


def test_broken_vehicle_yaml_names_file_and_line(tmp_path) -> None:
    broken = tmp_path / "mine.yaml"
    broken.write_text("description: mine\nairframe: yawsitter\nairframe: twice\n")
    own = ["--instance", str(free_instance()), "--state-dir", str(tmp_path), "--vehicle", str(broken)]
    done = subprocess.run(command("run", *own), cwd=ROOT, capture_output=True, text=True, timeout=BOOT_LIMIT_S)
    assert done.returncode == 2
    assert f"{broken}:3" in done.stderr


def test_what_was_acknowledged_survives_kill_9(tmp_path) -> None:
    with Daemon(tmp_path) as daemon:
        ground = Client(daemon)
        ground.until_ready()
        assert ground.set("POS_X_P", 1.375) == 1.375
        daemon.process.kill()
        daemon.process.wait(20)
        ground.close()
    with Daemon(tmp_path, instance=daemon.instance) as again:
        ground = Client(again)
        ground.until_ready()
        assert ground.get("POS_X_P") == 1.375
        ground.close()


def test_the_command_line_sets_parameters_and_speed(tmp_path) -> None:
    with Daemon(tmp_path, "--set", "POS_X_P=1.25", "--speed", "5") as daemon:
        ground = Client(daemon)
        ground.until_ready()
        assert ground.get("POS_X_P") == 1.25
        assert ground.get("SIM_SPEED") == 5.0
        ground.close()


def speed_factor(client: Client, wall_s: float = 1.0) -> float:
    """Simulated seconds per second, from the stamps of the attitude."""
    first_ms, start_s = client.boot_ms(), time.monotonic()
    last_ms, end_s = first_ms, start_s
    for message in client.messages(wall_s):
        if message.get_type() == "ATTITUDE":
            last_ms, end_s = message.time_boot_ms, time.monotonic()
    return (last_ms - first_ms) * 1e-3 / (end_s - start_s)


def test_the_speed_changes_while_it_runs(client) -> None:
    assert speed_factor(client) == pytest.approx(1.0, rel=0.15)
    client.set("SIM_SPEED", 5.0)
    assert speed_factor(client) == pytest.approx(5.0, rel=0.2)
    client.set("SIM_SPEED", 0.0)
    assert speed_factor(client) > 10.0
    client.set("SIM_SPEED", 1.0)
    assert speed_factor(client) == pytest.approx(1.0, rel=0.15)


def test_heartbeats_keep_to_wall_time_at_any_speed(client) -> None:
    client.set("SIM_SPEED", 20.0)
    list(client.messages(0.5))
    beats = [m for m in client.messages(4.0) if m.get_type() == "HEARTBEAT"]
    assert 3 <= len(beats) <= 5


def test_paused_it_stands_still_and_steps_as_asked(client) -> None:
    client.set("SIM_PAUSE", 1, integer=True)
    client.set("SIM_STEP_MS", 20, integer=True)
    stamped = client.wait("ATTITUDE").time_boot_ms
    assert [m for m in client.messages(1.0) if m.get_type() == "ATTITUDE" and m.time_boot_ms > stamped + 20] == []
    assert client.get("SIM_STEP_MS") == 0

    client.set("SIM_STEP_MS", 500, integer=True)
    stamps = [m.time_boot_ms for m in client.messages(1.0) if m.get_type() == "ATTITUDE"]
    assert max(stamps) - stamped == pytest.approx(500, abs=40)
    assert client.get("SIM_STEP_MS") == 0

    client.set("SIM_PAUSE", 0, integer=True)
    assert speed_factor(client) == pytest.approx(1.0, rel=0.15)


def test_a_reboot_command_starts_the_vehicle_afresh(daemon, client) -> None:
    client.wait(lambda m: m.get_type() == "ATTITUDE" and m.time_boot_ms > 1500)
    assert client.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == mavlink.MAV_RESULT_ACCEPTED
    client.wait(lambda m: m.get_type() == "ATTITUDE" and m.time_boot_ms < 1000)
    assert daemon.process.poll() is None


def test_a_flight_in_the_middle_of_which_the_process_is_killed_can_be_read(tmp_path) -> None:
    with Daemon(tmp_path, "--record", str(tmp_path / "logs")) as daemon:
        ground = Client(daemon)
        ground.until_ready()
        assert ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        list(ground.messages(1.0))
        daemon.process.kill()
        daemon.process.wait(20)
        ground.close()
    (mcap,), (tlog,) = (tmp_path / "logs").glob("*.mcap"), (tmp_path / "logs").glob("*.tlog")
    end_s = time.monotonic() + 30.0
    while not mcap.read_bytes().endswith(b"\x89MCAP0\r\n") and time.monotonic() < end_s:
        time.sleep(0.1)  # the process that writes comes to the end of what it was given
    with mcap.open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_count > 1000
    log = mavutil.mavlink_connection(str(tlog))
    frames = list(iter(lambda: log.recv_match(), None))
    assert {"HEARTBEAT", "ATTITUDE", "COMMAND_LONG", "COMMAND_ACK"} <= {m.get_type() for m in frames}
    assert "BAD_DATA" not in {m.get_type() for m in frames}
    stamps = [m._timestamp for m in frames]
    assert stamps == sorted(stamps)
    assert abs(stamps[-1] - time.time()) < 90.0


def test_help_comes_at_once_and_without_the_simulator() -> None:
    quiet = {**os.environ, "PYTHONPROFILEIMPORTTIME": "1"}
    done = subprocess.run(command("--help"), cwd=ROOT, env=quiet, capture_output=True, text=True, timeout=30)
    assert done.returncode == 0
    assert all(name in done.stdout for name in ("run", "fly", "trim"))
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "argparse" in imported
    assert not {"numpy", "numba", "zenoh", "pymavlink", "msgspec", "yaml"} & imported


@pytest.mark.parametrize("name", ["run", "fly", "trim"])
def test_each_command_explains_itself_with_examples(name) -> None:
    done = subprocess.run(command(name, "--help"), cwd=ROOT, capture_output=True, text=True, timeout=30)
    assert done.returncode == 0
    assert f"sitl {name}" in done.stdout.partition("examples:")[2]
