"""QGroundControl's .plan files (JSON) → a Plan. Simple items are flown; what can't be flown is named, not skipped.

Format: QGroundControl developer guide, "Plan file format": fileType "Plan" version 1, mission version 2, SimpleItem
with seven params of which 5..7 are latitude, longitude and altitude in the item's own frame.
"""

import json
import math
from pathlib import PurePath
from typing import Annotated, Any, NoReturn

import msgspec

from gcs_tools.fence import CIRCLE, POLYGON, RALLY_POINT, RETURN_POINT
from gcs_tools.plan import Home, Item, Uploaded, item_of, written
from sitl import strict_yaml
from sitl.strict_yaml import ConfigError

FILE_TYPE, FILE_VERSION, MISSION_VERSION, FENCE_VERSION, SHAPE_VERSION = "Plan", 1, 2, 2, 1
FRAME_GLOBAL, FRAME_ABOVE_HOME = 0, 3  # MAV_FRAME: as QGroundControl sends a fence's areas, and places with a height
LIMIT_S = 3600.0


class _SimpleItem(msgspec.Struct, rename="camel"):
    """What of an item reaches the vehicle; the rest is QGroundControl's own book-keeping."""

    type: str
    command: Annotated[int, msgspec.Meta(ge=0, le=65535)]
    frame: Annotated[int, msgspec.Meta(ge=0, le=255)]
    params: Annotated[list[float | None], msgspec.Meta(min_length=7, max_length=7)]
    auto_continue: bool = True


class _Mission(msgspec.Struct, rename="camel"):
    version: int
    items: list[dict[str, Any]]
    planned_home_position: tuple[float, float, float] | None = None


_LatLon = tuple[float, float]
_LatLonAlt = tuple[float, float, float]


class _Round(msgspec.Struct):
    center: _LatLon
    radius: Annotated[float, msgspec.Meta(gt=0.0, le=100_000.0)]


class _Circle(msgspec.Struct):
    circle: _Round
    inclusion: bool
    version: int = SHAPE_VERSION


class _Polygon(msgspec.Struct):
    polygon: Annotated[list[_LatLon], msgspec.Meta(min_length=3, max_length=10_000)]
    inclusion: bool
    version: int = SHAPE_VERSION


class _Fence(msgspec.Struct, rename="camel"):
    circles: list[_Circle] = []
    polygons: list[_Polygon] = []
    breach_return: _LatLonAlt | None = None
    version: int = FENCE_VERSION


class _Rally(msgspec.Struct):
    points: list[_LatLonAlt] = []
    version: int = FENCE_VERSION


class _File(msgspec.Struct, rename="camel"):
    file_type: str
    version: int
    mission: _Mission
    geo_fence: _Fence | None = None
    rally_points: _Rally | None = None


class _Source:
    def __init__(self, text: str, name: str) -> None:
        self.text, self.name = text, name

    def fault(self, field: str, message: str) -> NoReturn:
        try:  # JSON without tabs is YAML, whose reader remembers lines
            line = strict_yaml.line_of(self.text.replace("\t", " "), field)
        except Exception:
            line = 1
        raise ConfigError(f"{self.name}:{line}: {field or 'top level'}: {message}") from None

    def expect(self, field: str, value: Any, allowed: Any) -> None:
        if value != allowed:
            self.fault(field, f"{value!r} can't be read; allowed: {allowed!r}")

    def convert(self, data: Any, into: Any, prefix: str = "") -> Any:
        try:
            return msgspec.convert(data, into)
        except msgspec.ValidationError as error:
            message, _, where = str(error).partition(" - at `$")
            self.fault(f"{prefix}{where.rstrip('`')}".lstrip("."), message)


def loads(text: str, name: str) -> Uploaded:
    """The flight in the text of a .plan file; `name` stands for the file in messages. Raises ConfigError."""
    source = _Source(text, name)
    try:
        data = json.loads(text, parse_constant=_no_constant)
    except json.JSONDecodeError as error:
        raise ConfigError(f"{name}:{error.lineno}: not JSON: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{name}: not JSON: {error}") from None
    if not isinstance(data, dict) or "fileType" not in data:
        source.fault("", f"is not a QGroundControl plan; allowed: fileType {FILE_TYPE!r}")
    source.expect("fileType", data["fileType"], FILE_TYPE)
    source.expect("version", data.get("version"), FILE_VERSION)
    plan: _File = source.convert(data, _File)
    source.expect("mission.version", plan.mission.version, MISSION_VERSION)
    if not plan.mission.items:
        source.fault("mission.items", "has no items")
    items = tuple(_item(source, raw, f"mission.items[{i}]") for i, raw in enumerate(plan.mission.items))
    home = plan.mission.planned_home_position
    fence = _fence_items(source, plan.geo_fence) if plan.geo_fence is not None else None
    rally = _rally_items(source, plan.rally_points) if plan.rally_points is not None else None
    place = Home(*home) if home else None
    return Uploaded(PurePath(name).stem, name, items, LIMIT_S, place, fence=fence, rally=rally)


def _item(source: _Source, raw: dict[str, Any], at: str) -> Item:
    if raw.get("type") != "SimpleItem":
        pattern = f" ({raw['complexItemType']})" if "complexItemType" in raw else ""
        source.fault(f"{at}.type", f"{raw.get('type')!r}{pattern} can't be flown; allowed: 'SimpleItem'")
    item: _SimpleItem = source.convert(raw, _SimpleItem, at)
    return item_of(
        item.frame,
        item.command,
        item.params,
        item.auto_continue,
        lambda field, message: source.fault(f"{at}.{field}", message),
    )


def _placed(source: _Source, field: str, frame: int, command: int, p1: float, place: tuple[float, ...]) -> Item:
    """An item of a fence or a rally point; `field` has the place, of which latitude and longitude 0 are none."""

    def fault(which: str, message: str) -> NoReturn:
        source.fault(f"{field}[{int(which[7]) - 4}]" if which.startswith("params[") else field, message)

    if place[0] == place[1] == 0.0:
        fault("", "latitude and longitude 0 are no place")
    return item_of(frame, command, (p1, 0.0, 0.0, 0.0, *place, 0.0)[:7], True, fault)


def _fence_items(source: _Source, fence: _Fence) -> tuple[Item, ...]:
    """As QGroundControl sends them: polygons, circles, the point to return to."""
    source.expect("geoFence.version", fence.version, FENCE_VERSION)
    items = []
    for i, polygon in enumerate(fence.polygons):
        at, corners = f"geoFence.polygons[{i}]", polygon.polygon
        source.expect(f"{at}.version", polygon.version, SHAPE_VERSION)
        for k, corner in enumerate(corners):
            where, command = f"{at}.polygon[{k}]", POLYGON[polygon.inclusion]
            items.append(_placed(source, where, FRAME_GLOBAL, command, float(len(corners)), corner))
    for i, circle in enumerate(fence.circles):
        at, drawn = f"geoFence.circles[{i}]", circle.circle
        source.expect(f"{at}.version", circle.version, SHAPE_VERSION)
        where, command = f"{at}.circle.center", CIRCLE[circle.inclusion]
        items.append(_placed(source, where, FRAME_GLOBAL, command, drawn.radius, drawn.center))
    if fence.breach_return is not None:
        items.append(_placed(source, "geoFence.breachReturn", FRAME_ABOVE_HOME, RETURN_POINT, 0.0, fence.breach_return))
    return tuple(items)


def _rally_items(source: _Source, rally: _Rally) -> tuple[Item, ...]:
    source.expect("rallyPoints.version", rally.version, FENCE_VERSION)
    return tuple(
        _placed(source, f"rallyPoints.points[{i}]", FRAME_ABOVE_HOME, RALLY_POINT, 0.0, point)
        for i, point in enumerate(rally.points)
    )


def _shapes(plan: Uploaded) -> dict[str, Any]:
    """The object `geoFence`. Raises ConfigError for groups, which it has no word for."""
    circles, polygons, rest = [], [], {}
    k, items = 0, plan.fence or ()
    while k < len(items):
        item = items[k]
        if item.param2:
            message = f"group {item.param2:g} can't be written as .plan; allowed: 0"
            raise ConfigError(f"{plan.source}: fence item {k}: {message}")
        places = (
            [written(i)[1][4:] for i in items[k : k + int(item.param1)]] if item.command in POLYGON.values() else []
        )
        if places:
            polygon = {"inclusion": item.command == POLYGON[True], "polygon": [p[:2] for p in places]}
            polygons.append(polygon | {"version": SHAPE_VERSION})
        elif item.command == RETURN_POINT:
            rest = {"breachReturn": written(item)[1][4:]}
        else:
            circle = {"center": written(item)[1][4:6], "radius": item.param1}
            circles.append({"circle": circle, "inclusion": item.command == CIRCLE[True], "version": SHAPE_VERSION})
        k += len(places) or 1
    return rest | {"circles": circles, "polygons": polygons, "version": FENCE_VERSION}


def dumps(plan: Uploaded) -> str:
    """The text of a .plan file. A parameter that isn't a number is null. Raises ConfigError for a plan without home."""
    if plan.home is None:
        raise ConfigError(f"{plan.source}: home: is missing, a .plan must have one; give it with --home LAT,LON,ALT")
    items = []
    for i, item in enumerate(plan.items):
        frame, params = written(item)
        items.append(
            {
                "autoContinue": bool(item.autocontinue),
                "command": item.command,
                "doJumpId": i + 1,
                "frame": frame,
                "params": [p if math.isfinite(p) else None for p in params],
                "type": "SimpleItem",
            }
        )
    mission = {
        "cruiseSpeed": 3,
        "firmwareType": 12,  # MAV_AUTOPILOT_PX4
        "hoverSpeed": 3,
        "items": items,
        "plannedHomePosition": list(plan.home),
        "vehicleType": 2,  # MAV_TYPE_QUADROTOR
        "version": MISSION_VERSION,
    }
    whole = {
        "fileType": FILE_TYPE,
        "geoFence": _shapes(plan),
        "groundStation": "QGroundControl",
        "mission": mission,
        "rallyPoints": {"points": [written(i)[1][4:] for i in plan.rally or ()], "version": FENCE_VERSION},
        "version": FILE_VERSION,
    }
    return json.dumps(whole, indent=4) + "\n"


def _no_constant(word: str) -> float:
    raise ValueError(f"{word} is not JSON")
