"""Flights as the tools know them, whatever file they came from.

A flight is either streamed (timed targets the client sends many times a second in Offboard mode) or uploaded (items the
vehicle stores and flies by itself in Mission mode).
"""

import math
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from gcs_tools.reference import Reference, Vector
from sitl.strict_yaml import ConfigError

# Commands and frames of the MAVLink common dialect that mission files use.
FRAME_LOCAL_NED = 1
FRAME_MISSION = 2
LOCAL_SCALE = 1e4  # x and y of items in local frames travel as integers of 1e-4 m
GLOBAL_SCALE = 1e7  # degE7
GLOBAL_FRAMES = {0: 5, 3: 6, 10: 11, 5: 5, 6: 6, 11: 11}  # any global frame → its _INT form on the wire
_PLAIN = {5: 0, 6: 3, 11: 10}
LOCAL_FRAMES = (1, 7)
_FLOWN_TO = (16, 17, 18, 19, 21, 22, 31, 82, 84, 85)  # commands whose place is a point to fly to


class Item(NamedTuple):
    """A mission item exactly as it travels in MISSION_ITEM_INT."""

    frame: int
    command: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float
    autocontinue: int = 1

    def place_m(self) -> Vector | None:
        """North, east, down of an item in the local frame; None where it has no such place."""
        if self.frame != FRAME_LOCAL_NED or self.command == 20 or not math.isfinite(self.z):
            return None
        return self.x / LOCAL_SCALE, self.y / LOCAL_SCALE, self.z

    @property
    def flies_to(self) -> bool:
        """Whether the item's place, if it has one, is a point to fly to."""
        return self.command in _FLOWN_TO and self.frame != FRAME_MISSION


Fault = Callable[[str, str], NoReturn]  # field ("frame", "params[4]"), message


def item_of(frame: int, command: int, params: Sequence[float | None], autocontinue: bool, fault: Fault) -> Item:
    """The item that a file writes with seven params, of which 5..7 are a place in the item's own frame."""
    p1, p2, p3, p4, p5, p6, p7 = (math.nan if p is None else float(p) for p in params)
    if frame in GLOBAL_FRAMES:
        sent, scale = GLOBAL_FRAMES[frame], GLOBAL_SCALE
        for k, (value, limit) in enumerate(((p5, 90.0), (p6, 180.0)), start=4):
            if not abs(value) <= limit and not math.isnan(value):
                fault(f"params[{k}]", f"{value:g}° is no place; allowed -{limit:g} to {limit:g}")
    elif frame in LOCAL_FRAMES:
        sent, scale = frame, LOCAL_SCALE
    elif frame == FRAME_MISSION:
        sent, scale = frame, 1.0
    else:
        known = ", ".join(map(str, sorted((*GLOBAL_FRAMES, *LOCAL_FRAMES, FRAME_MISSION))))
        fault("frame", f"{frame} is not a frame of mission items; allowed: {known}")
    x, y = (round(p * scale) if math.isfinite(p) else 0 for p in (p5, p6))
    if not all(-(2**31) <= value < 2**31 for value in (x, y)):
        fault("params", "a coordinate is too large for the link")
    return Item(sent, command, p1, p2, p3, p4, x, y, p7, int(autocontinue))


def written(item: Item) -> tuple[int, tuple[float, ...]]:
    """(frame, seven params) as files write an item: the reverse of item_of; global frames without _INT."""
    frame = _PLAIN.get(item.frame, item.frame)
    scale = GLOBAL_SCALE if item.frame in GLOBAL_FRAMES else LOCAL_SCALE if item.frame in LOCAL_FRAMES else 1.0
    return frame, (item.param1, item.param2, item.param3, item.param4, item.x / scale, item.y / scale, item.z)


class Home(NamedTuple):
    lat_deg: float
    lon_deg: float
    alt_amsl_m: float


class Streamed(NamedTuple):
    """A flight of timed offboard targets with feed-forward. The metrics run over duration_s from its start.

    fence, rally: the items of either kind (MAV_CMD 5000 to 5004, 5100) that go to the vehicle before the flight, () for
    a vehicle without any; None where the file says nothing of them and the vehicle keeps what it has.
    """

    name: str
    source: str
    reference: Reference
    duration_s: float
    key_times_s: tuple[float, ...]
    heading_rad: float | None  # None: keep whatever heading it has
    paper: str | None  # the paper's table to print beside
    fence: tuple[Item, ...] | None = None
    rally: tuple[Item, ...] | None = None


class Uploaded(NamedTuple):
    """A flight of mission items. The metrics run from its start to the disarming or the end of the mission.

    fence, rally: as those of Streamed.
    """

    name: str
    source: str
    items: tuple[Item, ...]
    limit_s: float  # simulation time after which the flight counts as stuck
    home: Home | None  # where the file was drawn for
    paper: str | None = None
    fence: tuple[Item, ...] | None = None
    rally: tuple[Item, ...] | None = None


Plan = Streamed | Uploaded


def read_text(path: str | Path) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except IsADirectoryError:
        raise ConfigError(f"{path}: is a folder, not a mission file") from None
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such mission file{_neighbours(Path(path))}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: can't be read: {getattr(error, 'strerror', None) or 'not UTF-8 text'}") from None


def _neighbours(path: Path) -> str:
    """What else is there, to put behind a message about a file that isn't."""
    folder = path.parent if path.parent.is_dir() and path.parent != Path(".") else Path("missions")
    names = sorted(p.name for p in folder.glob("*") if p.suffix in READERS) if folder.is_dir() else []
    return f" (in {folder}: {', '.join(names)})" if names else ""


RANDOM = "random:"

# by ending; a .txt is what older ground stations call a .waypoints
READERS = {
    ".yaml": "gcs_tools.yaml_plan",
    ".yml": "gcs_tools.yaml_plan",
    ".plan": "gcs_tools.qgc_plan",
    ".waypoints": "gcs_tools.wpl_plan",
    ".txt": "gcs_tools.wpl_plan",
}


def format_of(path: str | Path) -> Any:
    """The module that reads and writes such files. Raises ConfigError."""
    suffix = Path(path).suffix.lower()
    if suffix not in READERS:
        raise ConfigError(f"{path}: a mission file ends in .yaml, .plan (QGroundControl) or .waypoints (QGC WPL 110)")
    return import_module(READERS[suffix])


def load(path: str | Path) -> Plan:
    """The flight in a mission file: YAML as docs/missions.md says, a QGroundControl .plan, or QGC WPL 110 text.

    `random:SEED` is no file but a flight made up from that seed. Raises ConfigError whose message names the file, the
    line, the field and what is allowed there.
    """
    if str(path).startswith(RANDOM):
        made: Plan = import_module("gcs_tools.random_plan").parse(str(path))
        return made
    text = read_text(path)
    plan: Plan = format_of(path).loads(text, str(path))
    return plan
