"""QGroundControl's .plan files (JSON) → a Plan. Simple items are flown; what can't be flown is named, not skipped.

Format: QGroundControl developer guide, "Plan file format": fileType "Plan" version 1, mission version 2, SimpleItem
with seven params of which 5..7 are latitude, longitude and altitude in the item's own frame.
"""

import json
import math
from pathlib import PurePath
from typing import Annotated, Any, NoReturn

import msgspec

from gcs_tools.plan import Home, Item, Uploaded, item_of, written
from sitl import strict_yaml
from sitl.strict_yaml import ConfigError

FILE_TYPE, FILE_VERSION, MISSION_VERSION = "Plan", 1, 2
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


class _Shapes(msgspec.Struct):
    circles: list[Any] = []
    polygons: list[Any] = []
    points: list[Any] = []


class _File(msgspec.Struct, rename="camel"):
    file_type: str
    version: int
    mission: _Mission
    geo_fence: _Shapes = msgspec.field(default_factory=_Shapes)
    rally_points: _Shapes = msgspec.field(default_factory=_Shapes)


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
    for field, found in (
        ("geoFence.circles", plan.geo_fence.circles),
        ("geoFence.polygons", plan.geo_fence.polygons),
        ("rallyPoints.points", plan.rally_points.points),
    ):
        if found:
            source.fault(field, "fences and rally points can't be flown; allowed: an empty list")
    if not plan.mission.items:
        source.fault("mission.items", "has no items")
    items = tuple(_item(source, raw, f"mission.items[{i}]") for i, raw in enumerate(plan.mission.items))
    home = plan.mission.planned_home_position
    return Uploaded(PurePath(name).stem, name, items, LIMIT_S, Home(*home) if home else None)


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
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "groundStation": "QGroundControl",
        "mission": mission,
        "rallyPoints": {"points": [], "version": 2},
        "version": FILE_VERSION,
    }
    return json.dumps(whole, indent=4) + "\n"


def _no_constant(word: str) -> float:
    raise ValueError(f"{word} is not JSON")
