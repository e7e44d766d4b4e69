"""Fences and rally points of mission files: read, written, drawn on the ground, and what a flight does to them."""

import json
import math
import random
from pathlib import Path
from typing import Any

import pytest

from gcs_tools import fence, fence_check, plan, qgc_plan, timeline, yaml_plan
from gcs_tools.__main__ import main
from gcs_tools.plan import Item, Uploaded
from sitl.geodesy import GeoPoint
from sitl.onboard.events import EventLog
from sitl.onboard.feasibility import Feasibility
from sitl.onboard.fence import Fence, shut_out
from sitl.onboard.places import Places
from sitl.onboard.plan import MissionItem
from sitl.onboard.store import MemoryStore
from sitl.strict_yaml import ConfigError
from sitl.vehicle import Vehicle, load_vehicle

FENCED = Path(__file__).parents[3] / "missions" / "rectangle-fenced.yaml"
HOME = "55.6985,37.3595,190"
ITEMS = """\
items:
  - {do: takeoff, at_m: [0, 0, -5]}
  - {do: waypoint, at_m: [20, 0, -5]}
  - {do: land, at_m: [0, 0]}
"""
ROOM = "  - {stay: inside, corners_m: [[-5, -5], [25, -5], [25, 5], [-5, 5]]}\n"


def mission(fence_lines: str, items: str = ITEMS, more: str = "") -> str:
    return f"name: test\nkind: mission\nfence:\n{fence_lines}{more}{items}"


def loaded(text: str) -> Uploaded:
    found = yaml_plan.loads(text, "test.yaml")
    assert isinstance(found, Uploaded)
    return found


# what the files say


def test_areas_become_fence_items_in_metres_from_home() -> None:
    circles = "  - {stay: outside, centre_m: [10, 0], radius_m: 2.5, group: 3}\n  - {return_m: [1, 2, -4]}\n"
    found = loaded(mission(ROOM + circles, more="rally:\n  - {at_m: [5, 6, -7]}\n"))
    assert found.fence is not None
    assert [i.command for i in found.fence] == [5001, 5001, 5001, 5001, 5004, 5000]
    assert [i[:3] for i in found.fence[:4]] == [(1, 5001, 4.0)] * 4
    assert [(i.x, i.y) for i in found.fence[:2]] == [(-50_000, -50_000), (250_000, -50_000)]
    assert (found.fence[4].param1, found.fence[4].param2) == (2.5, 3.0)
    assert found.fence[5].place_m() == (1.0, 2.0, -4.0)
    assert found.rally is not None
    assert [(i.command, i.place_m()) for i in found.rally] == [(5100, (5.0, 6.0, -7.0))]


def test_a_yaml_file_without_the_keys_says_nothing_and_one_with_empty_ones_says_none() -> None:
    silent, none = (
        loaded(f"name: a\nkind: mission\n{ITEMS}"),
        loaded(f"name: a\nkind: mission\nfence: []\nrally: []\n{ITEMS}"),
    )
    assert (silent.fence, silent.rally) == (None, None)
    assert (none.fence, none.rally) == ((), ())


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("  - {stay: inside}\n", "test.yaml:4: fence[0]: is neither a polygon (corners_m), a circle (centre_m) nor a"),
        ("  - {stay: near, centre_m: [0, 0], radius_m: 5}\n", "fence[0].stay: 'near' is not one of inside, outside"),
        ("  - {centre_m: [0, 0], radius_m: 5}\n", "test.yaml:4: fence[0]: 'stay' is missing"),
        ("  - {stay: inside, centre_m: [0, 0]}\n", "test.yaml:4: fence[0]: 'radius_m' is missing"),
        (ROOM + "  - {stay: inside, centre_m: [0, 0], radius_m: 0}\n", "fence[1].radius_m: Expected `float` >"),
        ("  - {stay: inside, corners_m: [[0, 0], [1, 1]]}\n", "fence[0].corners_m: Expected `array` of length >= 3"),
        ("  - {stay: inside, corners_m: [[0, 0, 0], [1, 1], [2, 2]]}\n", "fence[0].corners_m[0]: Expected `array`"),
        ("  - {stay: inside, centre_m: [0, 0], radius_m: 5, down_m: 3}\n", "fence[0].down_m: is not a field here"),
        ("  - {stay: inside, centre_m: [0, 0], radius_m: 5, group: 256}\n", "fence[0].group: Expected `int` <= 255"),
        ("  - {return_m: [0, 0, 5]}\n", "test.yaml:4: fence[0].return_m[2]: Expected `float` <= 0.0"),
        ("  - {return_m: [0, 0, -5]}\n" * 2, "test.yaml:5: fence[1].return_m: there can be one point to return to"),
        ("  - inside\n", "test.yaml:4: fence[0]: Expected `object`, got `str`"),
        (ROOM + "rally:\n  - {at_m: [1, 2]}\n", "test.yaml:6: rally[0].at_m: Expected `array` of length 3"),
        (ROOM + "rally: 5\n", "test.yaml:5: rally: Expected `array"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_fence_is_named_by_line_field_and_what_is_allowed(lines: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        yaml_plan.loads(mission(lines), "test.yaml")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


POLYGON: dict[str, Any] = {"polygon": [[47.0, 8.0], [47.001, 8.0], [47.001, 8.001]], "inclusion": True, "version": 1}
CIRCLE: dict[str, Any] = {"circle": {"center": [47.0005, 8.0005], "radius": 3.5}, "inclusion": False, "version": 1}


def qgc(**changes: Any) -> str:
    """The text of a plan as QGroundControl writes it, one waypoint within a fence."""
    item = {"type": "SimpleItem", "autoContinue": True, "command": 16, "doJumpId": 1, "frame": 3}
    whole = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"circles": [CIRCLE], "polygons": [POLYGON], "version": 2, "breachReturn": [47.0002, 8.0001, 9]},
        "rallyPoints": {"points": [[47.0003, 8.0002, 12.5]], "version": 2},
        "mission": {
            "version": 2,
            "plannedHomePosition": [47.0001, 8.00005, 488],
            "items": [{**item, "params": [0, 0, 0, None, 47.0004, 8.0001, 5]}],
        },
    }
    return json.dumps({**whole, **changes}, indent=4)


def test_qgroundcontrols_fence_and_rally_points_become_the_items_that_it_sends_itself() -> None:
    found = qgc_plan.loads(qgc(), "field.plan")
    assert found.fence is not None
    assert [(i.frame, i.command, i.param1) for i in found.fence] == [
        *[(5, 5001, 3.0)] * 3, (5, 5004, 3.5), (6, 5000, 0.0),
    ]  # fmt: skip
    assert (found.fence[1].x, found.fence[1].y, found.fence[1].z) == (470_010_000, 80_000_000, 0.0)
    assert (found.fence[4].x, found.fence[4].z) == (470_002_000, 9.0)
    assert found.rally == (Item(6, 5100, 0.0, 0.0, 0.0, 0.0, 470_003_000, 80_002_000, 12.5),)


def test_a_plan_written_again_has_the_fence_and_the_rally_points_that_it_had() -> None:
    again = json.loads(qgc_plan.dumps(qgc_plan.loads(qgc(), "field.plan")))
    wanted = json.loads(qgc())
    assert again["geoFence"] == wanted["geoFence"]
    assert again["rallyPoints"] == wanted["rallyPoints"]


def test_a_plan_without_the_object_says_nothing_and_one_with_an_empty_one_says_none() -> None:
    without = json.loads(qgc())
    del without["geoFence"], without["rallyPoints"]
    silent = qgc_plan.loads(json.dumps(without), "a.plan")
    empty = qgc_plan.loads(qgc(geoFence={"circles": [], "polygons": [], "version": 2}), "a.plan")
    assert (silent.fence, silent.rally) == (None, None)
    assert empty.fence == ()


def fenced(**changes: Any) -> dict[str, Any]:
    return {"geoFence": {"circles": [CIRCLE], "polygons": [POLYGON], "version": 2, **changes}}


def rally(*points: list[float], version: int = 2) -> dict[str, Any]:
    return {"rallyPoints": {"points": points, "version": version}}


@pytest.mark.parametrize(
    ("changes", "message", "line"),
    [
        (fenced(version=1), "geoFence.version: 1 can't be read; allowed: 2", '"version": 1\n    },\n    "rally'),
        (fenced(polygons=[{**POLYGON, "version": 9}]), "geoFence.polygons[0].version: 9 can't be read", "9"),
        (fenced(circles=[{**CIRCLE, "version": 9}]), "geoFence.circles[0].version: 9 can't be read; allowed: 1", "9"),
        (fenced(circles=[{}]), "geoFence.circles[0]: Object missing required field `circle`", "{}"),
        (
            fenced(circles=[{"circle": {"center": [91, 8], "radius": 3}, "inclusion": True}]),
            "geoFence.circles[0].circle.center[0]: 91° is no place; allowed -90 to 90", "91",
        ),
        (
            fenced(circles=[{"circle": {"center": [47, 8], "radius": 0}, "inclusion": True}]),
            "geoFence.circles[0].circle.radius: Expected `float` > 0.0", '"radius": 0',
        ),
        (
            fenced(polygons=[{**POLYGON, "polygon": [[47, 8], [47, 9], [0, 0]]}]),
            "geoFence.polygons[0].polygon[2]: latitude and longitude 0 are no place", "[\n                        0",
        ),
        (
            fenced(polygons=[{**POLYGON, "polygon": [[47, 8], [47, 181], [48, 8]]}]),
            "geoFence.polygons[0].polygon[1][1]: 181° is no place; allowed -180 to 180", "181",
        ),
        (
            fenced(polygons=[{**POLYGON, "polygon": [[47, 8]]}]),
            "geoFence.polygons[0].polygon: Expected `array` of length >= 3", '"polygon": [',
        ),
        (fenced(breachReturn=[47, 8]), "geoFence.breachReturn: Expected `array` of length 3", '"breachReturn"'),
        (rally([47, 8]), "rallyPoints.points[0]: Expected `array` of length 3", None),
        (rally(version=3), "rallyPoints.version: 3 can't be read; allowed: 2", '"version": 3'),
    ],
)  # fmt: skip
def test_a_fault_in_a_plans_fence_is_named_by_line_and_field(
    changes: dict[str, Any], message: str, line: str | None
) -> None:
    text = qgc(**changes)
    with pytest.raises(ConfigError) as caught:
        qgc_plan.loads(text, "field.plan")
    told = str(caught.value)
    assert message in told
    if line is not None:
        number = int(told.split(":")[1])
        assert text[: text.index(line)].count("\n") + 1 == number


def test_the_fence_goes_from_yaml_to_plan_and_back(tmp_path: Path) -> None:
    there, back = tmp_path / "f.plan", tmp_path / "f.yaml"
    assert main(["plan", str(FENCED), "--home", HOME, "--to", str(there)]) == 0
    assert main(["plan", str(there), "--to", str(back)]) == 0
    old, new = plan.load(FENCED), plan.load(back)
    for a, b in zip((*old.fence, *old.rally), (*new.fence, *new.rally), strict=True):
        assert b[:6] == a[:6]
        assert (b.x, b.y) == pytest.approx((a.x, a.y), abs=110)  # 1.1 cm, what a degE7 is
        assert b.z == a.z


def test_groups_and_the_point_to_return_to_are_written_as_yaml_again() -> None:
    lines = ROOM + "  - {stay: inside, centre_m: [0, 0], radius_m: 7.5, group: 2}\n  - {return_m: [1, 2, -4]}\n"
    first = loaded(mission(lines, more="rally:\n  - {at_m: [0.5, 0, -3]}\n"))
    second = loaded(yaml_plan.dumps(first))
    assert str((second.fence, second.rally)) == str((first.fence, first.rally))


@pytest.mark.parametrize(
    ("lines", "to", "message"),
    [
        (ROOM, "a.waypoints", "test.yaml: fence: would be lost (items: 4), QGC WPL 110 has a mission's only"),
        ("rally:\n  - {at_m: [0, 0, -3]}\n", "a.txt", "test.yaml: rally: would be lost (items: 1)"),
        (ROOM[:-2] + ", group: 1}\n", "a.plan", "test.yaml: fence item 0: group 1 can't be written as .plan"),
    ],
)  # fmt: skip
def test_what_a_format_has_no_words_for_is_refused_rather_than_lost(
    lines: str,
    to: str,
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    text = mission(lines) if lines != "" and "rally" not in lines else f"name: a\nkind: mission\n{lines}{ITEMS}"
    Path("test.yaml").write_text(text)
    assert main(["plan", "test.yaml", "--home", HOME, "--to", to]) == 2
    assert message in capsys.readouterr().err
    assert not Path(to).exists()


# what lies within


def drawn(rng: random.Random) -> tuple[Item, ...]:
    """A fence of up to four areas of either shape and kind, in up to two groups."""
    items: list[Item] = []
    for _ in range(rng.randint(1, 4)):
        inclusion, group = rng.random() < 0.6, float(rng.randint(0, 1))
        north, east, size = (rng.uniform(-8, 8), rng.uniform(-8, 8), rng.uniform(3, 12))
        blank = Item(1, 0, 0.0, group, 0.0, 0.0, 0, 0, 0.0)
        if rng.random() < 0.4:
            x, y = round(north * 1e4), round(east * 1e4)
            items.append(blank._replace(command=fence.CIRCLE[inclusion], param1=size, x=x, y=y))
            continue
        count = rng.randint(3, 7)
        for _ in range(count):
            x, y = (round((at + rng.uniform(-size, size)) * 1e4) for at in (north, east))
            items.append(blank._replace(command=fence.POLYGON[inclusion], param1=float(count), x=x, y=y))
    return tuple(items)


def test_a_place_is_judged_as_the_vehicle_judges_it() -> None:
    rng, verdicts = random.Random(5), []
    for _ in range(60):
        items = drawn(rng)
        stored = Fence(MemoryStore(), EventLog(), Places(GeoPoint(55.0, 37.0, 0.0)))
        assert stored.replace([MissionItem(*i[:2], 0, 1, *i[2:9], 1) for i in items]) is None
        areas = fence.areas(items, Item.place_m)
        for _ in range(40):
            place = rng.uniform(-20, 20), rng.uniform(-20, 20)
            theirs, mine = shut_out(stored.areas, *place), fence.first_outside(areas, [place])
            assert (mine[1].reason if mine else None) == (theirs.reason if theirs else None)
            verdicts.append(theirs is None)
    assert 200 < sum(verdicts) < len(verdicts) - 200


def test_the_begin_of_a_way_outside_is_where_the_border_is() -> None:
    areas = fence.areas(
        loaded(mission(ROOM + "  - {stay: outside, centre_m: [10, 1], radius_m: 2}\n")).fence or (), Item.place_m
    )
    ways = [((0.0, -4.0), (20.0, -4.0)), ((0.0, 1.0), (20.0, 1.0)), ((0.0, 0.0), (0.0, 10.0)), ((3.0, 3.0), (3.0, 3.0))]
    within, through, out, nowhere = fence.leaves(areas, ways)
    assert within is None
    assert through is not None
    assert through[0] == pytest.approx(8.0 / 20.0)
    assert through[1].reason == "inside the forbidden circle of fence item 4"
    assert out is not None
    assert out[0] == pytest.approx(0.5)
    assert nowhere is None


def test_of_a_way_through_two_areas_the_first_is_named() -> None:
    two = [f"  - {{stay: outside, centre_m: [{north}, 0], radius_m: 1}}\n" for north in (15, 5)]
    [left] = fence.leaves(
        fence.areas(loaded(mission("".join(two))).fence or (), Item.place_m), [((0.0, 0.0), (20.0, 0.0))]
    )
    assert left is not None
    assert (left[0], left[1].item) == (pytest.approx(4.0 / 20.0), 1)


def test_of_ways_to_and_from_an_item_outside_nothing_is_said_beside_the_item() -> None:
    outside = loaded(mission(ROOM, ITEMS.replace("[20, 0, -5]", "[20, 6, -5]")))
    assert len(timeline.objections(outside)) == 1


def test_areas_have_the_size_that_they_have() -> None:
    corners, middle = fence.areas(
        loaded(mission(ROOM + "  - {stay: outside, centre_m: [10, 1], radius_m: 2}\n")).fence or (), Item.place_m
    )
    assert corners.size_m2 == pytest.approx(300.0)
    assert middle.size_m2 == pytest.approx(4.0 * math.pi)


# what `gcs plan` says


def told(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], *, name: str = "a.yaml"
) -> tuple[int, str, str]:
    path = tmp_path / name
    path.write_text(text)
    code = main(["plan", str(path)])
    said = capsys.readouterr()
    return code, " ".join(said.out.split()), said.err.replace(f"{tmp_path}/", "").strip()


def test_a_mission_within_its_fence_is_told_to_be(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = told(FENCED.read_text(), tmp_path, capsys)
    assert (code, err) == (0, "")
    assert "within a polygon of 4 corners (504 m²), outside a circle of radius 2.5 m (20 m²)" in out
    assert "1 rally point" in out
    assert "every place and the whole way lie inside" in out


@pytest.mark.parametrize(
    ("lines", "items", "message"),
    [
        (
            ROOM, ITEMS.replace("[20, 0, -5]", "[20, 6, -5]"),
            "item 1 lies outside the fence: outside the polygon of fence item 0: the vehicle doesn't start it",
        ),
        (
            ROOM + "  - {stay: outside, centre_m: [10, 0], radius_m: 2}\n", ITEMS,
            "the way from item 0 to item 1 is inside the forbidden circle of fence item 4 from north 8.00 m,"
            " east 0.00 m on: a breach in flight",
        ),
        (
            "  - {stay: outside, centre_m: [0, 1], radius_m: 2}\n", ITEMS,
            "home is inside the forbidden circle of fence item 0: the vehicle refuses such a fence",
        ),
        (
            ROOM + "rally:\n  - {at_m: [0, 9, -3]}\n", ITEMS,
            "rally point 0 is outside the polygon of fence item 0: Return doesn't lead there",
        ),
    ],
)  # fmt: skip
def test_what_breaks_the_fence_is_named(
    lines: str, items: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = told(mission(lines, items), tmp_path, capsys)
    assert code == 2
    assert message in out
    assert err == f"gcs plan: a.yaml: {message}"


def test_of_a_plan_without_a_home_it_is_not_asked_whether_home_lies_within(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = json.loads(qgc(geoFence={"circles": [CIRCLE], "polygons": [], "version": 2}))
    [item] = whole["mission"]["items"]
    item["params"][4:6] = CIRCLE["circle"]["center"]
    del whole["mission"]["plannedHomePosition"]
    code, out, _ = told(json.dumps(whole), tmp_path, capsys, name="a.plan")
    assert code == 2
    assert "item 0 lies outside the fence" in out
    assert "home is" not in out


def test_a_loiter_is_judged_by_its_whole_circle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = json.loads(qgc(geoFence={"circles": [], "polygons": [], "version": 2}, rallyPoints={"points": []}))
    around = {"center": whole["mission"]["plannedHomePosition"][:2], "radius": 40}
    whole["geoFence"]["circles"] = [{"circle": around, "inclusion": True, "version": 1}]
    [item] = whole["mission"]["items"]
    for command, params in ((16, [0, 0, 0]), (18, [1, 0, 30])):
        item.update(command=command, params=[*params, None, 47.0002, 8.00015, 5])
        code, out, _ = told(json.dumps(whole), tmp_path, capsys, name="a.plan")
        assert (code == 2) is (command == 18)
        assert ("item 0 lies outside the fence: outside the circle of fence item 0" in out) is (command == 18)


def test_a_mission_is_judged_as_the_vehicle_judges_it() -> None:
    rng, vehicle, verdicts = random.Random(8), Vehicle(load_vehicle("yawsitter")), []
    plans, told = vehicle.plans, Feasibility(vehicle.plans)
    for _ in range(80):
        areas = drawn(rng)
        if plans.fence.replace([MissionItem(*i[:2], 0, 1, *i[2:9], 1) for i in areas]) is not None:
            continue  # it shuts home out
        flown = [Item(1, 22, 0.0, 0.0, 0.0, 0.0, *around(rng), -5.0)]
        for command in rng.choices((16, 18, 21, 31, 195), k=4):
            turns, radius = (1.0, 2.0) if command == 18 else (0.0, 0.0)
            flown.append(Item(1, command, turns, 0.0, radius, 0.0, *around(rng), -5.0))
        assert plans.mission.replace([MissionItem(*i[:2], 0, 1, *i[2:9]) for i in flown]) is None
        mine = fence_check.along_items(Uploaded("", "", tuple(flown), 60.0, None, fence=areas), None, [])
        theirs = told.objection((0.0, 0.0, 0.0))
        assert [text.removesuffix(": the vehicle doesn't start it") for text in mine[:1]] == (
            [theirs] if theirs else []
        )
        verdicts.append(not theirs)
    assert 5 < sum(verdicts) < len(verdicts) - 5


def around(rng: random.Random) -> tuple[int, int]:
    """x and y of a place near home."""
    return round(rng.gauss(0.0, 2e4)), round(rng.gauss(0.0, 2e4))


def test_a_streamed_flight_that_leaves_its_own_fence_is_refused_where_it_leaves() -> None:
    text = (
        "name: a\nkind: circle\nradius_m: 2\naltitude_m: 1\nclimb_s: 5\nlap_s: 50\n"
        "fence:\n  - {stay: inside, centre_m: [0, 0], radius_m: %s}\n"
    )
    assert yaml_plan.loads(text % 4.1, "a.yaml").fence is not None
    with pytest.raises(
        ConfigError, match=r"^a\.yaml:7: fence: the flight is outside the circle of fence item 0 at t = 2"
    ):
        yaml_plan.loads(text % 3.9, "a.yaml")


def test_a_return_leads_to_the_nearest_of_home_and_the_rally_points_within_the_fence() -> None:
    rows = timeline.rows(plan.load(FENCED))
    assert rows[-1].place_m == (16.0, 6.0, 0.0)
    shut = FENCED.read_text().replace("[24, 9], [-4, 9]]", "[24, 5.5], [-4, 5.5]]")
    assert timeline.rows(loaded(shut))[-1].place_m == (0.0, 0.0, 0.0)
