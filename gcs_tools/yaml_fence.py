"""`fence:` and `rally:` of the project's own mission files: their items read and written again."""

import json
from collections.abc import Sequence
from typing import Annotated, Any

import msgspec

from gcs_tools.fence import CIRCLE, POLYGON, RALLY_POINT, RETURN_POINT
from gcs_tools.plan import FRAME_LOCAL_NED, LOCAL_SCALE, Item
from gcs_tools.yaml_types import Down, Length, Struct, wire_xy
from sitl.strict_yaml import ConfigError, Document

STAYS = {"inside": True, "outside": False}
Group = Annotated[int, msgspec.Meta(ge=0, le=255)]
Entries = Annotated[list[dict[str, Any]], msgspec.Meta(max_length=1000)]


class _Polygon(Struct, kw_only=True):
    stay: str
    corners_m: Annotated[list[tuple[Length, Length]], msgspec.Meta(min_length=3, max_length=1000)]
    group: Group = 0


class _Circle(Struct, kw_only=True):
    stay: str
    centre_m: tuple[Length, Length]
    radius_m: Annotated[float, msgspec.Meta(gt=0.0, le=10_000.0)]
    group: Group = 0


class _ReturnPoint(Struct, kw_only=True):
    return_m: tuple[Length, Length, Down]


class _RallyPoint(Struct, kw_only=True):
    at_m: tuple[Length, Length, Down]


# the field that tells what an entry of the fence is
_KINDS: dict[str, Any] = {"corners_m": _Polygon, "centre_m": _Circle, "return_m": _ReturnPoint}


def _item(command: int, p1: float, group: int, north: float, east: float, down: float = 0.0) -> Item:
    return Item(FRAME_LOCAL_NED, command, p1, float(group), 0.0, 0.0, *wire_xy(north, east), down)


def read_fence(file: Document, entries: Entries | None) -> tuple[Item, ...] | None:
    """The items of `fence`, None where the file has none. Raises ConfigError."""
    if entries is None:
        return None
    items: list[Item] = []
    for i, raw in enumerate(entries):
        at = f"fence[{i}]"
        kind = next((name for name in _KINDS if name in raw), None)
        if kind is None:
            file.fault(at, "is neither a polygon (corners_m), a circle (centre_m) nor a point to return to (return_m)")
        e: Any = file.convert(raw, _KINDS[kind], at)
        if kind == "return_m":
            if any(item.command == RETURN_POINT for item in items):
                file.fault(f"{at}.return_m", "there can be one point to return to only")
            items.append(_item(RETURN_POINT, 0.0, 0, *e.return_m))
            continue
        file.choice(f"{at}.stay", e.stay, STAYS)
        if kind == "centre_m":
            items.append(_item(CIRCLE[STAYS[e.stay]], e.radius_m, e.group, *e.centre_m))
        else:
            count = float(len(e.corners_m))
            items += [_item(POLYGON[STAYS[e.stay]], count, e.group, *corner) for corner in e.corners_m]
    return tuple(items)


def read_rally(file: Document, entries: Entries | None) -> tuple[Item, ...] | None:
    """The items of `rally`, None where the file has none. Raises ConfigError."""
    if entries is None:
        return None
    points = [file.convert(raw, _RallyPoint, f"rally[{i}]") for i, raw in enumerate(entries)]
    return tuple(_item(RALLY_POINT, 0.0, 0, *point.at_m) for point in points)


def written(fence: Sequence[Item] | None, rally: Sequence[Item] | None, source: str) -> list[str]:
    """The lines of both keys. Raises ConfigError for what they can't say."""
    lines = []
    if fence is not None:
        lines += _key("fence", _entries(fence, source))
    if rally is not None:
        lines += _key("rally", [{"at_m": [*_xy(item), item.z]} for item in rally])
    return lines


def _key(name: str, entries: list[dict[str, Any]]) -> list[str]:
    rows = [", ".join(f"{k}: {v if isinstance(v, str) else json.dumps(v)}" for k, v in e.items()) for e in entries]
    return [f"{name}:", *(f"  - {{{row}}}" for row in rows)] if rows else [f"{name}: []"]


def _xy(item: Item) -> list[float]:
    return [item.x / LOCAL_SCALE, item.y / LOCAL_SCALE]


def _entries(items: Sequence[Item], source: str) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = []
    k = 0
    while k < len(items):
        item, count = items[k], 1
        stay = "inside" if item.command in (POLYGON[True], CIRCLE[True]) else "outside"
        group = {"group": int(item.param2)} if item.param2 else {}
        if item.command == RETURN_POINT:
            entries.append({"return_m": [*_xy(item), item.z]})
        elif item.command in CIRCLE.values():
            entries.append({"stay": stay, "centre_m": _xy(item), "radius_m": item.param1} | group)
        elif item.command in POLYGON.values():
            count = int(item.param1)
            entries.append({"stay": stay, "corners_m": [_xy(corner) for corner in items[k : k + count]]} | group)
        else:
            raise ConfigError(f"{source}: fence item {k}: command: {item.command} is no item of a fence")
        k += count
    return entries
