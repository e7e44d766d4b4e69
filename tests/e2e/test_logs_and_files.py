"""Files, logs and parameters of the real daemon, with the clients that people have: pymavlink's and mavlogdump."""

import asyncio
import contextlib
import json
import lzma
import os
import re
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import pytest
from daemon_process import BOOT_LIMIT_S, ROOT, Client, Daemon, mavlink
from mavsdk_drone import Drone, Generation
from mcap.reader import make_reader
from pymavlink import mavftp, mavparm, mavutil

from sitl.mavlink.ftp_payload import crc32
from sitl.onboard.declarations import declarations
from sitl.vehicle_spec import load_vehicle

pytestmark = pytest.mark.e2e

BIN = Path(sys.executable).parent


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    """A daemon that has recorded a flight: up, a look around, down, at five times real time."""
    with Daemon(tmp_path_factory.mktemp("daemon"), "--record", "--speed", "5", "--set", "COM_DISARM_LAND=0.5") as d:
        ground = Client(d)
        ground.until_ready()
        assert ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, *[float("nan")] * 7) == mavlink.MAV_RESULT_ACCEPTED
        assert ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        hold = 4 << 16 | 3 << 24
        ground.wait(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == hold, 60.0)
        assert ground.command(mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, *[float("nan")] * 4) == mavlink.MAV_RESULT_ACCEPTED
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        ground.wait(lambda m: m.get_type() == "HEARTBEAT" and not m.base_mode & armed, 60.0)
        end_s = time.monotonic() + 60.0
        while "recorded " not in d.log and time.monotonic() < end_s:
            time.sleep(0.1)
        ground.close()
        yield d


@pytest.fixture
def link(daemon):
    """pymavlink's own connection, as a ground station makes it."""
    os.environ["MAVLINK20"] = "1"
    made = mavutil.mavlink_connection(f"udpout:127.0.0.1:{18570 + daemon.instance}", source_system=254)
    made.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
    assert made.wait_heartbeat(timeout=BOOT_LIMIT_S) is not None
    yield made
    made.close()


@pytest.fixture
def ftp(daemon, link):
    return mavftp.MAVFTP(link, daemon.instance + 1, 1)


def listed(ftp, folder: str) -> dict[str, int]:
    answer = ftp.cmd_list([folder])
    assert answer.error_code == 0
    return {entry.name: entry.size_b for entry in answer.directory_listing or []}


def fetched(ftp, path: str, to: Path) -> bytes:
    ftp.cmd_get([path, str(to)])
    assert ftp.process_ftp_reply("OpenFileRO", timeout=60).error_code == 0
    return to.read_bytes()


def gcs(daemon, *arguments: str) -> subprocess.CompletedProcess:
    own = ["--connect", f"udpout:127.0.0.1:{18570 + daemon.instance}", "--system", str(daemon.instance + 1)]
    command = [sys.executable, "-m", "gcs_tools", *arguments, *own]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)


def test_pymavlinks_ftp_lists_and_fetches_what_the_parameters_mean(ftp, tmp_path) -> None:
    assert set(listed(ftp, "/")) == {"logs", "metadata", "scratch"}
    general = json.loads(lzma.decompress(fetched(ftp, "/metadata/general.json.xz", tmp_path / "general")))
    [entry] = general["metadataTypes"]
    data = fetched(ftp, entry["uri"].removeprefix("mftp://"), tmp_path / "parameter")
    assert crc32(data) == entry["fileCrc"]
    spec = load_vehicle("yawsitter")
    told = {p["name"]: p["default"] for p in json.loads(lzma.decompress(data))["parameters"]}
    assert told == {d.name: d.default for d in declarations(spec.gains, spec.parameters)}


def test_pymavlinks_ftp_fetches_a_recorded_flight_whole(daemon, ftp, tmp_path) -> None:
    files = listed(ftp, "/logs")
    assert sorted(name.rpartition(".")[2] for name in files) == ["mcap", "tlog"]
    for name, size in files.items():
        data = fetched(ftp, f"/logs/{name}", tmp_path / name)
        assert len(data) == size
        assert data == (daemon.state_dir / "logs" / name).read_bytes()


def test_pymavlinks_ftp_writes_to_the_scratch_folder_and_nowhere_else(daemon, ftp, tmp_path) -> None:
    mine = tmp_path / "mine.txt"
    mine.write_bytes(b"some text " * 100)
    ftp.cmd_put([str(mine), "/scratch/mine.txt"])
    assert ftp.process_ftp_reply("CreateFile", timeout=30).error_code == 0
    assert (daemon.state_dir / "scratch" / "mine.txt").read_bytes() == mine.read_bytes()
    assert ftp.cmd_rm(["/scratch/mine.txt"]).error_code == 0
    assert listed(ftp, "/scratch") == {}
    before = listed(ftp, "/logs")
    for refused in ("/logs/mine.txt", "/../mine.txt", "/mine.txt"):
        ftp.cmd_put([str(mine), refused])
        assert ftp.process_ftp_reply("CreateFile", timeout=30).error_code != 0
    assert listed(ftp, "/logs") == before
    assert not list(daemon.state_dir.rglob("mine.txt"))


def test_mavlogdump_reads_the_tlog(daemon) -> None:
    [tlog] = (daemon.state_dir / "logs").glob("*.tlog")
    tool = [str(BIN / "mavlogdump.py"), "--types", "HEARTBEAT,ATTITUDE,COMMAND_ACK", str(tlog)]
    done = subprocess.run([sys.executable, *tool], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert sum(" ATTITUDE " in line for line in lines) > 100
    assert any("COMMAND_ACK {command : 400, result : 0" in line for line in lines)
    armed = [f"custom_mode : {4 << 16 | sub << 24}" for sub in (2, 3, 6)]  # take-off, hold, land
    assert all(any(mode in line for line in lines) for mode in armed)


def test_the_mcap_has_the_control_steps_that_the_log_says_were_kept(daemon) -> None:
    kept, flown = map(int, re.search(r"recorded .*: (\d+) of (\d+) control steps", daemon.log).groups())
    [mcap] = (daemon.state_dir / "logs").glob("*.mcap")
    with mcap.open("rb") as file:
        reader = make_reader(file)
        [state] = [c for c in reader.get_summary().channels.values() if c.topic.endswith("/state")]
        times = [json.loads(m.data)["now_us"] for _, _, m in reader.iter_messages(topics=[state.topic])]
    assert len(times) == kept > 2000
    if kept == flown:  # at five times real time a busy machine may not keep up
        assert {b - a for a, b in pairwise(times)} == {2000}


def test_pymavlinks_parameter_module_lists_writes_and_hears_a_refusal(daemon, link) -> None:
    count = len(declarations(load_vehicle("yawsitter").gains, {}))
    link.mav.param_request_list_send(daemon.instance + 1, 1)
    names, end_s = {}, time.monotonic() + 30.0
    while len(names) < count and time.monotonic() < end_s:
        m = link.recv_match(type="PARAM_VALUE", blocking=True, timeout=1.0)
        if m is None:
            link.mav.param_request_list_send(daemon.instance + 1, 1)
        elif m.param_id != "_HASH_CHECK":
            names[m.param_id] = m.param_type
    assert len(names) == count
    parameters = mavparm.MAVParmDict()
    link.target_system, link.target_component = daemon.instance + 1, 1
    assert parameters.mavset(link, "RATE_Y_P", 0.625, parm_type=mavlink.MAV_PARAM_TYPE_REAL32)
    assert parameters.mavset(link, "SYS_ATT_ERROR", 0, parm_type=mavlink.MAV_PARAM_TYPE_INT32)
    ground = Client(daemon)
    assert (ground.get("RATE_Y_P"), ground.get("SYS_ATT_ERROR")) == (0.625, 0)
    ground.close()
    link.mav.param_set_send(daemon.instance + 1, 1, b"RATE_Y_P", float("nan"), mavlink.MAV_PARAM_TYPE_REAL32)
    old = None
    with contextlib.suppress(AttributeError):
        while (old := link.recv_match(type="PARAM_VALUE", blocking=True, timeout=5.0)).param_id != "RATE_Y_P":
            pass
    assert old is not None
    assert old.param_value == 0.625


@pytest.mark.parametrize("generation", list(Generation), ids=lambda generation: generation.value)
def test_mavsdk_transfers_files_both_ways_and_downloads_logs(daemon, tmp_path, generation) -> None:
    mine = tmp_path / "mine.bin"
    mine.write_bytes(bytes(range(256)) * 20)
    log = min((daemon.state_dir / "logs").iterdir(), key=lambda path: path.stat().st_size)

    async def talk() -> list[int]:
        async with Drone.connected(generation, f"udpout://127.0.0.1:{14580 + daemon.instance}") as drone:
            for burst in (True, False):
                async for _ in drone.ftp.download(f"/logs/{log.name}", str(tmp_path), burst):
                    pass
                assert (tmp_path / log.name).read_bytes() == log.read_bytes()
            async for _ in drone.ftp.upload(str(mine), "/scratch"):
                pass
            assert await drone.ftp.are_files_identical(str(mine), "/scratch/mine.bin")
            await drone.ftp.create_directory("/scratch/folder")
            await drone.ftp.rename("/scratch/mine.bin", "/scratch/folder/yours.bin")
            await drone.ftp.remove_file("/scratch/folder/yours.bin")
            await drone.ftp.remove_directory("/scratch/folder")
            with pytest.raises(drone.types("ftp").FtpError):
                await drone.ftp.remove_file(f"/logs/{log.name}")
            entries = await drone.log_files.get_entries()
            [wanted] = [entry for entry in entries if entry.size_bytes == log.stat().st_size]
            async for _ in drone.log_files.download_log_file(wanted, str(tmp_path / "by-number")):
                pass
            return [entry.size_bytes for entry in entries]

    sizes = asyncio.run(asyncio.wait_for(talk(), 90))
    assert sizes == [path.stat().st_size for path in sorted((daemon.state_dir / "logs").iterdir())]
    assert (tmp_path / "by-number").read_bytes() == log.read_bytes()


def test_mavsdk_reads_what_the_parameters_mean(daemon) -> None:
    from mavsdk import ComponentType, Configuration
    from mavsdk.asyncio import Mavsdk
    from mavsdk.asyncio.plugins.component_metadata import ComponentMetadataAsync
    from mavsdk.plugins.component_metadata import MetadataType

    async def talk() -> str:
        async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
            await mavsdk.add_any_connection(f"udpout://127.0.0.1:{14580 + daemon.instance}")
            plugin = ComponentMetadataAsync(await mavsdk.first_autopilot(30.0))
            await plugin.request_autopilot_component()
            for _ in range(60):
                await asyncio.sleep(0.5)
                with contextlib.suppress(Exception):  # not there yet
                    return (await plugin.get_metadata(1, MetadataType.PARAMETER)).json_metadata
            raise AssertionError("no metadata in 30 s")

    told = {p["name"]: p for p in json.loads(asyncio.run(talk()))["parameters"]}
    assert told["MPC_XY_CRUISE"]["units"] == "m/s"


def test_gcs_lists_fetches_and_erases_logs(daemon, tmp_path) -> None:
    on_disk = {path.name: path.read_bytes() for path in (daemon.state_dir / "logs").iterdir()}
    names = [log["name"] for log in json.loads(gcs(daemon, "log", "list", "--json").stdout)]
    assert names == sorted(on_disk)
    done = gcs(daemon, "log", "get", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == on_disk
    refused = gcs(daemon, "log", "get", "nothing-of-the-kind")
    assert refused.returncode == 1
    assert "log list" in refused.stderr
    assert gcs(daemon, "log", "erase").stdout == "2 log files erased\n"
    assert list((daemon.state_dir / "logs").iterdir()) == []
