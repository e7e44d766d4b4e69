"""`sitl reproduce`: fly and analyse everything, draw it, write it down."""

import argparse
import importlib.util
import json
import sys
from pathlib import Path
from types import TracebackType
from typing import Any

from gcs_tools import results
from sitl.drawing import Drawn, Plot, drawn
from sitl.page import Table
from sitl.reproduce import beyond, flight_figures, model_figures, output
from sitl.reproduce.evaluation import Evaluation, evaluate
from sitl.reproduce.fly import FlightError
from sitl.reproduce.notes import notes
from sitl.reproduce.page import page
from sitl.reproduce.tables import all_tables
from sitl.strict_yaml import ConfigError


class _Bar:
    """Progress on stderr: a bar on a terminal, nothing elsewhere."""

    def __init__(self) -> None:
        from rich import progress
        from rich.console import Console
        from rich.table import Column

        self._console = Console(stderr=True)
        self._progress = progress.Progress(
            progress.BarColumn(30),
            progress.MofNCompleteColumn(),
            progress.TimeElapsedColumn(),
            progress.TextColumn("{task.description}", table_column=Column(no_wrap=True, overflow="ellipsis", ratio=1)),
            expand=True,
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._task = self._progress.add_task("starting", total=None)

    def __enter__(self) -> "_Bar":
        self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._progress.stop()

    def tick(self, name: str, done: int, total: int) -> None:
        self._progress.update(self._task, description=name, completed=done, total=total)


def plots(evaluation: Evaluation) -> list[Plot]:
    return [
        *flight_figures.plots(evaluation),
        model_figures.coefficient_plot(),
        model_figures.pole_plot(evaluation.loops),
        model_figures.loops_plot(evaluation.shapes, evaluation.limits["unstable_zero_1_s"]),
        *beyond.plots(evaluation),
    ]


def summary(evaluation: Evaluation) -> list[str]:
    """The first lines of the page: what it is, and how to read it."""
    versions = ", ".join(f"{name} {version}" for name, version in output.versions().items())
    return [
        "The evaluation of “YawSitter: Modeling and Controlling a Tail-Sitter UAV with Enhanced Yaw Control” (Habel, "
        "Mehboob, Sam, Fortin, Tsetserukou) again. Every number was flown or computed by this simulator, in "
        "lockstep, the missions through its MAVLink link; columns headed “paper” are print. ✓ marks a cell at or "
        "below print, ✗ one above it.",
        "x, y, z are north, east, down. Errors are measured minus reference. “True” is the plant's own position; “as "
        "it reports it” is the filter's estimate of it, which comes over the link.",
        f"{'Quick: seed' if evaluation.quick else 'Seeds'} {', '.join(map(str, evaluation.seeds))}; {versions}.",
    ]


def told(tables: list[Table], folder: Path) -> list[str]:
    """What is printed at the end: how many cells of the paper's tables each view meets, and where the page is."""
    overview = next(table for table in tables if table.key == "overview")
    lines = ["cells at or below print, rectangle and circle:"]
    lines += [f"  {row.cells[-2].text}, {row.cells[-1].text}: {row.label}" for row in overview.rows[1:]]
    return [*lines, str(folder / "report.html")]


def main(args: argparse.Namespace) -> int:
    """0 when the report is written, 1 when a flight failed, 2 for settings or an installation that can't be used."""
    if importlib.util.find_spec("matplotlib") is None:
        return _complain("the report needs matplotlib: pip install 'yawsitter-sitl[report]'", 2)
    folder = Path(args.out)
    try:
        results.prepare(folder)
    except ConfigError as error:
        return _complain(str(error), 2)
    try:
        with _Bar() as bar:
            evaluation = evaluate(args.quick, bar.tick)
            figures = _draw(plots(evaluation), bar)
    except FlightError as error:
        return _complain(str(error), 1)
    tables = [*all_tables(evaluation), beyond.table(evaluation)]
    remarks = notes(evaluation)
    html = page(tables, figures, remarks, output.commands(evaluation), summary(evaluation))
    try:
        output.write(folder, evaluation, tables, figures, remarks, html)
    except OSError as error:
        return _complain(f"{folder}: can't be written: {error.strerror}", 2)
    if args.json:
        print(json.dumps(output.numbers(evaluation, tables, remarks)))
    else:
        print(*told(tables, folder), sep="\n")
    return 0


def _draw(wanted: list[Plot], bar: Any) -> list[Drawn]:
    figures = []
    for k, plot in enumerate(wanted, start=1):
        figures.append(drawn(plot))
        bar.tick(f"figure {plot.key}", k, len(wanted))
    return figures


def _complain(message: str, code: int) -> int:
    print(f"sitl reproduce: {message}", file=sys.stderr)
    return code
