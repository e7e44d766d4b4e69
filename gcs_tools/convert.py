"""A flight of mission items in another file: places carried between latitude and longitude and metres from home."""

import math
from pathlib import Path

from gcs_tools import plan as plans
from gcs_tools.plan import (
    FRAME_LOCAL_NED,
    FRAME_MISSION,
    GLOBAL_FRAMES,
    GLOBAL_SCALE,
    LOCAL_SCALE,
    Home,
    Item,
    Plan,
    Uploaded,
)
from sitl.geodesy import GeoPoint, to_global, to_local
from sitl.strict_yaml import ConfigError

_ABOVE_SEA, _ABOVE_HOME = (0, 5), (3, 6)  # MAV_FRAME_GLOBAL and _RELATIVE_ALT, plain and _INT
_GRID_M = 2  # digits of a place that was latitude and longitude: a degE7 is 1.1 cm


def convert(plan: Plan, to: Path, home: Home | None) -> Uploaded:
    """Write `plan` to the file, in the format of its ending. home: where the vehicle will stand; None: the plan's own.

    YAML has metres from home, the other formats latitude, longitude and height above home. Raises ConfigError.
    """
    if not isinstance(plan, Uploaded):
        raise ConfigError(f"{plan.source}: kind: its targets are streamed by the client; allowed: kind 'mission'")
    writer = plans.format_of(to)
    home = home or plan.home
    local = to.suffix.lower() in (".yaml", ".yml")
    place = _to_metres if local else _to_degrees

    def moved(items: tuple[Item, ...], what: str) -> tuple[Item, ...]:
        return tuple(place(item, home, f"{plan.source}: {what} {i}") for i, item in enumerate(items))

    placed = plan._replace(
        items=moved(plan.items, "item"),
        home=None if local else home,
        fence=None if plan.fence is None else moved(plan.fence, "fence item"),
        rally=None if plan.rally is None else moved(plan.rally, "rally point"),
    )
    text = writer.dumps(placed)
    to.write_text(text, encoding="utf-8")
    return placed


def local_m(item: Item, home: Home | None) -> tuple[float, float, float] | None:
    """North, east, down [m] of an item's place as seen from home; None where it has none or home isn't known."""
    if item.frame not in (*_ABOVE_SEA, *_ABOVE_HOME) or home is None:
        return item.place_m()
    if not math.isfinite(item.z) or item.x == item.y == 0:
        return None
    north, east = to_local(GeoPoint(*home), item.x / GLOBAL_SCALE, item.y / GLOBAL_SCALE)
    return north, east, (home.alt_amsl_m if item.frame in _ABOVE_SEA else 0.0) - item.z


def _to_metres(item: Item, home: Home | None, where: str) -> Item:
    if item.frame not in GLOBAL_FRAMES or item.command == 20:
        return item
    if item.x == item.y == 0:  # without a place
        return item._replace(frame=FRAME_MISSION)
    place = local_m(item, home)
    if place is None:
        raise ConfigError(f"{where}: frame: {item.frame} has no metres from home without --home LAT,LON,ALT")
    north, east, down = (round(v, _GRID_M) + 0.0 for v in place)
    x, y = round(north * LOCAL_SCALE), round(east * LOCAL_SCALE)
    return item._replace(frame=FRAME_LOCAL_NED, x=x, y=y, z=down)


def _to_degrees(item: Item, home: Home | None, where: str) -> Item:
    place = item.place_m()
    if place is None:
        return item
    if home is None:
        raise ConfigError(f"{where}: frame: {item.frame} has no latitude and longitude without --home LAT,LON,ALT")
    north, east, down = place
    lat, lon = to_global(GeoPoint(*home), north, east)
    return item._replace(frame=6, x=round(lat * GLOBAL_SCALE), y=round(lon * GLOBAL_SCALE), z=-down + 0.0)
