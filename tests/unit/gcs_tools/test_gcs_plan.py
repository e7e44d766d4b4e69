"""Mission files: what they come to, and that every mistake is named by file, line, field and what is allowed."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from gcs_tools import plan, qgc_plan, yaml_plan
from gcs_tools.plan import Streamed, Uploaded
from sitl.strict_yaml import ConfigError

MISSIONS = Path(__file__).parents[3] / "missions"

WAYPOINTS = """\
name: test
kind: waypoints
duration_s: 20
waypoints:
  - {t_s: 0, at_m: [0, 0, 0]}
  - {t_s: 10, at_m: [0, 0, -5]}
  - {t_s: 20, at_m: [3, 0, -5]}
"""
CIRCLE = """\
name: test
kind: circle
radius_m: 2
altitude_m: 1
climb_s: 5
lap_s: 50
"""
MISSION = """\
name: test
kind: mission
items:
  - {do: takeoff, at_m: [0, 0, -5]}
  - {do: waypoint, at_m: [1.25, -3, -5], hold_s: 2, acceptance_m: 0.3, heading_deg: 90}
  - {do: speed, speed_m_s: 2}
  - {do: land, at_m: [0, 0]}
"""


def streamed(text: str) -> Streamed:
    flight = yaml_plan.loads(text, "test.yaml")
    assert isinstance(flight, Streamed)
    return flight


@pytest.mark.parametrize("path", sorted(MISSIONS.iterdir()), ids=lambda p: p.name)
def test_every_mission_file_of_the_project_loads(path: Path) -> None:
    flight = plan.load(path)
    assert flight.source == str(path)
    assert flight.name == path.stem


def test_the_rectangle_is_the_papers_table() -> None:
    flight = plan.load(MISSIONS / "rectangle.yaml")
    assert isinstance(flight, Streamed)
    corners = [flight.reference.at(t).position_m for t in (0, 10, 20, 30, 40, 50, 60, 65, 70)]
    assert corners == [
        (0, 0, 0),
        (0, 0, -5),
        (0, -5, -5),
        (20, -5, -5),
        (20, 5, -5),
        (0, 5, -5),
        (0, 0, -5),
        (0, 0, 0),
        (0, 0, 0),
    ]
    assert flight.duration_s == 70
    assert flight.key_times_s == (20, 30, 40, 50, 60, 65)
    assert flight.paper == "rectangle"


def test_both_circles_climb_five_seconds_and_lap_fifty() -> None:
    for name in ("circle.yaml", "circle-constant-speed.yaml"):
        flight = plan.load(MISSIONS / name)
        assert isinstance(flight, Streamed)
        assert flight.duration_s == 55
        for t in (5, 55):
            assert flight.reference.at(t).position_m == pytest.approx((0, 0, -1), abs=1e-9)
        assert flight.reference.at(30).position_m == pytest.approx((-4, 0, -1), abs=1e-9)


def test_mission_items_become_wire_items_in_the_local_frame() -> None:
    flight = yaml_plan.loads(MISSION, "test.yaml")
    assert isinstance(flight, Uploaded)
    takeoff, waypoint, speed, land = flight.items
    assert (takeoff.frame, takeoff.command, takeoff.z) == (1, 22, -5)
    assert waypoint[:9] == (1, 16, 2.0, 0.3, 0.0, 90.0, 12500, -30000, -5.0)
    assert waypoint.place_m() == (1.25, -3.0, -5.0)
    assert speed[:4] == (2, 178, 1.0, 2.0)
    assert speed.place_m() is None
    assert (land.frame, land.command, land.z) == (1, 21, 0.0)
    assert math.isnan(land.param4)


def test_a_heading_of_null_keeps_the_vehicles_own() -> None:
    assert streamed(WAYPOINTS + "heading_deg: null\n").heading_rad is None
    assert streamed(WAYPOINTS + "heading_deg: 90\n").heading_rad == pytest.approx(math.pi / 2)
    assert streamed(WAYPOINTS).heading_rad == 0.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind: waypoints\n", "test.yaml:1: top level: 'name' is missing"),
        (
            "name: a\nkind: square\n",
            "test.yaml:2: kind: 'square' is not one of waypoints, circle, mission",
        ),
        ("name: a\n", "test.yaml:1: top level: 'kind' is missing; allowed: waypoints, circle, mission"),
        (WAYPOINTS.replace("t_s: 20,", "t_s: 9,"), "test.yaml:7: waypoints[2].t_s: 9 s doesn't come after"),
        (WAYPOINTS.replace("[3, 0, -5]", "[3, 0, 5]"), "test.yaml:7: waypoints[2].at_m[2]: Expected `float` <= 0.0"),
        (WAYPOINTS.replace("[3, 0, -5]", "[3, .nan, -5]"), "test.yaml:7: waypoints[2].at_m[1]: Expected `float` >="),
        (WAYPOINTS.replace("[3, 0, -5]", "[3, 0]"), "test.yaml:7: waypoints[2].at_m: Expected `array` of length 3"),
        (WAYPOINTS.replace("[3, 0, -5]", "[3000, 0, -5]"), "allowed up to 10 m/s and 8 m/s²"),
        (WAYPOINTS.replace("t_s: 0,", "t_s: 1,"), "test.yaml:5: waypoints[0]: a flight starts on the ground"),
        (WAYPOINTS.replace("duration_s: 20", "duration_s: 19"), "test.yaml:3: duration_s: 19 s ends before the last"),
        (WAYPOINTS + "key_times_s: [5, 25]\n", "test.yaml:8: key_times_s[1]: 25 s is after the end; allowed 0 to 20 s"),
        (WAYPOINTS + "speed: 3\n", "test.yaml:8: speed: is not a field here; allowed: name, kind, description"),
        (WAYPOINTS + "paper: oval\n", "test.yaml:8: paper: 'oval' is not one of rectangle, circle"),
        (WAYPOINTS + "name: again\n", "test.yaml:8: 'name' is given twice"),
        (CIRCLE + "direction: left\n", "test.yaml:7: direction: 'left' is not one of clockwise, anticlockwise"),
        (CIRCLE + "ramp_s: 30\n", "test.yaml:7: ramp_s: 30 s up and down doesn't fit; allowed up to 25 s"),
        (CIRCLE.replace("lap_s: 50", "lap_s: 1"), "test.yaml:6: lap_s: this circle takes 12.6 m/s"),
        (CIRCLE.replace("radius_m: 2", "radius_m: 0"), "test.yaml:3: radius_m: Expected `float` > 0.0"),
        (CIRCLE.replace("radius_m: 2", "radius_m: two"), "test.yaml:3: radius_m: Expected `float`, got `str`"),
        (MISSION.replace("do: land", "do: crash"), "test.yaml:7: items[3].do: 'crash' is not one of takeoff, waypoint"),
        (MISSION.replace("speed_m_s: 2", "speed_m_s: 200"), "test.yaml:6: items[2].speed_m_s: Expected `float` <= 10"),
        (MISSION.replace("hold_s", "wait_s"), "test.yaml:5: items[1].wait_s: is not a field here; allowed: do, at_m"),
        (MISSION.replace("do: speed, ", ""), "test.yaml:6: items[2]: 'do' is missing; allowed: takeoff, waypoint"),
        ("- 1\n- 2\n", "test.yaml:1: top level: Expected `object`, got `array`"),
        ("name: [\n", "test.yaml:2:"),
    ],
)
def test_a_mistake_is_named_by_file_line_field_and_what_is_allowed(text: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        yaml_plan.loads(text, "test.yaml")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_lists_what_is_there(tmp_path: Path) -> None:
    (tmp_path / "here.yaml").write_text(WAYPOINTS)
    with pytest.raises(ConfigError, match=r"gone\.yaml: no such mission file .*here\.yaml"):
        plan.load(tmp_path / "gone.yaml")


def test_a_folder_and_a_foreign_ending_are_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "flight.kml").write_text("x")
    with pytest.raises(ConfigError, match=r"flight\.kml: a mission file ends in \.yaml, \.plan"):
        plan.load(tmp_path / "flight.kml")
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(ConfigError, match="is a folder"):
        plan.load(tmp_path / "folder.yaml")


def qgc(**changes: Any) -> dict[str, Any]:
    """A plan as QGroundControl writes it, with one take-off and one waypoint."""
    return {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "rallyPoints": {"points": [], "version": 2},
        "mission": {
            "version": 2,
            "firmwareType": 12,
            "vehicleType": 20,
            "cruiseSpeed": 15,
            "hoverSpeed": 5,
            "plannedHomePosition": [47.397742, 8.545594, 488],
            "items": [
                qgc_item(22, [0, 0, 0, None, 47.397742, 8.545594, 5]),
                qgc_item(16, [0, 0, 0, None, 47.4, 8.5, 5]),
            ],
        },
        **changes,
    }


def qgc_item(command: int, params: list[float | None], **changes: Any) -> dict[str, Any]:
    item = {"type": "SimpleItem", "autoContinue": True, "command": command, "doJumpId": 1, "frame": 3, "params": params}
    return {**item, **changes}


def with_item(**changes: Any) -> dict[str, Any]:
    whole = qgc()
    whole["mission"]["items"][1].update(changes)
    return whole


def test_a_qgroundcontrol_plan_becomes_integer_items() -> None:
    flight = qgc_plan.loads(json.dumps(qgc(), indent="\t"), "field.plan")
    assert flight.name == "field"
    assert flight.home == (47.397742, 8.545594, 488)
    takeoff = flight.items[0]
    assert (takeoff.frame, takeoff.command, takeoff.x, takeoff.y, takeoff.z) == (6, 22, 473977420, 85455940, 5.0)
    assert math.isnan(takeoff.param4)
    assert takeoff.autocontinue == 1


def test_an_item_in_the_mission_frame_carries_its_parameters_unscaled() -> None:
    whole = qgc()
    whole["mission"]["items"].append(qgc_item(178, [1, 2, -1, 0, 7, 0, 0], frame=2))
    item = qgc_plan.loads(json.dumps(whole), "a.plan").items[2]
    assert (item.frame, item.param2, item.x, item.z) == (2, 2.0, 7, 0.0)


@pytest.mark.parametrize(
    ("whole", "message"),
    [
        (qgc(fileType="Parameters"), "fileType: 'Parameters' can't be read; allowed: 'Plan'"),
        (qgc(version=3), "version: 3 can't be read; allowed: 1"),
        ({"a": 1}, "is not a QGroundControl plan; allowed: fileType 'Plan'"),
        (qgc(mission={"version": 2, "items": []}), "mission.items: has no items"),
        (qgc(mission={"version": 1, "items": []}), "mission.version: 1 can't be read; allowed: 2"),
        (qgc(mission={"version": 2}), "mission: Object missing required field `items`"),
        (
            with_item(type="ComplexItem", complexItemType="survey"),
            "mission.items[1].type: 'ComplexItem' (survey) can't be flown; allowed: 'SimpleItem'",
        ),
        (with_item(params=[0, 0, 0]), "mission.items[1].params: Expected `array` of length >= 7"),
        (with_item(params=[0, 0, 0, 0, 91, 0, 5]), "mission.items[1].params[4]: 91° is no place; allowed -90 to 90"),
        (with_item(frame=4), "mission.items[1].frame: 4 is not a frame of mission items; allowed: 0, 1, 2"),
        (with_item(command="up"), "mission.items[1].command: Expected `int`, got `str`"),
    ],
)
def test_a_plan_that_cannot_be_flown_says_where_and_why(whole: dict[str, Any], message: str) -> None:
    text = json.dumps(whole, indent=4)
    with pytest.raises(ConfigError) as caught:
        qgc_plan.loads(text, "field.plan")
    assert message in str(caught.value)


def test_a_fault_in_a_plan_names_its_line() -> None:
    text = json.dumps(with_item(frame=4), indent=4)
    with pytest.raises(ConfigError) as caught:
        qgc_plan.loads(text, "field.plan")
    line = int(str(caught.value).split(":")[1])
    assert '"frame": 4' in text.splitlines()[line - 1]


def test_a_plan_that_is_not_json_names_the_line() -> None:
    with pytest.raises(ConfigError, match=r"^field\.plan:2: not JSON: "):
        qgc_plan.loads('{"fileType": "Plan",\n nonsense}', "field.plan")
    with pytest.raises(ConfigError, match=r"NaN is not JSON"):
        qgc_plan.loads('{"fileType": NaN}', "field.plan")
