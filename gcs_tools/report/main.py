"""`gcs report LOG`: a log read, measured and told: a page, its numbers as JSON, a summary on the terminal."""

import argparse
import importlib.util
import json
import os
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from gcs_tools import plan as plans
from gcs_tools import table as printed
from gcs_tools.plan import Plan
from gcs_tools.report import tables
from gcs_tools.report.log import Log, read
from gcs_tools.report.measure import Measured, measure
from sitl import page as html
from sitl.drawing import Drawn, drawn
from sitl.strict_yaml import ConfigError

_SECTIONS = (
    ("Track", ("track",)),
    ("Flight", ("position", "errors", "velocity", "angles", "actuators")),
    ("Battery and wind", ("battery", "wind")),
    ("Estimate", ("estimator",)),
)
_WORDS = "words"  # the look of tables that are text
_SHOWN = 12  # warnings on the terminal


def run(args: argparse.Namespace) -> None:
    """Raises ConfigError and OSError."""
    if importlib.util.find_spec("matplotlib") is None:
        raise ConfigError("the plots need matplotlib: pip install 'yawsitter-sitl[report]'")
    plan = plans.load(args.mission) if args.mission else None
    log = read(args.log, args.system)
    measured = measure(log, args.flight, plan)
    page_path, numbers_path = _targets(args.log, args.out)
    from gcs_tools.report.figures import plots

    figures = [drawn(plot, png=False) for plot in plots(log, measured, plan)]
    numbers = tables.numbers(log, measured, plan)
    page_path.write_text(page(log, measured, plan, figures), encoding="utf-8")
    numbers_path.write_text(json.dumps(numbers, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    if args.json:
        print(json.dumps(numbers))
    else:
        show(log, measured, plan, Console())
        print(page_path)
    for damage in log.damage:
        print(f"warning: {log.path}: {damage}", file=sys.stderr)


def _targets(log: Path, out: Path | None) -> tuple[Path, Path]:
    """Where page and numbers go: beside the log, into a folder, or to a file. Raises ConfigError."""
    if out is not None and out.suffix.lower() in (".html", ".htm"):
        page = out
    else:
        page = (log.parent if out is None else out) / f"{log.name}.html"
    try:
        page.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{page.parent}: can't be made a folder: {error.strerror}") from None
    if not os.access(page.parent, os.W_OK | os.X_OK):
        raise ConfigError(f"{page.parent}: can't be written to; choose another place with --out")
    return page, page.with_suffix(".json")


def page(log: Log, m: Measured, plan: Plan | None, figures: list[Drawn]) -> str:
    facts = tables.facts(log, m)
    title = f"Flight of {facts['vehicle']}{f': {plan.name}' if plan else ''}"
    parts = {d.plot.key: html.figure(d) for d in figures}
    sections = [("Summary", html.beside(_summary_tables(facts, m)))]
    sections += [
        (name, "\n".join(parts[key] for key in keys if key in parts))
        for name, keys in _SECTIONS
        if any(key in parts for key in keys)
    ]
    sections.append(("Timeline", html.table(tables.timeline_table(log, m.t0_s), look=_WORDS)))
    sections.append(("Parameters", _parameters(log)))
    if log.link is not None:
        sections.append(("Link", _link(log) + parts.get("link", "")))
    return html.document(title, _summary(log, m), sections)


def _summary_tables(facts: dict[str, str], m: Measured) -> list[str]:
    found = [html.table(tables.facts_table(facts), look=_WORDS)]
    if tables.views(m):
        found.append(html.table(tables.errors_table(m), [f"Over {m.duration_s:.1f} s, against {m.against}."]))
        points = tables.points_table(m)
        found += [html.table(points)] if points else []
        found.append(html.table(tables.ranges_table(m)))
    return found


def _summary(log: Log, m: Measured) -> list[str]:
    lines = [
        f"From {log.path.name}. t = 0 is {m.t0_s:.2f} s on the vehicle's clock. x, y, z are north, east, down, errors "
        "measured minus reference; “reported” is what the vehicle believes"
        + (", “true” what the simulation knows." if m.true else "."),
    ]
    lines += [f"Broken log: {damage}." for damage in log.damage]
    warnings = tables.noteworthy(log)
    if warnings:
        count = f"{len(warnings)} warnings" if len(warnings) > 1 else "A warning"
        lines.append(f"{count}, the first at {warnings[0][0] - m.t0_s:.1f} s: {warnings[0][2]}.")
    return lines


def _parameters(log: Log) -> str:
    if not log.parameters:
        return html.notes(["None were told while this was recorded."])
    if not log.defaults:
        known = f"{len(log.parameters)} were told; their defaults are not known."
        return html.notes([known + " Those that were changed stand in the timeline."])
    table = tables.parameters_table(log)
    if not table.rows:
        return html.notes([f"All {len(log.parameters)} are as they come."])
    return html.table(table, [f"{len(table.rows)} of {len(log.parameters)}."])


def _link(log: Log) -> str:
    assert log.link is not None
    notes = [f"The longest silence of the vehicle took {log.link.silent_s:.2f} s of wall time."]
    if any(s.lost is None for s in log.link.sources):
        notes.append("—: numbered for several links at once, as in a record made at the vehicle: losses don't show.")
    rates = html.table(tables.rates_table(log), ["Per second of the vehicle's time."])
    return html.table(tables.sources_table(log), notes) + rates


def show(log: Log, m: Measured, plan: Plan | None, console: Console) -> None:
    """The summary on the terminal."""
    facts = printed.plain("")
    facts.show_header = False
    facts.add_column("", style="dim")
    facts.add_column("")
    for name, text in tables.facts(log, m).items():
        facts.add_row(name, escape(text))
    console.print(facts)
    if tables.views(m):
        console.print(_errors(m))
    console.print(f"against {m.against}", markup=False, highlight=False, style="dim")
    if log.link is not None and log.link.sources[0].loss is not None:
        loss, silent_s = log.link.sources[0].loss, log.link.silent_s
        console.print(f"link: {100.0 * loss:.2f} % lost, silent for {silent_s:.2f} s at most", highlight=False)
    differ = tables.changed(log)
    if differ:
        names = ", ".join(f"{name} {value:g} ({default:g})" for name, (value, default) in differ.items())
        console.print(f"parameters, with defaults: {names}", markup=False, highlight=False)
    warnings = tables.noteworthy(log)
    for t, kind, text in warnings[:_SHOWN]:
        console.print(f"[yellow]{t - m.t0_s:8.2f} s  {kind}: {escape(text)}[/]", highlight=False)
    if len(warnings) > _SHOWN:
        console.print(f"… and {len(warnings) - _SHOWN} more", style="yellow", highlight=False)


def _errors(m: Measured) -> Any:
    found = tables.views(m)
    table = printed.plain(f"error over {m.duration_s:.1f} s: {', '.join(name for name, _ in found)}")
    table.add_column("")
    for _ in found:
        for axis in printed.AXES:
            table.add_column(axis, justify="right")
    for key, label in printed.ROWS:
        table.add_row(escape(label), *(f" {v:.4f}" for _, figures in found for v in getattr(figures, key)))
    return table
