"""How a flight is getting on, on stderr: a bar on a terminal, plain lines elsewhere, nothing when asked to be quiet."""

import math
import sys
from types import TracebackType
from typing import Any

from gcs_tools.undertaking import Undertaking

REDRAW_S = 0.1


class Progress:
    """Shows one flight; give it the chance to by calling `update` often (it draws ten times a second at most)."""

    def __init__(self, flight: Undertaking, *, quiet: bool = False) -> None:
        self._flight, self._quiet = flight, quiet
        self._live = not quiet and sys.stderr.isatty()
        self._bar: Any = None
        self._task: Any = None
        self._drawn_s = -math.inf

    def __enter__(self) -> "Progress":
        if self._live:
            from rich import progress
            from rich.console import Console

            self._bar = progress.Progress(
                progress.TextColumn("{task.description:<11}"),
                progress.BarColumn(),
                progress.TextColumn("{task.fields[where]}"),
                console=Console(stderr=True),
                auto_refresh=False,
                transient=True,
            )
            self._task = self._bar.add_task("connecting", total=1.0, where="")
            self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._say()
        if self._bar is not None:
            self._bar.stop()

    def update(self, wall_s: float) -> None:
        if self._quiet:
            self._flight.notes.clear()
        elif wall_s - self._drawn_s >= REDRAW_S:
            self._drawn_s = wall_s
            self._say()
            if self._bar is not None:
                flight = self._flight
                self._bar.update(self._task, description=flight.phase, completed=flight.progress, where=_where(flight))
                self._bar.refresh()

    def _say(self) -> None:
        notes, self._flight.notes = self._flight.notes, []
        for note in [] if self._quiet else notes:
            if self._bar is not None:
                self._bar.console.print(note, highlight=False, markup=False)
            else:
                print(note, file=sys.stderr)


def _where(flight: Undertaking) -> str:
    v = flight.client.vehicle
    if v.position_m is None or not math.isfinite(flight.t_s):
        return ""
    north, east, down = v.position_m
    return f"t {flight.t_s:6.1f} s   north {north:6.2f}  east {east:6.2f}  up {-down + 0.0:5.2f} m"
