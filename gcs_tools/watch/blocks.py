"""The parts of the dashboard that show one vehicle, each as lines of text of a given width."""

import math
from collections.abc import Callable
from typing import NamedTuple

from rich.text import Text

from gcs_tools.reference import Vector
from gcs_tools.vehicle_state import SEVERITIES, VehicleState
from gcs_tools.watch import gauges
from gcs_tools.watch.gauges import printable
from gcs_tools.watch.seen import Seen
from gcs_tools.watch.traces import KEPT_S, Trace
from gcs_tools.watch.traffic import total
from sitl.mavlink.codec import mav

LABEL = 10
_BEGIN, _END = 8, 11  # cells of a curve's line before and behind it
PLACE_WIDTH = 47
FLAP_DEG = 5.0  # of a gauge, at least
LEAN_DEG = 45.0
LEAST_ERROR_M = 0.01  # of a sparkline's height: what is smaller looks small

DIM, TITLE, GOOD, WARN, BAD = "bright_black", "bold cyan", "green", "yellow", "bold red"
_NUMBER = "bold"
_LANDED = ("", "on the ground", "in the air", "taking off", "landing")
_MISSION = ("", "no mission", "not started", "under way", "paused", "complete")
_STATES = {mav.MAV_STATE_CRITICAL: "FAILSAFE", mav.MAV_STATE_EMERGENCY: "EMERGENCY", 8: "FLIGHT TERMINATED"}
_SEVERE = (BAD, BAD, BAD, BAD, WARN, "cyan", "", DIM)


def rule(title: str, width: int) -> Text:
    """A line that begins a block."""
    text = Text("─ ", DIM).append(title, TITLE).append(" ")
    return text.append("─" * max(0, width - text.cell_len), DIM)


def beside(left: Text, right: Text, width: int) -> Text:
    """Both on one line, the right one at its end; where there isn't room the left one gives way."""
    room = max(0, width - right.cell_len - 1)
    left = left.copy()
    left.truncate(room, overflow="ellipsis", pad=True)
    return left.append(" ").append_text(right)


def header(seen: Seen, wall_s: float, width: int, frozen: bool) -> list[Text]:
    """Who it is, what it does, and whether that is still so."""
    v, lost = seen.vehicle, seen.is_lost(wall_s)
    left = Text(" ").append(printable(v.name or "unnamed vehicle"), "bold").append(f" · system {seen.system}   ", DIM)
    left.append(f" {(v.mode or '?').upper()} ", "bold reverse cyan" if not lost else "reverse").append(" ")
    left.append(" ARMED " if v.armed else " disarmed ", "bold reverse yellow" if v.armed else DIM).append("  ")
    left.append(_LANDED[v.landed] if v.landed < len(_LANDED) else "")
    if v.status in _STATES:
        left.append("  ").append(f" {_STATES[v.status]} ", "bold reverse red")
    right = Text()
    if frozen:
        right.append(" DRAWING PAUSED ", "reverse").append(" ")
    if lost:
        right.append(f" LOST for {gauges.duration(seen.age_s(wall_s))} ", "bold reverse red").append(" ")
    else:
        told = "heartbeat " if width >= 100 else ""
        right.append("● ", GOOD).append(f"{told}{_heartbeat_age_s(seen, wall_s):.1f} s ", DIM)
    return [beside(left, right, width), _second(seen, wall_s, width)]


def _heartbeat_age_s(seen: Seen, wall_s: float) -> float:
    since_s = seen.instruments.heartbeat_s
    return wall_s - since_s if since_s is not None else seen.age_s(wall_s)


def _second(seen: Seen, wall_s: float, width: int) -> Text:
    v, i = seen.vehicle, seen.instruments
    text = Text()
    if v.ready is not None:
        text.append(" ready " if v.ready or v.armed else " not ready ", GOOD if v.ready or v.armed else WARN)
    if i.flight_s is not None:
        text.append(" flight ", DIM).append(f"{'≥ ' if i.joined_in_flight else ''}{gauges.duration(i.flight_s)} ")
    if v.battery >= 0:
        style = GOOD if v.battery > 30 else WARN if v.battery > 15 else BAD
        text.append(" battery ", DIM).append(f"{v.battery} % ").append(gauges.bar(v.battery / 100.0, 8), style)
        text.append(f" {v.battery_V:.1f} V" if v.battery_V is not None else "")
        text.append(f" {v.battery_A:.1f} A" if v.battery_A is not None else "")
    right = Text()
    if v.clock.newest_s is not None:
        rate = i.rate(wall_s)
        right.append("t ", DIM).append(f"{v.clock.newest_s:.1f} s ")
        if rate == 0.0:
            right.append("stands still ", WARN)
        elif rate is not None:
            right.append(f"{rate:.2f} × ")
    return beside(text, right, width)


def alerts(seen: Seen, wall_s: float, width: int) -> list[Text]:
    """What is wrong, one line each; usually none."""
    v, found = seen.vehicle, []
    if seen.is_lost(wall_s):
        found.append((BAD, "nothing heard: what is shown is what it told last; it shows again once it is back"))
    if v.unhealthy:
        found.append((BAD, f"not well: {', '.join(v.unhealthy)}"))
    if v.ready is False and not v.armed and seen.not_ready:
        found.append((WARN, f"not ready: {seen.not_ready}"))
    if seen.instruments.missing:
        found.append((BAD, f"estimator: not known: {', '.join(seen.instruments.missing)}"))
    if seen.trouble:
        found.append((WARN, seen.trouble))
    lines = [Text(f" ! {printable(text)}", style) for style, text in found]
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return lines


def motion(seen: Seen) -> list[Text]:
    """Where it is and should be, how it moves, and how it stands; PLACE_WIDTH wide."""
    v, i = seen.vehicle, seen.instruments
    title = Text("─ ", DIM).append("place", TITLE).append(" ").append("─" * (LABEL - 8), DIM)
    for name in ("north", "east", "down"):
        title.append("─" * (8 - len(name)), DIM).append(name, TITLE).append("─", DIM)
    title.append("─" * (PLACE_WIDTH - title.cell_len), DIM)
    armed = v.armed and v.reference_m is not None
    tilt = "" if i.tilt_deg is None else f"tilt {i.tilt_deg:.1f}°"
    heading = "" if i.heading_deg is None else f"{i.heading_deg:7.1f}° {gauges.compass(i.heading_deg)}"
    return [
        title,
        _row("position", v.position_m, 3, "m"),
        _row("reference", v.reference_m if armed else None, 3, "m"),
        _row("error", i.error_m, 3, _norm(i.error_m, 3, "m"), "bold yellow"),
        _row("velocity", v.velocity_m_s if v.position_m is not None else None, 2, _norm(v.velocity_m_s, 2, "m/s")),
        _row("wind", i.wind_m_s, 2, _norm(i.wind_m_s, 2, "m/s")),
        _row("φ θ ψ", v.angles_deg, 2, "°"),
        Text("heading".ljust(LABEL), DIM).append(heading.ljust(18)).append(tilt),
    ]


def _row(label: str, vector: Vector | None, digits: int, end: str, style: str = _NUMBER) -> Text:
    text = Text(label.ljust(LABEL), DIM)
    if vector is None:
        return text.append(f"{'–':>8} {'–':>8} {'–':>8}", DIM)
    return text.append(" ".join(f"{x:8.{digits}f}" for x in vector), style).append(f" {end}", DIM)


def _norm(vector: Vector | None, digits: int, unit: str) -> str:
    return f"|{math.hypot(*vector):.{digits}f}| {unit}" if vector is not None else unit


def actuators(seen: Seen, width: int) -> list[Text]:
    """Motors and flaps, and how the nose leans from upright, as bars."""
    v, i = seen.vehicle, seen.instruments
    most_N = gauges.nice(max(i.thrust.greatest / 2.0, 5.0))
    most_deg = max(gauges.nice(i.flap.greatest), FLAP_DEG)
    left_N, right_N = v.thrusts_N or (None, None)
    left_deg, right_deg = v.flaps_deg or (None, None)
    forward = v.angles_deg[1] - 90.0 if v.angles_deg is not None else None
    sideways = v.angles_deg[2] if v.angles_deg is not None else None
    total_N = f"{v.thrust_N:.2f} N in all" if v.thrust_N is not None else ""
    return [
        rule(f"motors {most_N:g} N · flaps ±{most_deg:g}°", width),
        _gauge("left", left_N, "N", gauges.bar, most_N, width, GOOD),
        _gauge("right", right_N, "N", gauges.bar, most_N, width, GOOD),
        Text(" " * 6 + total_N, DIM),
        _gauge("flap l", left_deg, "°", gauges.balance, most_deg, width, "blue"),
        _gauge("flap r", right_deg, "°", gauges.balance, most_deg, width, "blue"),
        _gauge("θ − 90", forward, "°", gauges.balance, LEAN_DEG, width, "magenta"),
        _gauge("ψ lean", sideways, "°", gauges.balance, LEAN_DEG, width, "magenta"),
    ]


def _gauge(
    label: str,
    value: float | None,
    unit: str,
    picture: Callable[[float, int], str],
    most: float,
    width: int,
    style: str,
) -> Text:
    text = Text(f"{label:<7}", DIM)
    if value is None:
        return text.append(f"{'–':>8}", DIM)
    cells = max(1, width - 7 - 9 - 2)
    signed = "+" if picture is gauges.balance else ""
    text.append(f"{value:{signed}7.2f}{unit:<2}", _NUMBER)
    return text.append("▕", DIM).append(picture(value / most, cells), style).append("▏", DIM)


def curves(seen: Seen, wall_s: float, width: int, height: int) -> list[Text]:
    """Sparklines of the last minute or more, `height` lines each."""
    i = seen.instruments
    count = max(1, min(KEPT_S, width - _BEGIN - _END))
    lines = [rule(f"last {count} s", width)]
    for curve in _CURVES:
        lines += _drawn(curve, getattr(i, curve.label), count, wall_s, height)
    return lines


class _Curve(NamedTuple):
    """least: the span of its scale is never smaller. around: the scale goes with the values, not from zero."""

    label: str
    unit: str
    least: float
    style: str
    around: bool = False


_CURVES = (
    _Curve("error", "m", LEAST_ERROR_M, WARN),
    _Curve("height", "m", 1.0, "cyan", around=True),
    _Curve("thrust", "N", 1.0, GOOD),
    _Curve("speed", "m/s", 0.5, "blue"),
)


def _drawn(curve: _Curve, trace: Trace, count: int, wall_s: float, height: int) -> list[Text]:
    values = trace.last(count, wall_s)
    known = [value for value in values if value is not None]
    low = min(known, default=0.0) if curve.around else 0.0
    high = max(low + curve.least, max(known, default=0.0))
    high = high if curve.around else gauges.nice(high)
    digits = 3 if high < 1.0 else 2 if high < 100.0 else 1
    now = any(value is not None for value in values[-2:]) and trace.value is not None
    notes = [f"{trace.value:.{digits}f} {curve.unit}" if now else "–"] + [""] * (height - 1)
    if height > 1:
        notes[1] = f"≤ {high:.{digits}f}"
    if height > 2:
        notes[-1] = f"≥ {low:.{digits}f}"
    lines = []
    for k, cells in enumerate(gauges.sparkline(values, height, low, high)):
        line = Text((curve.label if k == 0 else "").ljust(_BEGIN), DIM).append(cells, curve.style)
        lines.append(line.append(f" {notes[k]:>{_END - 1}}", _NUMBER if k == 0 else DIM))
    return lines


def mission(seen: Seen, width: int) -> Text:
    """How far it is with its mission."""
    v = seen.vehicle
    text = Text("mission".ljust(9), DIM)
    if v.mission_item is None:
        return text.append("–", DIM)
    state = _MISSION[v.mission_state] if v.mission_state < len(_MISSION) else ""
    if v.mission_total is None:
        return text.append(state or f"item {v.mission_item}", DIM)
    done = v.mission_total if v.mission_state == 5 else v.mission_item
    text.append(f"item {min(v.mission_item + 1, v.mission_total)} of {v.mission_total} ", _NUMBER)
    cells = max(5, min(40, width - text.cell_len - 16))
    text.append("▕", DIM).append(gauges.bar(done / v.mission_total, cells), GOOD).append("▏ ", DIM)
    return text.append(state, GOOD if v.mission_state == 3 else "")


def estimator(seen: Seen) -> Text:
    m = seen.instruments.estimator
    text = Text("estimator ", DIM)
    if m is None:
        return text.append("–", DIM)
    text.append("ok " if not seen.instruments.missing else "not ok ", GOOD if not seen.instruments.missing else BAD)
    if m.pos_horiz_accuracy > 0.0:
        text.append(f"±{100 * m.pos_horiz_accuracy:.1f} cm across, ±{100 * m.pos_vert_accuracy:.1f} up")
    return text


def link(seen: Seen, wall_s: float, width: int, rows: int) -> list[Text]:
    """What the link carries: a line for all of it, then one a message."""
    flows = seen.traffic.flows(wall_s)
    every = total(flows)
    loss, trip_s = seen.traffic.loss(wall_s), seen.instruments.round_trip_s
    text = Text("link".ljust(9), DIM).append(f"{every.frames_Hz:.0f}/s ", _NUMBER)
    text.append(f"{every.bytes_Hz / 1000.0:.1f} kB/s  ", _NUMBER)
    lines = [text]
    if width < 60:
        text = Text(" " * 9)
        lines.append(text)
    if loss is not None:
        style = BAD if loss > 0.05 else WARN if loss > 0.005 else GOOD
        text.append("lost ", DIM).append(f"{100.0 * loss:.1f} %", style)
    if trip_s is not None:
        text.append("  round trip ", DIM).append(f"{1000.0 * trip_s:.1f} ms")
    for flow in flows[:rows]:
        line = Text(f"  {flow.name}", DIM)
        lines.append(beside(line, Text(f"{flow.frames_Hz:6.1f}/s {flow.bytes_Hz:6.0f} B/s"), width))
    return lines


def told(seen: Seen, wall_s: float, width: int, rows: int) -> list[Text]:
    """The newest texts, the last one at the bottom, repeated ones once."""
    lines: list[Text] = []
    for text, times in _collapsed(seen.vehicle)[-rows:] if rows > 0 else []:
        style = _SEVERE[text.severity & 7]
        line = Text(f"{gauges.duration(wall_s - text.wall_s):>7} ago ", DIM)
        line.append(f"{SEVERITIES[text.severity & 7]:<9} ", style).append(printable(text.text), style)
        line.append(f" (×{times})" if times > 1 else "", DIM)
        line.truncate(width, overflow="ellipsis")
        lines.append(line)
    return lines


def _collapsed(v: VehicleState) -> list[tuple]:
    """Texts with how often each came in a row."""
    found: list[tuple] = []
    for text in v.texts:
        if found and (found[-1][0].severity, found[-1][0].text) == (text.severity, text.text):
            found[-1] = (text, found[-1][1] + 1)
        else:
            found.append((text, 1))
    return found
