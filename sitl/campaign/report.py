"""The report of a campaign: report.html, which needs no other file, and summary.json."""

import json
from html import escape
from pathlib import Path
from typing import Any

from sitl import page
from sitl.atomic import atomically
from sitl.campaign import store
from sitl.campaign.file import Campaign
from sitl.campaign.plots import all_plots
from sitl.campaign.results import FIGURES, OUTCOME_MEANS
from sitl.campaign.statistics import Influence
from sitl.campaign.summary import WORST_OF, Results, finite, summarise
from sitl.drawing import drawn
from sitl.page import Cell, Group, Row, Table
from sitl.page import told as number

SPREADS = ("mean", "std", "least", "median", "p95", "p99", "greatest")


def write(folder: Path, campaign: Campaign, record: dict[str, Any]) -> dict[str, Any]:
    """Both files, from the flights in the folder; the summary. Needs matplotlib and pyarrow."""
    results = Results(campaign, store.table(folder))
    summary = summarise(results, record)
    ranking = {name: [Influence(**i) for i in found] for name, found in summary["sensitivity"].items()}
    figures = {d.plot.key: page.figure(d) for d in map(drawn, all_plots(results, ranking))}
    sections = [
        ("Outcomes", page.table(_outcomes(summary)) + _failures(summary)),
        ("Errors", page.table(_spreads(summary)) + figures.get("errors", "") + figures.get("histograms", "")),
        ("Worst cases", _worst(summary)),
    ]
    if "sensitivity" in figures:
        tables = page.table(_sensitivity(ranking))
        sections.append(("Sensitivity", figures["sensitivity"] + tables + figures["scatter"]))
    if summary["levels"]:
        levels = "".join(page.table(_levels(name, rows)) for name, rows in summary["levels"].items())
        sections.append(("Levels", figures.get("map", "") + levels))
    sections.append(("Campaign", f"<pre>{escape(campaign.document.text)}</pre>\n{page.notes(_made(record))}"))
    html = page.document(campaign.name, _first(summary), sections)
    text = json.dumps(finite(summary), indent=1, ensure_ascii=False) + "\n"
    atomically(folder / "summary.json", lambda to: to.write_text(text, encoding="utf-8"))
    atomically(folder / "report.html", lambda to: to.write_text(html, encoding="utf-8"))
    return dict(finite(summary))


def told(summary: dict[str, Any]) -> list[str]:
    """A few lines for the terminal."""
    figures = summary["figures"]
    lines = [_success(summary), ", ".join(f"{count} {word}" for word, count in summary["outcomes"].items())]
    for name, title in (("mae_3d_m", "mean error in space"), ("max_3d_m", "greatest error in space")):
        if figures[name]:
            f = figures[name]
            lines.append(f"{title}: median {f['median']:.4f} m, 95 % {f['p95']:.4f} m, greatest {f['greatest']:.4f} m")
    influence = summary["sensitivity"]["max_3d_m"][:3]
    if influence:
        lines.append("the greatest error depends most on " + ", ".join(i["setting"] for i in influence))
    for flight in summary["worst"]["max_3d_m"][:1]:
        lines.append(f"worst, flight {flight['index']}: {flight['command']}")
    return lines


def _success(summary: dict[str, Any]) -> str:
    s = summary["success"]
    limits = " and ".join(f"{name} ≤ {limit:g}" for name, limit in s["limits"].items())
    what = f"completed with {limits}" if limits else "completed"
    share = f"{100 * s['rate']:.2f} % ({100 * s['low']:.2f} … {100 * s['high']:.2f} %, 95 % confidence)"
    return f"{s['count']} of {summary['flights']} flights {what}: {share}"


def _first(summary: dict[str, Any]) -> list[str]:
    lines = [summary["description"]] if summary["description"] else []
    lines.append(f"Success: {_success(summary)}.")
    if summary["flights"] < summary["of"]:
        lines.append(f"So far: {summary['of'] - summary['flights']} of {summary['of']} flights are not flown yet.")
    hours = summary["simulated_s"] / 3600.0
    lines.append(
        f"{hours:.1f} hours of flight. Errors are those of the plant's own position, measured minus reference, 50 "
        "times a second. Every flight's command line flies it again to the bit, from the folder of this report."
    )
    return lines


def _outcomes(summary: dict[str, Any]) -> Table:
    n = summary["flights"]
    rows = [
        Row(word, [Cell(str(count)), Cell(f"{100 * count / n:.2f} %"), Cell(OUTCOME_MEANS[word])])
        for word, count in summary["outcomes"].items()
    ]
    return Table("outcomes", "What became of the flights", [Group("", ("flights", "share", "meaning"))], rows)


def _failures(summary: dict[str, Any]) -> str:
    lost = summary["not_completed"]
    if not lost:
        return ""
    rows = [f"flight {f['index']}, {f['outcome']}: {f['reason']}\n  {f['command']}" for f in lost]
    count = summary["flights"] - summary["completed"]["count"]
    title = "Not completed" if count <= len(lost) else f"Not completed: the first {len(lost)} of {count}"
    return f"<h3>{title}</h3>\n<pre>{escape(chr(10).join(rows))}</pre>\n"


def _cell(name: str, value: float | None) -> Cell:
    if value is None or value != value:
        return Cell("—")
    return Cell(number(value, 4 if name.endswith("_m") else 1), value)


def _spreads(summary: dict[str, Any]) -> Table:
    rows = [
        Row(f"{c.text} [{c.unit}]", [_cell(c.name, summary["figures"][c.name].get(s)) for s in SPREADS])
        for c in FIGURES
    ]  # fmt: skip
    columns = ("mean", "standard deviation", "least", "median", "95 %", "99 %", "greatest")
    return Table("figures", "Figures of the completed flights", [Group("", columns)], rows)


def _worst(summary: dict[str, Any]) -> str:
    parts = []
    titles = {c.name: f"{c.text} [{c.unit}]" for c in FIGURES}
    for name in WORST_OF:
        flights = summary["worst"][name]
        if not flights:
            continue
        columns = tuple(flights[0]["settings"])
        rows = [
            Row(f"flight {f['index']}", [_cell(name, f["value"]), *(_setting(v) for v in f["settings"].values())])
            for f in flights
        ]
        table = Table(f"worst-{name}", titles[name].capitalize(), [Group("", ("value", *columns))], rows)
        commands = escape("\n".join(f["command"] for f in flights))
        parts.append(f"{page.table(table)}<pre>{commands}</pre>\n")
    return "".join(parts)


def _setting(value: Any) -> Cell:
    return Cell(value) if isinstance(value, str) else Cell(f"{value:.5g}".replace("-", "−"), float(value))


def _sensitivity(ranking: dict[str, list[Influence]]) -> Table:
    by_name = {name: {i.setting: i for i in found} for name, found in ranking.items()}
    order = [i.setting for i in max(ranking.values(), key=len)]
    rows = []
    for setting in order:
        cells = []
        for found in by_name.values():
            i = found.get(setting)
            values = (i.share, i.rank, i.partial) if i else (None,) * 3
            cells += [Cell("—") if v is None or v != v else Cell(number(v, 2, signed=k > 0), v)
                      for k, v in enumerate(values)]  # fmt: skip
        rows.append(Row(setting, cells))
    columns = ("share explained", "rank correlation", "partial")
    groups = [Group(title, columns) for title in ("mean error in space", "greatest error in space")]
    return Table("influence", "What the errors go with", groups, rows)


def _levels(name: str, levels: list[dict[str, Any]]) -> Table:
    rows = []
    for level in levels:
        s = level["success"]
        cells = [Cell(str(level["flights"])), Cell(f"{100 * s['rate']:.1f} %")]
        cells += [Cell(f"{100 * s['low']:.1f} … {100 * s['high']:.1f} %")]
        cells += [_cell("_m", level[key]) for key in ("mae_3d_m", "max_3d_m", "max_3d_m_p95")]
        rows.append(Row(_setting(level["value"]).text, cells))
    columns = ("flights", "success", "95 % confidence", "mean error [m], mean", "greatest error [m], mean", "95 %")
    return Table(f"levels-{name.replace('.', '-')}", name, [Group("", columns)], rows)


def _made(record: dict[str, Any]) -> list[str]:
    versions = ", ".join(f"{name} {version}" for name, version in record["versions"].items())
    return [f"Made by: {record['command']}", f"{versions}; sources {record['simulator']}."]
