"""A measured figure and the row that it makes in the table."""

import statistics
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table


class Figure(NamedTuple):
    what: str
    required: str  # empty: nothing, the figure is there to compare with
    measured: str
    met: bool | None  # None where nothing is required


def told(what: str, measured: str) -> Figure:
    """A figure that nothing is required of."""
    return Figure(what, "", measured, None)


def at_most(what: str, values: Sequence[float], limit: float, unit: str) -> Figure:
    """The median of `values` against its upper limit."""
    return Figure(what, f"≤ {limit:g} {unit}", spread(values, unit), statistics.median(values) <= limit)


def all_at_most(what: str, values: Sequence[float], limit: float, unit: str) -> Figure:
    """The greatest of `values` against its upper limit."""
    several = f" (least {_number(min(values))} of {len(values)})" if len(values) > 1 else ""
    measured = f"{_number(max(values))} {unit}".rstrip() + several
    return Figure(what, f"≤ {limit:g} {unit}".rstrip(), measured, max(values) <= limit)


def at_least(what: str, values: Sequence[float], limit: float, unit: str) -> Figure:
    """The median of `values` against its lower limit."""
    return Figure(what, f"≥ {limit:g} {unit}", spread(values, unit), statistics.median(values) >= limit)


def each_at_most(what: str, values: Sequence[float], limits: Sequence[float], unit: str) -> Figure:
    """Several numbers at once, each against its own upper limit."""
    met = all(value <= limit for value, limit in zip(values, limits, strict=True))
    return Figure(what, f"≤ {_row(limits)} {unit}", f"{_row(values)} {unit}", met)


def spread(values: Sequence[float], unit: str) -> str:
    """Median, and least and greatest where there are several."""
    middle = f"{_number(statistics.median(values))} {unit}"
    if len(values) == 1:
        return middle
    return f"{middle} ({_number(min(values))} … {_number(max(values))} in {len(values)})"


def quantile(values: Sequence[float], fraction: float) -> float:
    """The value below which `fraction` of them lie."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(fraction * len(ordered)))]


def _number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def _row(values: Iterable[float]) -> str:
    return " / ".join(f"{value:.4f}".removeprefix("0") for value in values)


def show(figures: Iterable[Figure], console: Console) -> None:
    """Print the table: figure, required, measured, met."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1))
    table.add_column("figure", overflow="fold")
    for heading in ("required", "measured"):
        table.add_column(heading, overflow="fold")
    table.add_column("met")
    verdicts = {True: "[green]yes[/]", False: "[bold red]no[/]", None: ""}
    for figure in figures:
        table.add_row(escape(figure.what), escape(figure.required), escape(figure.measured), verdicts[figure.met])
    console.print(table)
