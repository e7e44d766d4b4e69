"""Reports of a flight that the real daemon recorded, and of what `gcs fly` recorded of it over a bad link."""

import json
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from daemon_process import ROOT, Client, Daemon
from mcap.reader import make_reader

pytestmark = pytest.mark.e2e

MISSION = ROOT / "missions" / "hover.yaml"
LOSS = 0.05


class Recorded(NamedTuple):
    tlog: Path
    mcap: Path
    own: Path  # gcs fly's
    result: dict[str, Any]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    folder = tmp_path_factory.mktemp("recorded")
    logs, out = folder / "logs", folder / "flown"
    wind = ("--wind", "1,0,0", "--gust", "0.2", "--set", "COM_OF_LOSS_T=5")
    with Daemon(folder, "--record", str(logs), "--speed", "3", "--vehicle", "yawsitter-real", *wind) as daemon:
        ground = Client(daemon)
        ground.until_ready()
        ground.close()
        link = ["--connect", f"udpout:127.0.0.1:{14580 + daemon.instance}", "--system", str(daemon.instance + 1)]
        fly = ["fly", str(MISSION), "--json", "--out", str(out), "--impair", f"loss={LOSS},seed=3", *link]
        done = gcs(*fly)
        assert done.returncode == 0, done.stderr
        end_s = time.monotonic() + 30.0
        while "recorded " not in daemon.log and time.monotonic() < end_s:
            time.sleep(0.05)
        assert daemon.stop() == 0
    return Recorded(*logs.glob("*.tlog"), *logs.glob("*.mcap"), out / "flight.tlog", json.loads(done.stdout))


def gcs(*arguments: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "gcs_tools", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=100)


def report(log: Path, *arguments: str) -> dict[str, Any]:
    done = gcs("report", str(log), "--json", *arguments)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def test_the_mcap_measured_against_the_mission_is_what_gcs_fly_measured(recorded: Recorded) -> None:
    told = report(recorded.mcap, "--mission", str(MISSION))
    for figure in ("mae", "rmse", "max_overshoot"):
        assert told["reported"][figure] == pytest.approx(recorded.result[figure], rel=0.05, abs=1e-3)
        assert told["true"][figure] != told["reported"][figure]
    assert told["true"]["mae"] == pytest.approx(told["reported"]["mae"], abs=0.03)
    for mine, theirs in zip(told["reported"]["waypoints"], recorded.result["waypoints"], strict=True):
        assert mine["error"] == pytest.approx(theirs["error"], abs=2e-3)
    assert told["parameters"]["differ"]["SIM_WIND_N"] == {"value": 1.0, "default": 0.0}
    assert told["facts"]["vehicle"] == "yawsitter-real"


def test_the_tlog_of_the_same_flight_says_the_same_and_knows_the_link(recorded: Recorded) -> None:
    told = report(recorded.tlog, "--mission", str(MISSION))
    assert told["reported"]["mae"] == pytest.approx(recorded.result["mae"], rel=0.05, abs=1e-3)
    assert "true" not in told
    assert [e["text"] for e in told["timeline"] if e["kind"] in ("mode", "armed")][-2:] == ["armed", "disarmed"] or (
        "disarmed" in [e["text"] for e in told["timeline"]]
    )
    rates = {message["name"]: message["mean_Hz"] for message in told["link"]["messages"]}
    assert rates["ATTITUDE"] == pytest.approx(50.0, rel=0.05)
    assert told["link"]["senders"][0]["lost"] is None  # numbered for more links than were recorded
    assert told["damage"] == []


def test_gcs_flys_own_record_tells_its_flight_and_how_bad_the_link_was(recorded: Recorded) -> None:
    told = report(recorded.own, "--mission", str(MISSION))
    assert told["facts"]["vehicle"] == "yawsitter-real"
    assert told["reported"]["mae"] == pytest.approx(recorded.result["mae"], rel=0.05, abs=1e-3)
    vehicle, client = told["link"]["senders"]
    assert vehicle["loss"] == pytest.approx(LOSS, rel=0.4)
    assert client["system"] == 252
    assert client["loss"] == 0.0  # it records what it says before it gets lost


def test_the_page_is_one_file_with_every_plot(recorded: Recorded, tmp_path: Path) -> None:
    page = tmp_path / "flight.html"
    done = gcs("report", str(recorded.mcap), "--out", str(page))
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == str(page)
    text = page.read_text(encoding="utf-8")
    assert set(re.findall(r'<figure id="([\w-]+)">', text)) == {
        "track", "position", "errors", "velocity", "angles", "actuators", "wind", "estimator",
    }  # fmt: skip
    assert re.findall(r'(?:src|href)="(?!data:|#)', text) == []
    assert json.loads(page.with_suffix(".json").read_text(encoding="utf-8"))["true"]


def test_an_mcap_that_was_cut_off_or_damaged_is_read_as_far_as_it_goes(recorded: Recorded, tmp_path: Path) -> None:
    data = recorded.mcap.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) // 2])
    told = report(cut)
    whole_s = report(recorded.mcap, "--out", str(tmp_path))["flight"]["duration_s"]
    assert 0.4 * whole_s < told["flight"]["duration_s"] < 0.6 * whole_s
    assert f"of {len(data) // 2}, there it is broken or cut off" in told["damage"][0]
    changed = bytearray(data)
    middle = middle_of_a_chunk(recorded.mcap, 0.7)
    for k in range(middle, middle + 200):
        changed[k] ^= 0x55
    cut.write_bytes(changed)
    told = report(cut)
    assert 0.6 * whole_s < told["flight"]["duration_s"] < 0.8 * whole_s
    assert len(told["damage"]) == 1


def middle_of_a_chunk(path: Path, share: float) -> int:
    """Where messages stand, so far into the file: between chunks are indexes, of which no message depends."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    size = path.stat().st_size
    chunk = min(summary.chunk_indexes, key=lambda c: abs(c.chunk_start_offset - share * size))
    return int(chunk.chunk_start_offset + chunk.chunk_length // 2)


def test_a_mission_that_was_not_flown_is_refused(recorded: Recorded) -> None:
    done = gcs("report", str(recorded.tlog), "--mission", str(ROOT / "missions" / "rectangle.yaml"))
    assert done.returncode == 2
    assert "rectangle.yaml isn't what was flown" in done.stderr
    assert done.stderr.count("\n") == 1
