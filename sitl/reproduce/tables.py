"""The report's tables as plain structures, from which the page, the CSV and the tests read alike."""

from collections.abc import Sequence
from typing import Any

from sitl.page import Cell, Group, Row, Table, told
from sitl.reproduce.cases import MISSIONS, SETUPS, VIEWS, View
from sitl.reproduce.evaluation import Evaluation
from sitl.reproduce.printed import AXES, KEY_ERRORS, OVERALL, RANGES, ROWS

ROUNDING = 0.00005  # of the printed tables, in their units
SOURCES = {
    "true": "errors of the true position at key times and overall",
    "reported": "the same of the position that the vehicle reports",
}


def number(value: float, digits: int = 4, printed: float | None = None, signed: bool = False) -> Cell:
    """A value, compared by size with what is printed; equal within the print's rounding counts as at print."""
    better = None if printed is None else abs(value) <= abs(printed) + ROUNDING
    return Cell(told(value, digits, signed), value, better)


def millimetres(value_m: float, printed_m: float | None = None, signed: bool = False, digits: int = 1) -> Cell:
    """A length [m] (or integrated length [m·s]) told in thousandths, as the digits of the print have it."""
    cell = number(value_m, 4, printed_m)
    return cell._replace(text=told(1000.0 * value_m, digits if abs(value_m) < 1.0 else 0, signed))


def figures(evaluation: Evaluation, view: View, mission: str) -> dict[str, Any]:
    """The error figures of a view's flight."""
    flight = evaluation.flight(view.setup, mission)
    return flight.true if view.source == "true" else flight.reported


def overview(evaluation: Evaluation) -> Table:
    """Mean absolute errors of both flights, and how many cells of the paper's tables are met."""
    tables = [(m, tracking(evaluation, m, source)) for m in MISSIONS for source in SOURCES]
    scores = {(m, title): f"{good} of {count}" for m, table in tables for title, good, count in score(table)}
    rows = [Row("paper", [*(millimetres(v) for m in MISSIONS for v in OVERALL[m]["mae"]), Cell(""), Cell("")])]
    for view in VIEWS:
        cells = []
        for m in MISSIONS:
            pairs = zip(figures(evaluation, view, m)["mae"], OVERALL[m]["mae"], strict=True)
            cells += [millimetres(v, printed) for v, printed in pairs]
        rows.append(Row(view.title, [*cells, *(Cell(scores[m, view.title]) for m in MISSIONS)]))
    groups = [*(Group(f"{m}: MAE [mm]", AXES) for m in MISSIONS), Group("cells at or below print", MISSIONS)]
    return Table("overview", "Mean absolute errors", groups, rows)


def tracking(evaluation: Evaluation, mission: str, source: str) -> Table:
    """One of the paper's two tables with the measured ones beside it."""
    rows = []
    views = [view for view in VIEWS if view.source == source]
    results = [figures(evaluation, view, mission) for view in views]
    for k, (t, printed) in enumerate(KEY_ERRORS[mission]):
        cells = [millimetres(p, signed=True) for p in printed]
        for result in results:
            point = result["waypoints"][k]
            assert abs(point["t_s"] - t) < 1e-6
            cells += [millimetres(e, p, True) for e, p in zip(point["error"], printed, strict=True)]
        place = ", ".join(told(x, 0) for x in results[0]["waypoints"][k]["target"]) if mission == "rectangle" else ""
        label = f"{t:g} s, at {place}" if place else f"{t:g} s"
        rows.append(Row(label, cells, "error [mm] at" if k == 0 else ""))
    for k, (key, label) in enumerate(ROWS):
        printed = OVERALL[mission][key]
        cells = [millimetres(p) for p in printed]
        for result in results:
            cells += [millimetres(v, p) for v, p in zip(result[key], printed, strict=True)]
        rows.append(Row(label.replace("[m", "[mm"), cells, "overall" if k == 0 else ""))
    groups = [Group("paper", AXES), *(Group(view.title, AXES) for view in views)]
    return Table(f"{mission}-{source}", f"{mission.capitalize()}: {SOURCES[source]}", groups, rows)


def score(table: Table) -> list[tuple[str, int, int]]:
    """(column group, cells at or below print, cells compared)."""
    scores, at = [], 0
    for group in table.groups:
        cells = [c for row in table.rows for c in row.cells[at : at + len(group.columns)] if c.better is not None]
        at += len(group.columns)
        if cells:
            scores.append((group.title, sum(bool(c.better) for c in cells), len(cells)))
    return scores


def seeds(evaluation: Evaluation) -> Table:
    """The noisy vehicle's least and greatest figures over the seeds, and the greatest as a share of print."""
    rows = []
    for mission in MISSIONS:
        results = [evaluation.flight("tuned", mission, seed).true for seed in evaluation.seeds]
        for k, (key, label) in enumerate(ROWS):
            columns = list(zip(*(r[key] for r in results), strict=True))
            spread = [Cell(f"{1000.0 * min(c):.1f} … {1000.0 * max(c):.1f}", max(c)) for c in columns]
            shares = [max(c) / p for c, p in zip(columns, OVERALL[mission][key], strict=True)]
            cells = [*spread, *(Cell(f"{s:.2f}", s, s <= 1.0) for s in shares)]
            rows.append(Row(label.replace("[m", "[mm"), cells, mission if k == 0 else ""))
    groups = [Group("least … greatest over the seeds", AXES), Group("greatest / print", AXES)]
    return Table("seeds", "Tuned gains, real actuators, sensors and filter: true position over the seeds", groups, rows)


_SHAPES = (
    ("rectangle", "rectangle 20 × 10, as in the table"),
    ("rectangle-20x5", "rectangle 20 × 5, as in the text"),
    ("circle", "circle, smooth start"),
    ("circle-constant-speed", "circle, constant speed from the first instant"),
)


def ranges(evaluation: Evaluation) -> Table:
    """What angles, thrust and flaps went through in flight."""
    rows = []
    for mission, title in _SHAPES:
        for k, r in enumerate(RANGES):
            printed = r.rectangle if mission.startswith("rectangle") else r.circle
            cells = [Cell(printed or "—")]
            for key in (*(setup.key for setup in SETUPS), "literal"):
                known = mission in MISSIONS or key != "literal"
                cells.append(_range(evaluation.flight(key, mission).true["ranges"][r.key]) if known else Cell("—"))
            rows.append(Row(f"{r.quantity} [{r.unit}]", cells, title if k == 0 else ""))
    titles = ["paper", *(setup.title for setup in SETUPS), "literal airframe, printed gains, feed-forward"]
    return Table("ranges", "Ranges while airborne", [Group("", tuple(titles))], rows)


def _range(pair: Sequence[float] | None) -> Cell:
    if pair is None:
        return Cell("—")
    return Cell(f"{told(pair[0], 2)} … {told(pair[1], 2)}", max(map(abs, pair)))


def trims(evaluation: Evaluation) -> Table:
    rows = [Row("paper", [Cell("about 93"), Cell("12.5 … 13.5 on the circle"), Cell("—")])]
    for name, t in evaluation.trims.items():
        rows.append(Row(name, [number(t["pitch_deg"], 2), number(t["thrust_N"], 2), number(t["flap_deg"], 2)]))
    return Table("trim", "Hover trim", [Group("", ("pitch θ [°]", "total thrust [N]", "flaps [°]"))], rows)


def all_tables(evaluation: Evaluation) -> list[Table]:
    from sitl.reproduce.analysis_tables import ablations, limits_table, margins_table, readings

    return [
        overview(evaluation),
        *(tracking(evaluation, mission, source) for mission in MISSIONS for source in SOURCES),
        seeds(evaluation),
        ranges(evaluation),
        trims(evaluation),
        ablations(evaluation),
        readings(evaluation.loops),
        limits_table(evaluation),
        *margins_table(evaluation.loops),
    ]


def as_rows(tables: Sequence[Table]) -> list[list[Any]]:
    """The long form for CSV: table, row, column group, column, text, value, better."""
    lines = []
    for table in tables:
        columns = [(group.title, column) for group in table.groups for column in group.columns]
        heading = ""
        for row in table.rows:
            heading = row.heading or heading
            label = f"{heading}: {row.label}" if heading else row.label
            at = 0
            for cell in row.cells:
                better = "" if cell.better is None else str(cell.better).lower()
                lines.append([table.key, label, *columns[at], cell.text, cell.value, better])
                at += cell.span
    return lines
