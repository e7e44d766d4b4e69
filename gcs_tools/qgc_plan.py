"""QGroundControl's .plan files (JSON) → a Plan. Simple items are flown; what can't be flown is named, not skipped.

Format: QGroundControl developer guide, "Plan file format": fileType "Plan" version 1, mission version 2, SimpleItem
with seven params of which 5..7 are latitude, longitude and altitude in the item's own frame.
"""

import json
import math
from pathlib import PurePath
from typing import Annotated, Any, NoReturn

import msgspec

from gcs_tools.plan import FRAME_MISSION, GLOBAL_FRAMES, GLOBAL_SCALE, LOCAL_FRAMES, LOCAL_SCALE, Home, Item, Uploaded
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
    p1, p2, p3, p4, p5, p6, p7 = (math.nan if p is None else float(p) for p in item.params)
    if item.frame in GLOBAL_FRAMES:
        frame, scale = GLOBAL_FRAMES[item.frame], GLOBAL_SCALE
        for k, (value, limit) in enumerate(((p5, 90.0), (p6, 180.0)), start=4):
            if not abs(value) <= limit and not math.isnan(value):
                source.fault(f"{at}.params[{k}]", f"{value:g}° is no place; allowed -{limit:g} to {limit:g}")
    elif item.frame in LOCAL_FRAMES:
        frame, scale = item.frame, LOCAL_SCALE
    elif item.frame == FRAME_MISSION:
        frame, scale = item.frame, 1.0
    else:
        known = ", ".join(map(str, sorted((*GLOBAL_FRAMES, *LOCAL_FRAMES, FRAME_MISSION))))
        source.fault(f"{at}.frame", f"{item.frame} is not a frame of mission items; allowed: {known}")
    x, y = (0 if math.isnan(p) else round(p * scale) for p in (p5, p6))
    if not all(-(2**31) <= value < 2**31 for value in (x, y)):
        source.fault(f"{at}.params", "a coordinate is too large for the link")
    return Item(frame, item.command, p1, p2, p3, p4, x, y, p7, int(item.auto_continue))


def _no_constant(word: str) -> float:
    raise ValueError(f"{word} is not JSON")
