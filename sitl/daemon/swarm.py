"""The settings of `sitl swarm`: one vehicle's many times over, each with an instance, a seed and a place of its own."""

import math
from collections.abc import Sequence

from sitl.daemon.config import INSTANCE_MAX, SHARED_PORT, RunConfig, SettingError, Setup, parse_number

SPACING_MAX_M = 1000.0
RATE_MAX_HZ = 100.0
_SEEDS = 2**32


def parse_count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= INSTANCE_MAX + 1:
        raise SettingError(f"'{text}' is not a number of vehicles from 1 to {INSTANCE_MAX + 1}")
    return int(text)


def parse_spacing(text: str) -> float:
    return parse_number(text, 0.1, SPACING_MAX_M, "m")


def parse_rate(text: str) -> float:
    return parse_number(text, 1.0, RATE_MAX_HZ, "Hz")


def parse_port(text: str) -> int:
    if not text.isdecimal() or not 0 < int(text) < 65536:
        raise SettingError(f"'{text}' is not a port from 1 to 65535")
    return int(text)


def grid(count: int, spacing_m: float) -> list[tuple[float, float]]:
    """North and east [m] of each: row behind row to the north, as many as a row is long; the first at the origin."""
    side = math.ceil(math.sqrt(count))
    return [(k // side * spacing_m, k % side * spacing_m) for k in range(count)]


def setup(
    first: RunConfig, places_m: Sequence[tuple[float, float]], rate_max_Hz: float, shared_port: int | None = None
) -> Setup:
    """A vehicle like `first` at each place, north and east of its home [m]. Raises SettingError.

    Instances and seeds count up from its own, and so do the folders in its state folder and in that of its records, if
    it has them.
    """
    last = first.instance + len(places_m) - 1
    if last > INSTANCE_MAX:
        raise SettingError(f"--instance {first.instance}: {len(places_m)} vehicles would end at {last}, above 249")
    vehicles = []
    for number, place_m in enumerate(places_m):
        instance = first.instance + number
        vehicles.append(
            first._replace(
                instance=instance,
                seed=(first.seed + number) % _SEEDS,
                place_N_m=place_m,
                swarming=True,
                state_dir=first.state_dir / f"instance-{instance}" if first.state_dir is not None else None,
                record_dir=first.record_dir / f"instance-{instance}" if first.record_dir is not None else None,
                settings=(("SIM_TLM_RATE", rate_max_Hz), *first.settings),
            )
        )
    port = SHARED_PORT + first.instance if shared_port is None else shared_port
    return Setup(tuple(vehicles), (first.listen, port), rate_max_Hz)
