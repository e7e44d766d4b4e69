"""`gcs plan`: timelines, and the same mission in three formats."""

import math
from pathlib import Path

import pytest

from gcs_tools import plan, timeline, wpl_plan
from gcs_tools.__main__ import main
from gcs_tools.plan import Home, Uploaded
from sitl.onboard.declarations import declarations
from sitl.strict_yaml import ConfigError
from sitl.vehicle import load_vehicle

MISSIONS = Path(__file__).parents[3] / "missions"
HOME = "55.6985,37.3595,190"
WAYPOINTS = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t47.3977\t8.5456\t488\t1
1\t0\t3\t22\t0\t0\t0\tnan\t47.3977\t8.5456\t5\t1
2\t0\t3\t16\t1.5\t0.25\t0\t90\t47.3978\t8.5457\t5.5\t1
3\t0\t2\t178\t1\t2\t-1\t0\t0\t0\t0\t1
4\t0\t3\t21\t0\t0\t0\tnan\t47.3978\t8.5457\t0\t0
"""


def items(path: Path) -> tuple[plan.Item, ...]:
    found = plan.load(path)
    assert isinstance(found, Uploaded)
    return found.items


def same(a: tuple[plan.Item, ...], b: tuple[plan.Item, ...]) -> bool:
    return str(a) == str(b)  # where nan is nan


def convert(source: Path, to: Path, *options: str) -> Path:
    assert main(["plan", str(source), "--to", str(to), *options]) == 0
    return to


def test_waypoints_and_plan_carry_the_same_items_both_ways(tmp_path: Path) -> None:
    first = tmp_path / "a.waypoints"
    first.write_text(WAYPOINTS)
    there = convert(first, tmp_path / "b.plan")
    back = convert(there, tmp_path / "c.txt")
    assert same(items(first), items(there))
    assert back.read_text() == WAYPOINTS
    loaded = plan.load(there)
    assert isinstance(loaded, Uploaded)
    assert loaded.home == Home(47.3977, 8.5456, 488.0)


def test_metres_from_home_go_to_latitude_and_longitude_and_come_back(tmp_path: Path) -> None:
    original = tmp_path / "m.yaml"
    original.write_text(
        "name: m\nkind: mission\nitems:\n"
        "  - {do: takeoff, at_m: [0, 0, -5], heading_deg: 90}\n"
        "  - {do: waypoint, at_m: [120.5, -33.25, -7.5], hold_s: 2, acceptance_m: 0.3}\n"
        "  - {do: speed, speed_m_s: 2}\n  - {do: delay, seconds_s: 3}\n  - {do: land, at_m: [1, 2]}\n  - {do: return}\n"
    )
    there = convert(original, tmp_path / "m.plan", "--home", HOME)
    back = convert(convert(there, tmp_path / "m.waypoints"), tmp_path / "n.yaml")
    for old, new in zip(items(original), items(back), strict=True):
        assert (new.frame, new.command, new.z) == (old.frame, old.command, old.z)
        assert (new.x, new.y) == pytest.approx((old.x, old.y), abs=110)  # 1.1 cm, what a degE7 is
        assert new[2:4] == old[2:4]
        assert new.param4 == old.param4 or (math.isnan(new.param4) and math.isnan(old.param4))


def test_the_projects_plan_is_its_yaml_mission(tmp_path: Path) -> None:
    made = convert(MISSIONS / "rectangle-mission.yaml", tmp_path / "r.plan", "--home", HOME)
    for a, b in zip(items(made), items(MISSIONS / "rectangle-mission.plan"), strict=True):
        assert (a.frame, a.command, a.z) == (b.frame, b.command, b.z)
        assert (a.x, a.y) == pytest.approx((b.x, b.y), abs=1)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("2\t0\t3\t16\t0\t0\t0\t0\t47\t8\t5", r"a\.waypoints:4: item 2: has 11 fields; allowed: 12"),
        ("2\t0\t3\tmuch\t0\t0\t0\t0\t47\t8\t5\t1", r"a\.waypoints:4: item 2: command: 'much' is not a number"),
        ("2\t0\t3\t16.5\t0\t0\t0\t0\t47\t8\t5\t1", r"item 2: command: '16.5' is not a whole number"),
        ("2\t0\t3\t16\t0\t0\t0\t0\t97\t8\t5\t1", r"item 2: x: 97° is no place; allowed -90 to 90"),
        ("2\t0\t9\t16\t0\t0\t0\t0\t47\t8\t5\t1", r"item 2: frame: 9 is not a frame"),
        ("2\t0\t3\t16\tinf\t0\t0\t0\t47\t8\t5\t1", r"item 2: param1: 'inf' is not finite"),
        ("7\t0\t3\t16\t0\t0\t0\t0\t47\t8\t5\t1", r"item 2: index: 7 is out of order; allowed: 2"),
    ],
)
def test_a_mistake_in_a_file_of_waypoints_is_named_by_line_item_and_field(line: str, message: str) -> None:
    text = "\n".join([*WAYPOINTS.splitlines()[:3], line])
    with pytest.raises(ConfigError, match=message):
        wpl_plan.loads(text, "a.waypoints")


@pytest.mark.parametrize("text", ["", "QGC WPL 120\n", "QGC WPL 110\n", WAYPOINTS[: WAYPOINTS.index("1\t0\t3")]])
def test_a_file_without_heading_or_items_is_refused(text: str) -> None:
    with pytest.raises(ConfigError):
        wpl_plan.loads(text, "a.waypoints")


@pytest.mark.parametrize(
    ("source", "to", "message"),
    [
        (str(MISSIONS / "circle.yaml"), "a.plan", "kind: its targets are streamed by the client"),
        (str(MISSIONS / "rectangle-mission.yaml"), "a.plan", "item 0: frame: 1 has no latitude and longitude"),
        (str(MISSIONS / "rectangle-mission.yaml"), "a.kml", "a mission file ends in .yaml, .plan"),
        ("homeless.waypoints", "a.plan", "homeless.waypoints: home: is missing, a .plan must have one"),
        ("loiter.waypoints", "a.yaml", "item 0: command: 19 can't be written as YAML"),
        ("passing.waypoints", "a.yaml", "item 0: param3: 5 can't be written as YAML; it would become 0"),
    ],
)
def test_what_a_format_cannot_say_is_refused_by_item_and_field(
    source: str,
    to: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    line = "1\t0\t3\t{}\t0\t0\t{}\tnan\t47\t8\t5\t1\n"
    head = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47\t8\t100\t1\n"
    Path("homeless.waypoints").write_text("QGC WPL 110\n0" + line.format(16, 0)[1:])
    Path("loiter.waypoints").write_text(head + line.format(19, 0))
    Path("passing.waypoints").write_text(head + line.format(16, 5))
    assert main(["plan", source, "--to", to]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1
    assert not Path(to).exists()


def test_the_timelines_limits_are_what_the_vehicle_comes_with() -> None:
    spec = load_vehicle("yawsitter")
    declared = {d.name: d.default for d in declarations(spec.gains, spec.parameters)}
    assert {name: declared[name] for name in timeline.LIMITS} == timeline.LIMITS


def test_the_timeline_has_places_distances_and_times_that_add_up(capsys: pytest.CaptureFixture[str]) -> None:
    rows = timeline.rows(plan.load(MISSIONS / "rectangle-mission.plan"))
    assert [round(row.way_m or 0.0) for row in rows] == [5, 5, 20, 10, 20, 5, 5]
    times = [row.end_s or 0.0 for row in rows]
    assert times == sorted(times)
    assert main(["plan", str(MISSIONS / "rectangle-mission.plan")]) == 0
    said = capsys.readouterr().out
    assert "NAV_TAKEOFF" in said
    assert "70.0 m" in said
    circle = timeline.rows(plan.load(MISSIONS / "circle.yaml"))
    assert sum(row.way_m or 0.0 for row in circle) == pytest.approx(1.0 + 2.0 * math.pi * 2.0, rel=1e-3)
    assert circle[-1].end_s == 55.0


def test_an_altitude_above_sea_level_becomes_a_height_above_home(tmp_path: Path) -> None:
    source = tmp_path / "sea.waypoints"
    home, item = "0\t1\t0\t16\t0\t0\t0\t0\t47\t8\t488\t1", "1\t0\t0\t16\t0\t0\t0\tnan\t47\t8.001\t494\t1"
    source.write_text(f"QGC WPL 110\n{home}\n{item}\n")
    [item_written] = items(convert(source, tmp_path / "sea.yaml"))
    assert item_written.z == -6.0
    [row] = timeline.rows(plan.load(source))
    assert row.place_m == pytest.approx((0.0, 75.8, -6.0), abs=0.1)


def test_a_place_to_look_at_is_no_place_to_fly_to(tmp_path: Path) -> None:
    source = tmp_path / "roi.waypoints"
    source.write_text(WAYPOINTS + "5\t0\t3\t195\t0\t0\t0\t0\t47.5\t8.5456\t0\t1\n")
    *flown, looked_at = timeline.rows(plan.load(source))
    assert (looked_at.place_m, looked_at.way_m) == (None, None)
    assert looked_at.end_s == flown[-1].end_s
