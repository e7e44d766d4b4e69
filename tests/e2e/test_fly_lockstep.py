"""Whole flights, vehicle and client in one process, through the same bytes as over UDP."""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from gcs_tools import plan as plans
from gcs_tools import timeline
from gcs_tools.lockstep import Flown, fly
from gcs_tools.plan import Home, Streamed, Uploaded
from gcs_tools.table import PAPER
from sitl.geodesy import GeoPoint, to_local
from sitl.vehicle import DEFAULT_HOME, Vehicle, load_vehicle

pytestmark = pytest.mark.compiled

MISSIONS = Path(__file__).parents[2] / "missions"
VEHICLES = ("yawsitter", "yawsitter-real")


def flown(mission: str, vehicle: str = "yawsitter", **settings: Any) -> Flown:
    flight = fly(plans.load(MISSIONS / mission), Vehicle(load_vehicle(vehicle), **settings))
    assert flight.flight.client.fault is None, flight.flight.client.fault
    return flight


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("mission", sorted(path.name for path in MISSIONS.iterdir()))
def test_every_vehicle_flies_every_mission_and_ends_standing_disarmed(mission: str, vehicle: str) -> None:
    flight = flown(mission, vehicle)
    snapshot = flight.vehicle.snapshot()
    assert not snapshot.armed
    assert snapshot.feet_down > 0
    assert not snapshot.tipped_over
    metrics = flight.flight.metrics()
    assert max(metrics.mae) < 0.05
    assert max(metrics.max_overshoot) < 0.25
    assert metrics.largest_gap_s == pytest.approx(0.02)


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("mission", ["rectangle.yaml", "circle.yaml", "circle-constant-speed.yaml"])
def test_every_mean_error_is_at_or_below_the_papers(mission: str, vehicle: str) -> None:
    flight = flown(mission, vehicle).flight
    paper = PAPER[flight.plan.paper or ""]
    for mine, printed in zip(flight.metrics().mae, paper["mae"], strict=True):
        assert mine <= printed


def test_the_ranges_are_those_of_a_hovering_tail_sitter() -> None:
    ranges = flown("hover.yaml").flight.metrics().ranges
    (roll, pitch, yaw, thrust, flap) = (ranges[k] for k in ("roll_deg", "pitch_deg", "yaw_deg", "thrust_N", "flap_deg"))
    assert roll is not None
    assert pitch is not None
    assert yaw is not None
    assert thrust is not None
    assert flap is not None
    assert max(map(abs, roll)) < 1.0
    assert max(map(abs, yaw)) < 1.0
    assert 90 < pitch[0] < pitch[1] < 105
    assert 9 < thrust[0] < thrust[1] < 13
    assert -35 < flap[0] < flap[1] < 35


def test_a_mission_visits_its_items_in_order() -> None:
    flight = flown("rectangle-mission.yaml").flight
    plan = flight.plan
    assert isinstance(plan, Uploaded)
    assert [place for _, place in flight.reached] == [item.place_m() for item in plan.items]
    times = [t for t, _ in flight.reached]
    assert times == sorted(times)


def test_a_mission_that_ends_in_a_landing_disarms_by_itself() -> None:
    flight = flown("rectangle-mission.yaml").flight
    assert flight.measured_s is not None
    assert flight.measured_s - flight.reached[-1][0] == pytest.approx(2.0, abs=0.1)  # COM_DISARM_LAND


def test_a_return_leads_to_the_rally_point_that_came_with_the_mission() -> None:
    truth = flown("rectangle-fenced.yaml").vehicle.snapshot().truth
    assert (truth.north_m, truth.east_m) == pytest.approx((16.0, 6.0), abs=0.1)


def test_the_qgroundcontrol_plan_is_the_yaml_mission_around_the_default_home() -> None:
    yaml, plan = plans.load(MISSIONS / "rectangle-mission.yaml"), plans.load(MISSIONS / "rectangle-mission.plan")
    assert isinstance(yaml, Uploaded)
    assert isinstance(plan, Uploaded)
    assert plan.home == Home(*DEFAULT_HOME)
    for item, other in zip(yaml.items, plan.items, strict=True):
        assert item.command == other.command
        north, east = to_local(DEFAULT_HOME, other.x * 1e-7, other.y * 1e-7)
        assert (north, east, -other.z) == pytest.approx(item.place_m(), abs=0.02)


def test_wind_and_gusts_are_felt() -> None:
    calm = flown("hover.yaml").flight.metrics()
    windy = flown("hover.yaml", wind_N=(1.0, 0.0, 0.0), gust_m_s=0.5).flight.metrics()
    assert windy.mae[0] > calm.mae[0]


def test_a_vehicle_that_refuses_to_arm_is_not_flown() -> None:
    plan = plans.load(MISSIONS / "hover.yaml")
    assert isinstance(plan, Streamed)
    vehicle = Vehicle(load_vehicle("yawsitter"))
    vehicle.commander.terminate()
    flight = fly(plan, vehicle).flight
    assert flight.client.fault is not None
    assert str(flight.client.fault).startswith("arming: ")
    assert flight.measured_s is None


def command_line(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "sitl", "fly", *arguments], capture_output=True, text=True, timeout=100, check=False
    )


def test_the_same_seed_gives_the_same_flight_in_two_processes(tmp_path: Path) -> None:
    outs = []
    for name in ("one", "two"):
        out = tmp_path / name
        mission = str(MISSIONS / "hover.yaml")
        done = command_line(mission, "--vehicle", "yawsitter-real", "--seed", "7", "--gust", "0.3", "--out", str(out))
        assert done.returncode == 0, done.stderr
        result = json.loads((out / "result.json").read_text())
        del result["real_time_factor"]
        outs.append((result, (out / "track.csv").read_bytes()))
    assert outs[0] == outs[1]


def test_a_changed_airframe_flies_worse_where_the_controller_does_not_know_of_it() -> None:
    def mae(*changes: str) -> list[float]:
        done = command_line(str(MISSIONS / "hover.yaml"), "--json", *changes)
        assert done.returncode == 0, done.stderr
        return list(json.loads(done.stdout)["mae"])

    heavy = ("--plant", "mass_kg=1.2")
    assert mae(*heavy)[2] > 2.0 * mae(*heavy, "--believed", "mass_kg=1.2")[2]


def test_an_airframe_number_that_there_is_not_is_refused() -> None:
    done = command_line(str(MISSIONS / "hover.yaml"), "--plant", "mass=1.2")
    assert done.returncode == 2
    assert done.stderr.startswith("sitl fly: airframe: unknown: mass; there are mass_kg")


def test_json_is_the_only_thing_on_standard_output() -> None:
    done = command_line(str(MISSIONS / "hover.yaml"), "--json")
    assert done.returncode == 0
    assert done.stderr == ""
    result = json.loads(done.stdout)
    assert (result["mission"], result["vehicle"], result["duration_s"]) == ("hover", "yawsitter", 32.0)
    assert all(math.isfinite(x) for x in result["mae"])
    assert result["real_time_factor"] > 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["gone.yaml"], "sitl fly: gone.yaml: no such mission file"),
        ([str(MISSIONS / "hover.yaml"), "--vehicle", "glider"], "sitl fly: unknown vehicle 'glider'"),
        ([str(MISSIONS / "hover.yaml"), "--set", "NOPE=1"], "sitl fly: parameter NOPE: unknown"),
    ],
)
def test_settings_that_cannot_be_used_are_one_line_and_status_two(arguments: list[str], message: str) -> None:
    done = command_line(*arguments)
    assert done.returncode == 2
    assert done.stderr.startswith(message)
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


def test_an_impossible_mission_names_file_and_line(tmp_path: Path) -> None:
    path = tmp_path / "far.yaml"
    path.write_text((MISSIONS / "hover.yaml").read_text().replace("{t_s: 30, ", "{t_s: 25.1, "))
    done = command_line(str(path))
    assert done.returncode == 2
    assert done.stderr.startswith(f"sitl fly: {path}:")
    assert "allowed up to 10 m/s" in done.stderr


def test_a_plan_is_flown_where_it_was_drawn(tmp_path: Path) -> None:
    data = json.loads((MISSIONS / "rectangle-mission.plan").read_text())
    moved = GeoPoint(DEFAULT_HOME.lat_deg - 8.0, DEFAULT_HOME.lon_deg - 29.0, 488.0)
    data["mission"]["plannedHomePosition"] = list(moved)
    for item in data["mission"]["items"]:
        item["params"][4] -= 8.0
        item["params"][5] -= 29.0
    path = tmp_path / "moved.plan"
    path.write_text(json.dumps(data))
    done = command_line(str(path), "--json")
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["waypoints"]) == 7


def test_the_timeline_of_a_mission_expects_about_the_time_that_it_takes() -> None:
    flight = flown("rectangle-mission.yaml").flight
    expected = timeline.rows(flight.plan)
    for row, (reached_s, _) in zip(expected[:-1], flight.reached[:-1], strict=True):
        assert row.end_s == pytest.approx(reached_s, rel=0.2, abs=1.0)
    assert flight.measured_s == pytest.approx(expected[-1].end_s, rel=0.15)
