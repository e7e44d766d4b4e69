"""Flights made up from a seed: smooth wandering through random points, the same for the same words.

`random:17` or, with other limits, `random:17,duration_s=30,speed_m_s=2`: straight up, through a point every few
seconds without stopping, back above the start and straight down.
"""

import math
import random
from typing import NamedTuple

from gcs_tools.plan import RANDOM, Streamed
from gcs_tools.reference import ZERO, Knot, Setpoint, Spline, Vector
from sitl.strict_yaml import ConfigError

LEG_S = 4.0  # between two points, about
VERTICAL_M_S = 1.0  # mean of climb and descent
STANDING_S = 2.0  # on the ground in the end
_SAMPLE_S = 0.02


class Limits(NamedTuple):
    """What a flight stays within. height_m: of the middle; the flight keeps between half of it and one and a half.

    extent_m: north, south, east and west of the start. heading_deg: NaN keeps the heading that the vehicle has.
    """

    duration_s: float = 60.0
    extent_m: float = 10.0
    height_m: float = 5.0
    speed_m_s: float = 3.0
    acceleration_m_s2: float = 2.0
    heading_deg: float = math.nan


# least and greatest of each
ALLOWED = {
    "duration_s": (30.0, 3600.0),
    "extent_m": (0.5, 200.0),
    "height_m": (1.0, 8.0),
    "speed_m_s": (0.2, 10.0),
    "acceleration_m_s2": (0.1, 8.0),
    "heading_deg": (-360.0, 360.0),
}


def parse(words: str) -> Streamed:
    """The flight that `words` say. Raises ConfigError."""
    number, *settings = words.removeprefix(RANDOM).split(",")
    if not number.isdecimal():
        raise ConfigError(f"{words}: '{number}' is not a seed (a whole number); for example {RANDOM}17")
    values = {}
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in ALLOWED:
            raise ConfigError(f"{words}: '{name}' is not one of {', '.join(ALLOWED)}")
        try:
            values[name] = float(text)
        except ValueError:
            raise ConfigError(f"{words}: {name}: '{text}' is not a number") from None
    if (mistake := fault(values)) is not None:
        raise ConfigError(f"{words}: {mistake[0]}: {mistake[1]}")
    return generate(int(number), Limits(**values))


def fault(values: dict[str, float]) -> tuple[str, str] | None:
    """(name, what is wrong with it) of the first limit that can't be."""
    for name, value in values.items():
        low, high = ALLOWED[name]
        if not low <= value <= high:
            return name, f"{value:g} is outside {low:g} … {high:g}"
    return None


def words(seed: int, limits: Limits) -> str:
    """What `parse` makes this flight of."""
    changed = [f"{k}={v!r}" for k, v in limits._asdict().items() if v == v and v != Limits._field_defaults[k]]
    return ",".join([f"{RANDOM}{seed}", *changed])


def generate(seed: int, limits: Limits) -> Streamed:
    """The flight of a seed. Where its points ask for more speed or acceleration, all move nearer to the middle."""
    dice = random.Random(seed)
    climb_s = max(LEG_S, limits.height_m / VERTICAL_M_S)
    wander_s = limits.duration_s - 2.0 * climb_s - STANDING_S
    legs = max(2, round(wander_s / LEG_S))
    shares = [dice.uniform(0.7, 1.3) for _ in range(legs)]
    times = [climb_s]
    for share in shares:
        times.append(times[-1] + wander_s * share / sum(shares))
    points: list[Vector] = [ZERO]
    for _ in range(legs - 1):
        north, east = dice.uniform(-limits.extent_m, limits.extent_m), dice.uniform(-limits.extent_m, limits.extent_m)
        points.append((north, east, dice.uniform(-0.5, 0.5) * limits.height_m))
    points.append(ZERO)
    factor = min(1.0, _most(limits, _knots(times, points, limits.height_m)))
    scaled = [(factor * n, factor * e, factor * d) for n, e, d in points]
    knots = _knots(times, scaled, limits.height_m)
    ground = [Knot(0.0, ZERO, ZERO), *knots, Knot(times[-1] + climb_s, ZERO, ZERO)]
    heading = None if math.isnan(limits.heading_deg) else math.radians(limits.heading_deg)
    said = words(seed, limits)
    return Streamed(f"random-{seed}", said, Spline(ground), limits.duration_s, (), heading, None)


def _knots(times: list[float], points: list[Vector], height_m: float) -> list[Knot]:
    """Points relative to the middle, each passed along the line from the one before to the one after."""
    knots = []
    for k, (t, (n, e, d)) in enumerate(zip(times, points, strict=True)):
        velocity = ZERO
        if 0 < k < len(points) - 1:
            (n0, e0, d0), (n1, e1, d1) = points[k - 1], points[k + 1]
            span = times[k + 1] - times[k - 1]
            velocity = ((n1 - n0) / span, (e1 - e0) / span, (d1 - d0) / span)
        knots.append(Knot(t, (n, e, d - height_m), velocity))
    return knots


def _most(limits: Limits, knots: list[Knot]) -> float:
    """By how much the path may grow about its middle before a limit is reached."""
    spline, factor = Spline(knots), math.inf
    for k in range(round((knots[-1].t_s - knots[0].t_s) / _SAMPLE_S)):
        at: Setpoint = spline.at(knots[0].t_s + k * _SAMPLE_S)
        for vector, limit in ((at.velocity_m_s, limits.speed_m_s), (at.acceleration_m_s2, limits.acceleration_m_s2)):
            factor = min(factor, limit / max(math.hypot(*vector), 1e-9))
        for value, limit in zip(at.position_m[:2], (limits.extent_m,) * 2, strict=True):
            factor = min(factor, limit / max(abs(value), 1e-9))
        factor = min(factor, 0.5 * limits.height_m / max(abs(at.position_m[2] + limits.height_m), 1e-9))
    return factor
