"""An experiment told: a table with one or two sets of gains, their responses in the terminal and as a figure."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape

from gcs_tools.table import plain
from gcs_tools.tune.analysis import Analysed, Figure, figures
from gcs_tools.tune.loops import Excitation, Loop

_WIDTH, _HEIGHT = 64, 12  # of the terminal's chart, in characters of 2 × 4 dots
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
_COLOURS = ("cyan", "yellow")
_SMALLEST = 5e-5  # that is told


def show(
    loop: Loop,
    excitation: Excitation,
    vehicle: str | None,
    analysed: Sequence[Analysed],
    band: float,
    console: Console | None = None,
) -> None:
    """The gains and figures of each set, their difference where there are two, and the responses as dots."""
    console = console or Console()
    size = f"{excitation.name} of {excitation.size:g} {loop.kind.unit}"
    console.print(f"{loop.name} · {size} · {vehicle or 'unnamed vehicle'}", highlight=False, markup=False)
    table = plain(None)
    table.add_column("")
    for one in analysed:
        table.add_column(escape(one.trial.name), justify="right")
    if len(analysed) == 2:
        table.add_column("difference", justify="right")
    for name in loop.gains:
        table.add_row(name, *_cells([one.trial.gains[name] for one in analysed], None), style="dim")
    for figure in figures(loop):
        values = [one.values.get(figure.key, math.nan) * figure.scale for one in analysed]
        label = f"{figure.label} [{figure.unit}]"
        if figure.key == "settling_s":
            label = f"settling time, within {100.0 * band:g} % [s]"
        table.add_row(escape(label), *_cells(values, figure))
    console.print(table)
    for colour, one in zip(_COLOURS, analysed, strict=False):
        if one.trial.fault:
            told = f"gains {one.trial.name} don't hold the vehicle: {one.trial.fault}"
            console.print(told, style=colour, markup=False, highlight=False)
    flown = [one for one in analysed if one.record is not None]
    if flown:
        console.print(chart(loop, excitation, analysed), highlight=False)


def _cells(values: Sequence[float], figure: Figure | None) -> list[str]:
    cells = [_text(value) for value in values]
    if len(values) == 2:
        change = values[1] - values[0]
        better = figure.better if figure is not None else 0
        colour = "green" if change * better > 0.0 else "yellow" if change * better < 0.0 else ""
        text = "" if math.isnan(change) else f"{'+' if change > 0.0 else ''}{_text(change)}"
        cells.append(f"[{colour}]{text}[/]" if colour and text else text)
    return cells


def _text(value: float) -> str:
    if math.isnan(value):
        return "–"
    return f"{value:.4g}" if abs(value) >= _SMALLEST or value == 0.0 else "0.0000"


def chart(loop: Loop, excitation: Excitation, analysed: Sequence[Analysed]) -> str:
    """Output over time in braille dots, a colour a set; the reference dim."""
    end_s = excitation.duration_s
    lines: list[tuple[str, Any, Any]] = []
    for colour, one in zip(_COLOURS, analysed, strict=False):
        if one.record is not None:
            lines.append((colour, one.record.t_s, one.record.output))
    first = next(one.record for one in analysed if one.record is not None)
    lines.insert(0, ("dim", first.t_s, first.reference))
    low = min(float(y.min()) for _, _, y in lines)
    high = max(float(y.max()) for _, _, y in lines)
    span = max(high - low, 1e-12)
    t = np.linspace(-0.1 * end_s, end_s, 2 * _WIDTH)
    cells = np.zeros((_HEIGHT, _WIDTH), int)
    colours = np.full((_HEIGHT, _WIDTH), "", dtype=object)
    for colour, at_s, y in lines:
        rows = np.round((high - np.interp(t, at_s, y)) / span * (4 * _HEIGHT - 1)).astype(int)
        for column, (row, before) in enumerate(zip(rows, [rows[0], *rows[:-1]], strict=True)):
            for dot in range(min(row, before), max(row, before) + 1) if colour != "dim" else (row,):
                cells[dot // 4, column // 2] |= _DOTS[column % 2][dot % 4]
                colours[dot // 4, column // 2] = colour
    told = []
    for k in range(_HEIGHT):
        label = f"{high:8.3g} " if k == 0 else f"{low:8.3g} " if k == _HEIGHT - 1 else " " * 9
        dots = "".join(
            f"[{colour}]{chr(0x2800 + cell)}[/]" if cell else " "
            for cell, colour in zip(cells[k], colours[k], strict=True)
        )
        told.append(label + dots)
    told.append(f"{loop.kind.unit:>8} {'s':>5}{'':>{_WIDTH - 12}}{end_s:6.3g}")
    return "\n".join(told)


def plot(path: Path, loop: Loop, excitation: Excitation, analysed: Sequence[Analysed], vehicle: str | None) -> None:
    """Response, actuators and frequency response as a PNG. Needs matplotlib. Raises OSError."""
    from sitl.drawing import Plot, drawn

    title = f"{loop.name}, {excitation.name} of {excitation.size:g} {loop.kind.unit}, {vehicle or 'unnamed vehicle'}"

    def draw(figure: Any) -> None:
        _draw(figure, title, loop, excitation, analysed)

    path.write_bytes(drawn(Plot(loop.name, title, "", (9.0, 6.0), draw)).png)


def _draw(figure: Any, title: str, loop: Loop, excitation: Excitation, analysed: Sequence[Analysed]) -> None:
    from sitl.drawing import BLUE, GREEN, REFERENCE, SKY, VERMILION

    axes = figure.subplot_mosaic([["response", "gain"], ["actuators", "phase"]], width_ratios=(1.4, 1.0))
    response, actuators, gain, phase = (axes[key] for key in ("response", "actuators", "gain", "phase"))
    figure.suptitle(title)
    flown = [(one, pair) for one, pair in zip(analysed, ((BLUE, SKY), (VERMILION, GREEN)), strict=False) if one.record]
    for k, (one, (colour, second)) in enumerate(flown):
        assert one.record is not None
        t = one.record.t_s
        if k == 0:
            steps = {"drawstyle": "steps-post", "linewidth": 0.8, "color": REFERENCE}
            response.plot(t, one.record.reference, label="reference", **steps)
        response.plot(t, one.record.output, color=colour, label=one.trial.name)
        at_s, u = one.record.actuators[:, 0], one.record.actuators[:, 1:]
        actuators.plot(at_s, u[:, 0], color=colour, linewidth=0.8, label=f"{one.trial.name}: motor left")
        actuators.plot(at_s, u[:, 2], color=second, linewidth=0.8, label="flap left")
        w = one.frequency.frequency_rad_s
        if w.size:
            gain.semilogx(w, one.frequency.gain_dB, color=colour, label=one.trial.name)
            phase.semilogx(w, one.frequency.phase_deg, color=colour)
    for each in (response, actuators):
        each.set_xlim(-excitation.before_s * 0.5, excitation.duration_s)
        each.set_xlabel("time [s]")
    response.set_ylabel(f"deviation from rest [{loop.kind.unit}]")
    actuators.set_ylabel("share of the range")
    gain.axhline(-3.0, color=REFERENCE, linewidth=0.6, linestyle=":")
    gain.set_ylabel("closed loop, gain [dB]")
    phase.set_ylabel("phase [°]")
    phase.set_xlabel("frequency [rad/s]")
    response.legend(loc="best")
    actuators.legend(loc="upper right", ncols=2)
