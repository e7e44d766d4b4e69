"""Campaigns flown for real: by one process, by two, interrupted, with workers killed, on a cluster; always the same."""

import json
import multiprocessing
import os
import shlex
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from interrupted import interrupted, program
from short_mission import HOP

from gcs_tools.plan import Streamed
from gcs_tools.reference import Setpoint
from sitl import __main__ as command_line
from sitl.campaign import file, run, workers
from sitl.campaign.flight import Job
from sitl.campaign.progress import Progress
from sitl.campaign.store import table

pytestmark = pytest.mark.compiled

CAMPAIGN = """\
name: hops
mission: hop.yaml
vehicle: yawsitter-real
flights: 12
heading_deg: {uniform: [-90, 90]}
wind_north_m_s: {choice: [0.5, 1, 25]} # the last blows it over
gust_m_s: {uniform: [0, 0.5]}
plant: {mass_kg: {normal: [1, 0.03], relative: true}}
traces: 5
success: {max_3d_m: 0.5}
"""


def sitl(*words: object) -> int:
    return command_line.main([str(word) for word in words])


def contents(folder: Path) -> dict[str, bytes]:
    """Every Parquet file."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*.parquet"))}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "hop.yaml").write_text(HOP)
    (folder / "hops.yaml").write_text(CAMPAIGN)
    return folder / "hops.yaml"


@pytest.fixture(scope="module")
def flown(campaign: Path) -> Path:
    """By one process, in one go."""
    folder = campaign.parent / "flown"
    assert sitl("campaign", campaign, "--workers", 1, "--out", folder) == 0
    return folder


def rows(folder: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = table(folder).to_pylist()
    return found


def test_no_flight_is_lost_and_what_went_wrong_has_its_reason(flown: Path) -> None:
    found = rows(flown)
    assert [row["index"] for row in found] == list(range(12))
    stormy = [row for row in found if row["wind_north_m_s"] == 25.0]
    assert stormy
    for row in found:
        if row in stormy:
            assert row["outcome"] in ("tipped over", "crashed", "failed")
            assert row["reason"]
            assert not row["success"]
        else:
            assert (row["outcome"], row["reason"], row["success"]) == ("completed", "", True)
            assert 0.0 < row["mae_3d_m"] < row["rms_3d_m"] < row["max_3d_m"] < 0.5
            assert row["duration_s"] == 6.0


def test_a_flights_command_flies_it_again(
    flown: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    row = next(row for row in rows(flown)[4:] if row["outcome"] == "completed")
    monkeypatch.chdir(flown)
    program, *words = shlex.split(row["command"])
    capsys.readouterr()
    assert (program, sitl(*words, "--json")) == ("sitl", 0)
    true = json.loads(capsys.readouterr().out)["true"]
    for figure, told in (("mae", "mae"), ("rms", "rmse"), ("max", "max_overshoot")):
        assert [round(row[f"{figure}_{axis}_m"], 6) for axis in ("north", "east", "down")] == true[told]
    assert (round(row["mae_3d_m"], 6), round(row["max_3d_m"], 6)) == (true["mean_distance"], true["max_distance"])


def test_traces_are_of_the_flights_asked_for_and_say_units_and_frames(flown: Path) -> None:
    traces = pq.read_table(flown / "traces")
    assert sorted(set(traces["index"].to_pylist())) == [0, 5, 10]
    field = traces.schema.field("true_position_north_m")
    assert (field.metadata[b"unit"], field.metadata[b"frame"]) == (b"m", b"N")
    assert json.loads(traces.schema.metadata[b"versions"])["python"]
    summary = {row["index"]: row for row in rows(flown)}
    for index in (0, 5, 10):
        if summary[index]["outcome"] == "completed":
            one = traces.filter(np.array(traces["index"]) == index)
            t = one["t_s"].to_numpy()
            assert (t[0], len(t)) == (0.0, 300)
            error = [
                one[f"true_position_{a}_m"].to_numpy() - one[f"reference_position_{a}_m"].to_numpy()
                for a in ("north", "east", "down")
            ]
            assert np.linalg.norm(error, axis=0).max() == pytest.approx(summary[index]["max_3d_m"], rel=0.02)


def test_the_report_needs_no_other_file_and_names_failures_worst_cases_and_rates(flown: Path) -> None:
    summary = json.loads((flown / "summary.json").read_text())
    found = rows(flown)
    success = [row for row in found if row["success"]]
    assert summary["flights"] == 12
    assert summary["success"]["count"] == len(success)
    assert summary["success"]["low"] < len(success) / 12 < summary["success"]["high"]
    worst = max(success, key=lambda row: row["max_3d_m"])
    assert summary["worst"]["max_3d_m"][0]["command"] == worst["command"]
    html = (flown / "report.html").read_text()
    assert worst["command"] in html
    assert all(row["reason"].split(":")[0] in html for row in found if row["reason"])
    assert 'src="data:image/svg+xml;base64,' in html
    assert "http" not in html.replace("http-equiv", "").split("</style>")[1].split("base64")[0]


def test_an_interrupted_campaign_keeps_what_is_done_and_two_processes_end_it_with_the_same_bytes(
    campaign: Path, flown: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = campaign.parent / "resumed"
    tick = Progress.tick

    def ctrl_c(self: Progress, flight: Any) -> None:
        tick(self, flight)
        if self.done == 5:
            raise KeyboardInterrupt

    monkeypatch.setattr(Progress, "tick", ctrl_c)
    words = ("campaign", campaign, "--workers", 2, "--out", folder)
    assert sitl(*words) == 130
    told = capsys.readouterr().err
    assert f"5 of 12 flights are kept in {folder}. To go on: sitl campaign {campaign} --out {folder} --resume" in told
    assert len(rows(folder)) == 5
    assert not multiprocessing.active_children()
    monkeypatch.undo()
    assert sitl(*words) == 2
    assert "holds a campaign: --resume goes on with it" in capsys.readouterr().err
    assert sitl(*words, "--resume") == 0
    assert contents(folder) == contents(flown)


def test_a_folder_of_other_flights_is_not_resumed(
    campaign: Path, flown: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = campaign.with_name("other.yaml")
    other.write_text(CAMPAIGN.replace("25]", "24]"))
    assert sitl("campaign", other, "--out", flown, "--resume") == 2
    assert "has other flights than these: choose another --out" in capsys.readouterr().err


def gone(group: int) -> bool:
    """Whether a group of processes is no more, within some seconds: what tidies up after them ends a little later."""
    end_s = time.monotonic() + 10.0
    while time.monotonic() < end_s:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    return False


def test_ctrl_c_ends_the_command_and_its_processes_without_a_traceback(campaign: Path) -> None:
    folder = campaign.parent / "stopped"
    with program("sitl", "campaign", str(campaign), "--workers", "1", "--out", str(folder)) as process:
        assert "12 flights" in process.stderr.readline()
        interrupted(process, group=True)
    assert gone(process.pid)


def jobs_of(campaign: Path) -> tuple[Any, list[Job]]:
    plan = run.plan(file.load(str(campaign)), campaign.parent, campaign.parent, "")
    return plan.equipment, [plan.job(case)._replace(trace_hz=0.0) for case in plan.cases]


def test_a_killed_process_costs_no_flight(campaign: Path, flown: Path) -> None:
    equipment, jobs = jobs_of(campaign)
    found = []
    for flight in workers.local(equipment, jobs, 1):
        found.append(flight.row)
        if len(found) == 4:
            multiprocessing.active_children()[0].kill()
    kept = [{k: v for k, v in row.items() if v == v} for row in sorted(found, key=lambda row: row["index"])]
    assert kept == [{k: v for k, v in row.items() if v == v} for row in rows(flown)]


class Deadly:
    """A reference that takes its process down."""

    def at(self, t_s: float) -> Setpoint:
        os._exit(3)


def test_a_flight_that_takes_down_its_processes_is_recorded_and_the_others_are_flown(
    campaign: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "ATTEMPTS", 1)
    equipment, jobs = jobs_of(campaign)
    deadly = Streamed("deadly", "", Deadly(), 6.0, (), 0.0, None)
    equipment = equipment._replace(missions={**equipment.missions, "deadly": deadly})
    jobs = [jobs[0]._replace(case=jobs[0].case._replace(mission="deadly")), *jobs[1:3]]
    found = {flight.number: flight.row for flight in workers.local(equipment, jobs, 1)}
    assert found[0]["outcome"] == "error"
    assert found[0]["reason"] == "took down 1 worker processes (exit status 3)"
    assert {found[k]["outcome"] for k in (1, 2)} <= {"completed", "tipped over", "crashed", "failed"}


def test_a_cluster_flies_the_same_campaign_with_one_of_its_two_workers_killed_half_way(
    campaign: Path, flown: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed")
    tick, folder = Progress.tick, campaign.parent / "clustered"
    monkeypatch.setattr("sitl.campaign.cluster.CHUNK", 2)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        with distributed.Client(cluster) as client:
            pids = list(client.run(os.getpid).values())

        def kill(self: Progress, flight: Any) -> None:
            tick(self, flight)
            if self.done == 6:
                os.kill(pids[0], signal.SIGKILL)

        monkeypatch.setattr(Progress, "tick", kill)
        assert sitl("campaign", campaign, "--cluster", cluster.scheduler_address, "--out", folder) == 0
    assert contents(folder) == contents(flown)


def test_where_no_scheduler_answers_it_says_so(
    campaign: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sitl.campaign.cluster.CONNECT_S", 0.2)
    assert sitl("campaign", campaign, "--cluster", "tcp://127.0.0.1:9", "--out", campaign.parent / "nowhere") == 2
    assert "--cluster tcp://127.0.0.1:9: no scheduler answers" in capsys.readouterr().err
