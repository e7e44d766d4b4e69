"""The report's numbers: as tables for the page and as plain data."""

import math
import time
from collections.abc import Mapping
from typing import Any

from gcs_tools import metrics
from gcs_tools.metrics import Metrics
from gcs_tools.parameter import number_text
from gcs_tools.plan import Plan
from gcs_tools.report.link_quality import Source
from gcs_tools.report.log import Log
from gcs_tools.report.measure import Measured, timeline
from gcs_tools.table import AXES, ROWS
from sitl.page import Cell, Group, Row, Table, told

_RANGES = (
    ("roll_deg", "roll φ [°]"), ("pitch_deg", "pitch θ [°]"), ("yaw_deg", "yaw ψ [°]"), ("thrust_N", "thrust [N]"),
    ("flap_deg", "flaps [°]"),
)  # fmt: skip
_NOTEWORTHY = ("emergency", "alert", "critical", "error", "warning", "failsafe", "restart", "fence")


def facts(log: Log, m: Measured) -> dict[str, str]:
    """What flew, when and how far."""
    found = {"vehicle": log.vehicle or "unnamed", **log.facts}
    if log.unix_s is not None:
        begin_s, end_s = log.unix_s
        found["recorded"] = f"{time.strftime('%Y-%m-%d %H:%M:%S UTC', time.gmtime(begin_s))}, {end_s - begin_s:.1f} s"
    if m.spans:
        begin_s, end_s = m.spans[m.number - 1]
        which = f"flight {m.number} of {len(m.spans)}, " if len(m.spans) > 1 else ""
        found["armed"] = f"{which}{begin_s:.2f} s to {end_s:.2f} s on the vehicle's clock: {end_s - begin_s:.1f} s"
    else:
        found["armed"] = "never"
    found["flown"] = f"{m.distance_m:.1f} m, up to {m.top_speed_m_s:.1f} m/s and {m.height_m:.1f} m high"
    battery = log.series("battery")
    battery = battery[(battery[:, 0] >= m.t0_s) & (battery[:, 0] <= m.end_s)]
    if len(battery):
        first, last = battery[0], battery[-1]
        found["battery"] = f"{first[1]:.2f} V, {first[3]:.0f} % to {last[1]:.2f} V, {last[3]:.0f} %"
    return found


def noteworthy(log: Log) -> list[tuple[float, str, str]]:
    """Warnings and what else should not go unseen."""
    return [entry for entry in timeline(log) if entry[1] in _NOTEWORTHY]


def changed(log: Log) -> dict[str, tuple[float, float]]:
    """name → (value, default) of parameters that are not as they come; of the newest value."""
    newest = {name: values[-1][1] for name, values in log.parameters.items() if values}
    known = {name: (value, log.defaults[name]) for name, value in newest.items() if name in log.defaults}
    return {name: pair for name, pair in sorted(known.items()) if not math.isclose(*pair, rel_tol=1e-6)}


def facts_table(found: Mapping[str, str]) -> Table:
    return Table("facts", "What flew", [Group("", ("",))], [Row(name, [Cell(text)]) for name, text in found.items()])


def views(m: Measured) -> list[tuple[str, Metrics]]:
    return [(name, figures) for name, figures in (("reported", m.reported), ("true", m.true)) if figures is not None]


def errors_table(m: Measured) -> Table:
    rows = [
        Row(label, [Cell(told(v, 4), v) for _, figures in views(m) for v in getattr(figures, key)])
        for key, label in ROWS
    ]
    return Table("errors-overall", "Position error", [Group(name, AXES) for name, _ in views(m)], rows)


def points_table(m: Measured) -> Table | None:
    """At the key times of a streamed mission, or where items of an uploaded one were reached."""
    found = views(m)
    if not found or not found[0][1].waypoints:
        return None
    rows = []
    for k, point in enumerate(found[0][1].waypoints):
        place = ", ".join(told(x, 2) for x in point.target)
        cells = [Cell(told(e, 4, True), e) for _, figures in found for e in figures.waypoints[k].error]
        rows.append(Row(f"{point.t_s:.1f} s, at {place}", cells))
    return Table("errors-points", "Error on the way [m]", [Group(name, AXES) for name, _ in found], rows)


def ranges_table(m: Measured) -> Table:
    rows = []
    for key, label in _RANGES:
        pairs = [figures.ranges[key] for _, figures in views(m)]
        rows.append(Row(label, [Cell(f"{told(p[0], 2)} … {told(p[1], 2)}" if p else "not heard") for p in pairs]))
    return Table("ranges", "Ranges while airborne", [Group("", tuple(name for name, _ in views(m)))], rows)


def timeline_table(log: Log, t0_s: float) -> Table:
    rows = [Row(f"{told(t - t0_s, 2)} s", [Cell(kind), Cell(text)]) for t, kind, text in timeline(log)]
    return Table("timeline", "Modes and events", [Group("", ("", ""))], rows)


def parameters_table(log: Log) -> Table:
    rows = [
        Row(name, [Cell(number_text(value)), Cell(number_text(default))])
        for name, (value, default) in changed(log).items()
    ]
    return Table("parameters", "Parameters that differ from the default", [Group("", ("value", "default"))], rows)


def sources_table(log: Log) -> Table:
    assert log.link is not None
    rows = []
    for s in log.link.sources:
        lost = [Cell("—"), Cell("—")]
        if s.lost is not None and s.loss is not None:
            lost = [Cell(str(s.lost), s.lost), Cell(f"{100.0 * s.loss:.2f} %", s.loss)]
        rows.append(Row(_who(s), [Cell(str(s.frames)), *lost, Cell(str(s.doubled)), Cell(str(s.late))]))
    columns = ("frames", "lost", "share", "twice", "late")
    return Table("senders", "Who was heard, and what of it got lost", [Group("", columns)], rows)


def _who(s: Source) -> str:
    return f"system {s.system}, component {s.component}"


def rates_table(log: Log) -> Table:
    assert log.link is not None
    rows = [
        Row(r.name, [Cell(str(r.frames)), Cell(f"{r.mean_Hz:.2f}"), Cell(f"{r.longest_s:.2f}")]) for r in log.link.rates
    ]
    return Table("rates", "The vehicle's messages", [Group("", ("count", "per second", "longest silence [s]"))], rows)


def numbers(log: Log, m: Measured, plan: Plan | None) -> dict[str, Any]:
    """Everything, as plain data; what isn't finite is null. Times of events are on the vehicle's clock."""
    name = plan.name if plan else log.path.stem
    factor = m.duration_s / max(log.unix_s[1] - log.unix_s[0], 1e-9) if log.unix_s else 0.0
    data: dict[str, Any] = {
        "log": log.path.name,
        "facts": facts(log, m),
        "flight": {
            "number": m.number,
            "armed_s": [list(span) for span in m.spans],
            "t0_s": m.t0_s,
            "duration_s": m.duration_s,
            "against": m.against,
            "distance_m": m.distance_m,
            "top_speed_m_s": m.top_speed_m_s,
            "height_m": m.height_m,
        },
    }
    for view, figures in views(m):
        measured = metrics.report(name, log.vehicle, m.duration_s, figures, factor)
        data[view] = {key: value for key, value in measured.items() if key != "real_time_factor"}
    data["timeline"] = [{"t_s": t, "kind": kind, "text": text} for t, kind, text in timeline(log)]
    data["parameters"] = {
        "differ": {n: {"value": value, "default": default} for n, (value, default) in changed(log).items()},
        "known": len(log.parameters),
        "defaults_known": bool(log.defaults),
    }
    if log.link is not None:
        data["link"] = {
            "senders": [{**s._asdict(), "loss": s.loss} for s in log.link.sources],
            "messages": [r._asdict() for r in log.link.rates],
            "longest_silence_wall_s": log.link.silent_s,
        }
    data["damage"] = log.damage
    return dict(_finite(data))


def _finite(x: Any) -> Any:
    if isinstance(x, float):
        return round(x, 6) if math.isfinite(x) else None
    if isinstance(x, dict):
        return {key: _finite(value) for key, value in x.items()}
    if isinstance(x, list | tuple):
        return [_finite(value) for value in x]
    return x
