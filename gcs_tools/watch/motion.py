"""The parts of the dashboard that show how one vehicle moves: numbers, gauges, curves."""

import math
from collections.abc import Callable
from typing import NamedTuple

from rich.text import Text

from gcs_tools.reference import Vector
from gcs_tools.watch import gauges
from gcs_tools.watch.gauges import fixed
from gcs_tools.watch.lines import DIM, GOOD, NUMBER, TITLE, WARN, label, rule
from gcs_tools.watch.seen import Seen
from gcs_tools.watch.traces import KEPT_S, Trace

LABEL = 10
PLACE_WIDTH = 47
THRUST_N, FLAP_DEG = 5.0, 5.0  # of a gauge, at least
LEAN_DEG = 45.0
_BEGIN, _END = 7, 18  # cells of a curve's line before and behind it

_Picture = Callable[[float, int], str]  # share, width


def place(seen: Seen) -> list[Text]:
    """Where it is and should be, how it moves, and how it stands; PLACE_WIDTH wide."""
    v, i = seen.vehicle, seen.instruments
    title = Text().append("─ ", DIM).append("place", TITLE).append(" ").append("─" * (LABEL - 8), DIM)
    for name in ("north", "east", "down"):
        title.append("─" * (7 - len(name)) + " ", DIM).append(name, TITLE).append(" ")
    title.append("─" * (PLACE_WIDTH - title.cell_len), DIM)
    armed = v.armed and v.reference_m is not None
    heading = label("heading", LABEL)
    if i.heading_deg is not None:
        heading.append(f"{i.heading_deg:7.1f}° {gauges.compass(i.heading_deg)}", NUMBER)
    if i.tilt_deg is not None:
        heading.append("     tilt ", DIM).append(f"{i.tilt_deg:.1f}°", NUMBER)
    return [
        title,
        _row("position", v.position_m, 3, "m"),
        _row("reference", v.reference_m if armed else None, 3, "m"),
        _row("error", i.error_m, 3, _norm(i.error_m, 3, "m"), "bold yellow"),
        _row("velocity", v.velocity_m_s if v.position_m is not None else None, 2, _norm(v.velocity_m_s, 2, "m/s")),
        _row("wind", i.wind_m_s, 2, _norm(i.wind_m_s, 2, "m/s")),
        _row("φ θ ψ", v.angles_deg, 2, "°"),
        heading,
    ]


def _row(name: str, vector: Vector | None, digits: int, end: str, style: str = NUMBER) -> Text:
    text = label(name, LABEL)
    if vector is None:
        return text.append(f"{'–':>8} {'–':>8} {'–':>8}", DIM)
    return text.append(" ".join(f"{fixed(x, digits):>8}" for x in vector), style).append(f" {end}", DIM)


def _norm(vector: Vector | None, digits: int, unit: str) -> str:
    return f"|{math.hypot(*vector):.{digits}f}| {unit}" if vector is not None else unit


def actuators(seen: Seen, width: int) -> list[Text]:
    """Motors and flaps, and how the nose leans from upright, as bars."""
    v, i = seen.vehicle, seen.instruments
    most_N = gauges.nice(max(i.motor.greatest, THRUST_N))
    most_deg = gauges.nice(max(i.flap.greatest, FLAP_DEG))
    left_N, right_N = v.thrusts_N or (None, None)
    left_deg, right_deg = v.flaps_deg or (None, None)
    forward = v.angles_deg[1] - 90.0 if v.angles_deg is not None else None
    sideways = v.angles_deg[2] if v.angles_deg is not None else None
    return [
        rule(f"motors {most_N:g} N · flaps ±{most_deg:g}°", width),
        _gauge("left", left_N, "N", gauges.bar, most_N, width, GOOD),
        _gauge("right", right_N, "N", gauges.bar, most_N, width, GOOD),
        _gauge("flap l", left_deg, "°", gauges.balance, most_deg, width, "blue"),
        _gauge("flap r", right_deg, "°", gauges.balance, most_deg, width, "blue"),
        Text(f"lean ±{LEAN_DEG:g}°", DIM),
        _gauge("θ − 90", forward, "°", gauges.balance, LEAN_DEG, width, "magenta"),
        _gauge("ψ", sideways, "°", gauges.balance, LEAN_DEG, width, "magenta"),
    ]


def _gauge(name: str, value: float | None, unit: str, picture: _Picture, most: float, width: int, style: str) -> Text:
    text = label(name, 7)
    if value is None:
        return text.append(f"{'–':>8}", DIM)
    cells = max(1, width - 7 - 9 - 2)
    text.append(f"{fixed(value, 2, signed=picture is gauges.balance):>7}{unit:<2}", NUMBER)
    return text.append("▕", DIM).append(picture(value / most, cells), style).append("▏", DIM)


class _Curve(NamedTuple):
    """least: the span of its scale is never smaller. around: the scale goes with the values, not from zero."""

    name: str
    unit: str
    least: float
    style: str
    around: bool = False


_CURVES = (
    _Curve("error", "m", 0.01, WARN),
    _Curve("height", "m", 1.0, "cyan", around=True),
    _Curve("thrust", "N", 2.0, GOOD, around=True),
    _Curve("speed", "m/s", 0.5, "blue"),
)


def curves(seen: Seen, wall_s: float, width: int, height: int) -> list[Text]:
    """Sparklines of the last minute or more, `height` lines each."""
    count = max(1, min(KEPT_S, width - _BEGIN - _END))
    lines = [rule(f"last {count} s", width)]
    for curve in _CURVES:
        lines += _drawn(curve, getattr(seen.instruments, curve.name), count, wall_s, height)
    return lines


def _drawn(curve: _Curve, trace: Trace, count: int, wall_s: float, height: int) -> list[Text]:
    values = trace.last(count, wall_s)
    known = [value for value in values if value is not None]
    low, high = _scale(curve, known)
    digits = 3 if high < 1.0 else 2 if high < 100.0 else 1
    now = any(value is not None for value in values[-2:]) and trace.value is not None
    lines = []
    for k, cells in enumerate(gauges.sparkline(values, height, low, high)):
        line = label(curve.name if k == 0 else "", _BEGIN).append(cells, curve.style)
        value = f"{fixed(trace.value, digits)} {curve.unit}" if k == 0 and now and trace.value is not None else ""
        limit = f"≤ {fixed(high, digits)}" if k == 0 else f"≥ {fixed(low, digits)}" if k == height - 1 else ""
        lines.append(line.append(f" {value:>9}", NUMBER).append(f" {limit if known else '':<7}", DIM))
    return lines


def _scale(curve: _Curve, known: list[float]) -> tuple[float, float]:
    """What the lowest and the highest cell stand for."""
    most = max(known, default=0.0)
    if not curve.around:
        return 0.0, gauges.nice(max(curve.least, most))
    least = min(known, default=0.0)
    spare = max(0.0, 0.5 * (curve.least - (most - least)))
    if least - spare < 0.0 and most > -0.1 * curve.least and spare > 0.0:  # standing, or with the motors off
        return min(0.0, least), min(0.0, least) + curve.least
    return least - spare, most + spare
