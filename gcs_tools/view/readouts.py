"""The tab with the vehicle's numbers: mode, battery, position, attitude, errors, and what it said last."""

import html
import math
from typing import TYPE_CHECKING

from gcs_tools.view.vehicle import Instant, Vehicle

if TYPE_CHECKING:
    from gcs_tools.view.page import Page

PERIOD_S = 0.1
EVENTS_SHOWN = 8
_SEVERE = 4  # MAV_SEVERITY_WARNING


class Readouts:
    def __init__(self, page: "Page") -> None:
        with page.tabs.add_tab("Vehicle"):
            self._table = page.server.gui.add_html("")
        self._due_s = float("-inf")
        self._shown = ""

    def update(self, vehicle: Vehicle | None, wall_s: float) -> None:
        if wall_s < self._due_s:
            return
        self._due_s = wall_s + PERIOD_S
        text = page_of(vehicle) if vehicle is not None else ""
        if text != self._shown:
            self._shown = text
            self._table.content = text


def page_of(vehicle: Vehicle) -> str:
    """All read-outs as HTML."""
    rows = [*_mode_rows(vehicle), *(_motion_rows(vehicle.instant) if vehicle.instant else ())]
    cells = "".join(
        f'<tr><td style="opacity:.65;padding-right:.8em;white-space:nowrap">{label}</td>'
        f'<td style="font-variant-numeric:tabular-nums;white-space:pre">{value}</td></tr>'
        for label, value in rows
    )
    return f'<table style="font-size:13px;line-height:1.45;margin:.4em .8em">{cells}</table>{_events(vehicle)}'


def _mode_rows(v: Vehicle) -> list[tuple[str, str]]:
    m = v.mode
    if m is None:
        return []
    armed = '<b style="color:#e8590c">armed</b>' if m.armed else "disarmed"
    pace = "paused" if m.paused else f"{m.speed_factor:g} ×" if m.speed_factor else "as fast as possible"
    if v.loop is not None and not m.paused:
        pace += f" (now {v.loop.real_time_factor:.2f})"
    rows = [
        ("mode", f"<b>{html.escape(m.mode)}</b>, {armed}, {html.escape(m.landed)}"),
        ("battery", f"{m.battery_remaining:.0%}  {m.battery_voltage_V:.2f} V  {m.battery_current_A:.1f} A"),
        ("pace", pace),
    ]
    if m.mission_total:
        rows.append(("mission", f"{html.escape(m.mission_state)}, item {m.mission_current + 1} of {m.mission_total}"))
    if m.failsafe:
        rows.append(("failsafe", f'<b style="color:#e03131">{html.escape(m.failsafe)}</b>'))
    return rows


def _motion_rows(i: Instant) -> list[tuple[str, str]]:
    s, a, r = i.state, i.attitude, i.setpoint
    error = [x - x_ref for x, x_ref in zip(s.position_N_m, r.position_N_m, strict=True)]
    return [
        ("time", f"{i.now_us * 1e-6:.2f} s"),
        ("position", _vector(s.position_N_m, 3, "m")),
        ("reference", _vector(r.position_N_m, 3, "m")),
        ("error", f"{_vector(error, 3, 'm')}  |{math.hypot(*error):.3f}|"),
        ("velocity", _vector(s.velocity_N_m_s, 2, "m/s")),
        ("φ θ ψ", _vector((a.phi_deg, a.theta_deg, a.psi_deg), 1, "°")),
        ("heading", f"{a.heading_deg:.1f}°"),
        ("wind", f"{_vector(s.wind_N_m_s, 2, 'm/s')}"),
    ]


def _vector(v: tuple[float, ...] | list[float], digits: int, unit: str) -> str:
    return "  ".join(f"{x:{digits + 4}.{digits}f}" for x in v) + f" {unit}"


def _events(v: Vehicle) -> str:
    lines = []
    for e in list(v.events)[-EVENTS_SHOWN:]:
        colour = "color:#e8590c" if e.severity <= _SEVERE else ""
        when = f'<span style="opacity:.6">{e.now_us * 1e-6:8.1f} s</span>'
        lines.append(
            f'<div style="{colour}">{when}  {html.escape(e.kind)}: {html.escape(e.text or str(e.value))}</div>'
        )
    return f'<div style="font-size:12px;margin:.4em .8em;white-space:pre-wrap">{"".join(lines)}</div>'
