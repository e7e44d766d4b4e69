"""Flights as the tools know them, whatever file they came from.

A flight is either streamed (timed targets the client sends many times a second in Offboard mode) or uploaded (items the
vehicle stores and flies by itself in Mission mode).
"""

import math
from pathlib import Path
from typing import NamedTuple

from gcs_tools.reference import Reference, Vector
from sitl.strict_yaml import ConfigError

# Commands and frames of the MAVLink common dialect that mission files use.
FRAME_LOCAL_NED = 1
FRAME_MISSION = 2
LOCAL_SCALE = 1e4  # x and y of items in local frames travel as integers of 1e-4 m
GLOBAL_SCALE = 1e7  # degE7
GLOBAL_FRAMES = {0: 5, 3: 6, 10: 11, 5: 5, 6: 6, 11: 11}  # any global frame → its _INT form on the wire
LOCAL_FRAMES = (1, 7)


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


class Home(NamedTuple):
    lat_deg: float
    lon_deg: float
    alt_amsl_m: float


class Streamed(NamedTuple):
    """A flight of timed offboard targets with feed-forward. The metrics run over duration_s from its start."""

    name: str
    source: str
    reference: Reference
    duration_s: float
    key_times_s: tuple[float, ...]
    heading_rad: float | None  # None: keep whatever heading it has
    paper: str | None  # the paper's table to print beside


class Uploaded(NamedTuple):
    """A flight of mission items. The metrics run from its start to the disarming or the end of the mission."""

    name: str
    source: str
    items: tuple[Item, ...]
    limit_s: float  # simulation time after which the flight counts as stuck
    home: Home | None  # where the file was drawn for
    paper: str | None = None


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
    names = sorted(p.name for p in folder.glob("*") if p.suffix in (".yaml", ".plan")) if folder.is_dir() else []
    return f" (in {folder}: {', '.join(names)})" if names else ""


def load(path: str | Path) -> Plan:
    """The flight in a mission file: YAML as docs/missions.md says, or a QGroundControl .plan.

    Raises ConfigError whose message names the file, the line, the field and what is allowed there.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".plan":
        from gcs_tools import qgc_plan

        return qgc_plan.loads(read_text(path), str(path))
    if suffix in (".yaml", ".yml"):
        from gcs_tools import yaml_plan

        return yaml_plan.loads(read_text(path), str(path))
    read_text(path)
    raise ConfigError(f"{path}: a mission file ends in .yaml or .plan (QGroundControl)")
