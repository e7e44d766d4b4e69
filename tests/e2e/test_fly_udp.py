"""Flights and commands over real UDP: a simulator in one process, the ground tools in another."""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from interrupted import interrupted, program

from gcs_tools.demo import simulator

pytestmark = pytest.mark.e2e

MISSIONS = Path(__file__).parents[2] / "missions"
SPEED = 10.0


@pytest.fixture(scope="module")
def connect() -> Iterator[tuple[str, ...]]:
    """A simulator of our own at ten times real time, and how to reach it."""
    with simulator("yawsitter", SPEED) as running:
        to = ("--connect", f"udpout:127.0.0.1:{running.connection.port}", "--system", str(running.instance + 1))
        gcs("param", "set", "COM_OF_LOSS_T", "10", *to)  # a second of a busy machine
        yield to


def run(module: str, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", module, *arguments], capture_output=True, text=True, timeout=100, check=False
    )


def gcs(*arguments: str) -> str:
    done = run("gcs_tools", *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("mission", ["hover.yaml", "circle.yaml", "rectangle-mission.yaml"])
def test_a_mission_is_flown_over_udp_and_measured(mission: str, connect: tuple[str, ...]) -> None:
    result = json.loads(gcs("fly", str(MISSIONS / mission), "--json", *connect))
    assert result["vehicle"] == "yawsitter"
    assert max(result["mae"]) < 0.05
    assert result["real_time_factor"] == pytest.approx(SPEED, rel=0.2)


def test_parameters_are_listed_written_saved_and_loaded(connect: tuple[str, ...], tmp_path: Path) -> None:
    path = str(tmp_path / "all.yaml")
    assert gcs("param", "set", "MPC_XY_CRUISE", "2.5", *connect) == "MPC_XY_CRUISE = 2.5\n"
    gcs("param", "save", path, *connect)
    gcs("param", "set", "MPC_XY_CRUISE", "1.5", *connect)
    assert "MPC_XY_CRUISE = 2.5 (was 1.5)" in gcs("param", "load", path, *connect)
    assert gcs("param", "get", "mpc_xy_cruise", *connect) == "2.5\n"
    listed = json.loads(gcs("param", "list", "--json", *connect))
    assert len([name for name in listed if name.split("_")[0] in ("POS", "VEL", "ATT", "RATE")]) == 36


def test_a_refusal_is_one_line_and_status_one(connect: tuple[str, ...]) -> None:
    done = run("gcs_tools", "param", "set", "RATE_Y_P", "1000", *connect)
    assert done.returncode == 1
    assert done.stderr.startswith("gcs param: RATE_Y_P: ")
    assert done.stderr.count("\n") == 1


def test_commands_take_it_up_and_down_again(connect: tuple[str, ...]) -> None:
    assert gcs("takeoff", "--height", "2", "--wait", *connect) == "hovering\n"
    assert "mode: hold, armed" in gcs("watch", "--for", "1.5", *connect)
    assert gcs("mode", "hold", *connect) == "mode hold\n"
    assert gcs("land", "--wait", *connect) == "landed and disarmed\n"


def test_nobody_there_is_reported() -> None:
    done = run("gcs_tools", "hold", "--connect", "udpout:127.0.0.1:1", "--system", "9")
    assert done.returncode == 1
    assert done.stderr == "gcs hold: no vehicle with system id 9 heard in 10 s\n"


def test_the_demo_starts_flies_and_stops_what_it_started() -> None:
    done = run("gcs_tools.demo", str(MISSIONS / "hover.yaml"), "--speed", "5")
    assert done.returncode == 0, done.stderr
    assert "MAE [m]" in done.stdout
    [disarmed_s] = re.findall(r"t = ([\d.]+) s: disarmed", done.stderr)
    assert 32.0 <= float(disarmed_s) < 34.0  # at five times real time a busy machine hears of it later


def test_a_demo_whose_simulator_cannot_start_says_why() -> None:
    done = run("gcs_tools.demo", "--vehicle", "glider")
    assert done.returncode == 1
    assert "unknown vehicle 'glider'" in done.stderr
    assert "Traceback" not in done.stderr


def test_ctrl_c_lands_the_vehicle_and_stops_the_simulator() -> None:
    with program("gcs_tools.demo", "--speed", "5") as demo:
        said = ""
        while "armed" not in said:
            line = demo.stderr.readline()
            assert line, said
            said += line
        (child,) = children(demo.pid)
        _, rest = interrupted(demo)
    assert "asked the vehicle to land" in rest
    assert not alive(child)


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def alive(pid: int) -> bool:
    for _ in range(50):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return False
        time.sleep(0.1)
    return True
