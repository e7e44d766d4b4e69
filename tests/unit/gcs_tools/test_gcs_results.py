"""What a flight leaves behind: the table, the JSON object, the files."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from gcs_tools_stand_in import Pair, StandIn
from rich.console import Console

from gcs_tools import results, table, yaml_plan
from gcs_tools.client import Client
from gcs_tools.flight import Flight
from gcs_tools.metrics import Track, evaluate, report
from gcs_tools.recording import Recording
from gcs_tools.reference import ZERO, TimedPoint, Waypoints
from sitl.mavlink import codec
from sitl.strict_yaml import ConfigError

PLAN = """\
name: up
kind: waypoints
duration_s: 4
key_times_s: [2]
waypoints: [{t_s: 0, at_m: [0, 0, 0]}, {t_s: 2, at_m: [0, 0, -2]}, {t_s: 4, at_m: [0, 0, 0]}]
"""


@pytest.fixture(scope="module")
def flight() -> Flight:
    client = Client()
    flown = Flight(yaml_plan.loads(PLAN, "up.yaml"), client)
    Pair(client, StandIn()).run()
    assert client.fault is None
    return flown


def test_json_is_one_object_and_nothing_else(flight: Flight, capsys: pytest.CaptureFixture[str]) -> None:
    results.conclude(flight, vehicle="stand-in", factor=2.0, out=None, as_json=True)
    out = capsys.readouterr()
    result = json.loads(out.out)
    assert out.out.count("\n") == 1
    assert (result["mission"], result["vehicle"], result["duration_s"]) == ("up", "stand-in", 4.0)
    assert result["waypoints"][0]["target"] == [0, 0, -2]


def test_the_folder_holds_the_result_and_a_row_per_sample(flight: Flight, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    results.prepare(folder)
    results.conclude(flight, vehicle="stand-in", factor=2.0, out=folder, as_json=True)
    assert json.loads((folder / "result.json").read_text())["real_time_factor"] == 2.0
    with (folder / "track.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == results.COLUMNS
    assert len(rows) == len(flight.recording.positions)
    top = min(rows, key=lambda row: abs(float(row["t_s"]) - 2.0))
    assert float(top["ref_down_m"]) == pytest.approx(-2)
    assert (float(top["pitch_deg"]), float(top["thrust_N"])) == (95, 11)


def test_a_folder_that_cannot_be_made_is_refused_before_the_flight(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="can't be made a folder"):
        results.prepare(tmp_path / "file" / "folder")


def test_what_was_never_heard_is_an_empty_cell(tmp_path: Path) -> None:
    t = np.array([0.0, 1.0])
    zeros = np.zeros((2, 3))
    bare = Track(t, zeros, zeros, np.zeros((0, 4)), np.zeros((0, 2)), np.zeros((0, 3)))
    results.write(tmp_path, {}, bare)
    assert (tmp_path / "track.csv").read_text().splitlines()[1].endswith(",,,,,,")


@pytest.mark.parametrize("paper", [None, "rectangle", "circle"])
def test_the_table_fits_eighty_columns_whole(paper: str | None) -> None:
    t = np.linspace(0, 70, 701)
    error = np.column_stack((0.9999 * np.ones_like(t), 0 * t, -0.0123 * np.ones_like(t)))
    zeros = np.zeros((701, 3)) - [0, 0, 5]
    angles = np.column_stack((t, t, t, t))
    track = Track(t, zeros, zeros + error, angles, angles[:, :2], angles[:, :3])
    result = report("rectangle", "yawsitter-real", 70.0, evaluate(track, 70.0, [(20.0, (20.0, -5.0, -5.0))]), 234.5)
    page = io.StringIO()
    table.show(result, paper, Console(file=page, width=80))
    text = page.getvalue()
    assert "…" not in text.replace(" … ", "")
    assert text.count("0.9999") >= 3
    assert "(20.00, -5.00, -5.00) +0.9999 +0.0000 -0.0123" in text
    if paper == "rectangle":
        assert "0.0317" in text
        assert "31.54×" in text
    assert "234.5 × real time" in text


def test_samples_that_come_twice_or_late_are_put_in_order() -> None:
    recording = Recording()
    for ms in (0, 40, 20, 20, 60):
        recording.position(codec.message("LOCAL_POSITION_NED", time_boot_ms=1000 + ms, x=ms / 1000))
    track = recording.track(1.0, Waypoints([TimedPoint(0, ZERO), TimedPoint(1, ZERO)]))
    assert track.t_s == pytest.approx([0, 0.02, 0.04, 0.06])
    assert track.position_m[:, 0] == pytest.approx([0, 0.02, 0.04, 0.06])


def test_without_a_reference_of_its_own_a_flight_is_held_against_the_vehicles() -> None:
    recording = Recording()
    for k in range(4):
        recording.position(codec.message("LOCAL_POSITION_NED", time_boot_ms=20 * k, x=1.0))
    for k in range(3):
        recording.target(codec.message("POSITION_TARGET_LOCAL_NED", time_boot_ms=30 * k, x=0.03 * k))
    assert recording.track(0.0, None).reference_m[:, 0] == pytest.approx([0, 0.02, 0.04, 0.06])
