"""Formation files: where the vehicles of a swarm stand at the start.

description: a V
places:                     # metres north and east of --home, one for each vehicle, in their order
  - {north_m: 0, east_m: 0}
  - {north_m: -3, east_m: 3}
"""

import math
from pathlib import Path

import msgspec

from sitl import strict_yaml
from sitl.strict_yaml import ConfigError

REACH_MAX_M = 10_000.0  # from --home


class Standing(msgspec.Struct, forbid_unknown_fields=True):
    north_m: float
    east_m: float


class FormationFile(msgspec.Struct, forbid_unknown_fields=True):
    places: list[Standing]
    description: str = ""


def load(file: Path, count: int) -> list[tuple[float, float]]:
    """North and east [m] of the first `count` vehicles. Raises ConfigError."""
    places = strict_yaml.load(file, FormationFile).places
    if len(places) < count:
        raise ConfigError(f"{file}: places: there are {len(places)}, for {count} vehicles")
    for number, place in enumerate(places):
        for name in ("north_m", "east_m"):
            value = getattr(place, name)
            if not (math.isfinite(value) and abs(value) <= REACH_MAX_M):
                raise ConfigError(
                    f"{file}: places[{number}].{name}: {value} must be in {-REACH_MAX_M:g} … {REACH_MAX_M:g}"
                )
    return [(place.north_m, place.east_m) for place in places[:count]]
