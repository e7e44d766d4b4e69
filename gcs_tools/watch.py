"""`gcs watch`: what the vehicle tells of itself, live: a panel on a terminal, a line a second elsewhere."""

import math
import sys
from typing import Any

from gcs_tools.client import Client, Script
from gcs_tools.vehicle_state import SEVERITIES, VehicleState

REDRAW_S = 0.2
LINE_S = 1.0
TEXTS = 6  # of the newest shown
_LANDED = ("", "on the ground", "in the air", "taking off", "landing")


def until(client: Client, seconds: float) -> Script[None]:
    """Stay connected for so long."""
    yield from client.connect()
    yield from client.pause(seconds)


def rows(client: Client) -> list[tuple[str, str]]:
    """Label and value of everything known."""
    v = client.vehicle
    told = [
        ("vehicle", f"{v.name or 'unnamed'}, system {client.system}"),
        ("mode", f"{v.mode or '?'}, {'armed' if v.armed else 'disarmed'}{_place(v)}"),
        ("ready", {None: "?", True: "yes", False: "no"}[v.ready]),
    ]
    if v.clock.newest_s is not None:
        told.append(("time", f"{v.clock.newest_s:.1f} s, {v.clock.rate:.2f} × real time"))
    if v.position_m is not None:
        told.append(("position", _vector(v.position_m, "m")))
        if v.reference_m is not None and v.armed:
            error = tuple(a - b for a, b in zip(v.position_m, v.reference_m, strict=True))
            told.append(("reference", _vector(v.reference_m, "m")))
            told.append(("error", f"{_vector(error, 'm')}, {math.hypot(*error):.3f} m in all"))
        told.append(("velocity", _vector(v.velocity_m_s, "m/s")))
    if v.angles_deg is not None:
        told.append(("φ θ ψ", "  ".join(f"{x:7.2f}°" for x in v.angles_deg)))
    if v.thrust_N is not None:
        told.append(("thrust", f"{v.thrust_N:.2f} N"))
    if v.mission_item is not None and v.mode == "mission":
        told.append(("item", str(v.mission_item)))
    if v.battery >= 0:
        told.append(("battery", f"{v.battery} % {_bar(v.battery)}"))
    return told


def _place(v: VehicleState) -> str:
    where = _LANDED[v.landed] if v.landed < len(_LANDED) else ""
    return f", {where}" if where else ""


def _bar(percent: int) -> str:
    """Ten cells, as many filled as tens of percent."""
    return "█" * round(percent / 10) + "░" * (10 - round(percent / 10))


def _vector(x: tuple[float, float, float], unit: str) -> str:
    return f"north {x[0]:8.3f}  east {x[1]:8.3f}  down {x[2]:8.3f} {unit}"


def line(client: Client) -> str:
    return "  ".join(f"{label}: {' '.join(value.split())}" for label, value in rows(client))


class Watch:
    """Draws; give it the chance to by calling `update` often."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._drawn_s = -math.inf
        self._texts = 0
        self._live: Any = None

    def __enter__(self) -> "Watch":
        if sys.stdout.isatty():
            from rich.live import Live

            self._live = Live(auto_refresh=False)
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def update(self, wall_s: float) -> None:
        if self._client.vehicle.mode is None or wall_s - self._drawn_s < (REDRAW_S if self._live else LINE_S):
            return
        self._drawn_s = wall_s
        if self._live is not None:
            self._live.update(self._panel(), refresh=True)
            return
        print(line(self._client), flush=True)

    def _panel(self) -> Any:
        from rich.markup import escape
        from rich.table import Table

        table = Table.grid(padding=(0, 2))
        for label, value in rows(self._client):
            table.add_row(f"[dim]{label}[/]", escape(value))
        for text in list(self._client.vehicle.texts)[-TEXTS:]:
            table.add_row(f"[dim]{SEVERITIES[text.severity & 7]}[/]", escape(text.text))
        return table
