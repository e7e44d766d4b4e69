"""The page's control side: tabs to fly and to tune, and what came of it, for the chosen vehicle, over MAVLink alone."""

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gcs_tools import plan as plans
from gcs_tools.view.flight_panel import FlightPanel
from gcs_tools.view.gains_panel import GainsPanel
from gcs_tools.view.pilot import Line, Pilot
from gcs_tools.view.pilot_thread import Pilots, PilotThread
from gcs_tools.view.vehicle import Vehicle

if TYPE_CHECKING:
    from gcs_tools.view.page import Page

PERIOD_S = 0.1
LINES_SHOWN = 60
_WARNING, _ERROR = 4, 3  # MAV_SEVERITY
_COLOURS = ("#ff6b6b", "#ffa94d", "inherit")
PLANS = ("*.yaml", "*.yml", "*.plan", "*.waypoints")


def missions_of(folder: Path, more: Sequence[Path] = ()) -> dict[str, Path]:
    """Mission files by their names in the list: those that are wanted, then a folder's. Raises ConfigError."""
    for path in more:
        plans.load(path)
    found = sorted(path for pattern in PLANS for path in folder.glob(pattern))
    return {str(path): path for path in more} | {path.name: path for path in found}


class Panels:
    def __init__(self, page: "Page", pilots: Pilots, missions: Mapping[str, Path]) -> None:
        self._page, self._pilots = page, pilots
        self._thread: PilotThread | None = None
        self._due_s = float("-inf")
        self._trouble = self._stripped = ""
        self._lines: tuple[int, int] = (-1, 0)
        self._notice = page.server.gui.add_markdown("", order=page.tabs.order - 0.5, visible=False)
        self._strip = page.server.gui.add_html("", order=page.tabs.order - 0.25)
        self._flight = FlightPanel(page, lambda: self._thread, missions)
        self._gains = GainsPanel(page, self._pilot)
        panel = page.server.gui.add_panel()
        with panel.add_tab("Messages"):
            self._messages = page.server.gui.add_html("")
        panel.float(x=15.0, y=-15.0, width=520.0, height=150.0)
        page.each_tick.append(self.update)

    def _pilot(self) -> Pilot | None:
        return self._thread.pilot if self._thread is not None else None

    def update(self, wall_s: float) -> None:
        vehicle = self._page.selected
        if vehicle is None or wall_s < self._due_s:
            return
        self._due_s = wall_s + PERIOD_S
        self._thread = self._pilots.of(vehicle.instance)
        pilot = self._thread.pilot
        self._flight.update(self._thread, wall_s)
        self._gains.update(pilot, wall_s)
        unheard = vehicle.alive and not pilot.up  # one that is gone is told of by the page
        self._notify(f"**No MAVLink link**, nothing can be commanded: {pilot.trouble}." if unheard else "")
        self._show(vehicle.instance, pilot.lines)
        strip = strip_of(vehicle)
        if strip != self._stripped:
            self._stripped = strip
            self._strip.content = strip

    def _notify(self, trouble: str) -> None:
        if trouble != self._trouble:
            self._trouble = trouble
            self._notice.content, self._notice.visible = trouble, bool(trouble)

    def _show(self, instance: int, lines: tuple[Line, ...]) -> None:
        newest = (instance, lines[-1].number if lines else 0)
        if newest != self._lines:
            self._lines = newest
            self._messages.content = as_html(lines[-LINES_SHOWN:])


def strip_of(vehicle: Vehicle) -> str:
    """What has to be seen from every tab: mode, motors, time and pace."""
    m = vehicle.mode
    if m is None or not vehicle.alive:
        return ""
    motors = '<b style="color:#ffa94d">armed</b>' if m.armed else "disarmed"
    pace = "paused" if m.paused else f"{m.speed_factor:g} ×" if m.speed_factor else "fastest"
    now_us = vehicle.now_us or 0
    return (
        '<div style="display:flex;justify-content:space-between;font-size:13px;padding:.2em .9em .5em">'
        f"<span><b>{html.escape(m.mode)}</b> · {motors} · {html.escape(m.landed)}</span>"
        f'<span style="font-variant-numeric:tabular-nums">{now_us * 1e-6:.1f} s · {pace}</span></div>'
    )


def as_html(lines: Sequence[Line]) -> str:
    """The newest line first."""
    rows = []
    for line in reversed(lines):
        colour = _COLOURS[0 if line.severity <= _ERROR else 1 if line.severity == _WARNING else 2]
        text = html.escape(line.text)
        rows.append(f'<div style="color:{colour}">{f"<b>{text}</b>" if line.own else text}</div>')
    return f'<div style="font-size:12.5px;line-height:1.5;padding:.3em .8em">{"".join(rows)}</div>'
