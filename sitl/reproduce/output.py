"""What a reproduction leaves in its folder: page, figures, numbers as JSON and CSV, the flights themselves."""

import csv
import json
import math
import platform
import shutil
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from sitl.drawing import Drawn
from sitl.page import Table
from sitl.reproduce.cases import BEYOND, SETUPS
from sitl.reproduce.evaluation import Evaluation
from sitl.reproduce.fly import COLUMNS, HERE
from sitl.reproduce.notes import Notes
from sitl.reproduce.printed import KEY_ERRORS, OVERALL
from sitl.reproduce.tables import as_rows, score
from sitl.reproduce.trials import TRIALS, command

_PACKAGES = ("yawsitter-sitl", "numpy", "numba")
_DRAWN_FLIGHTS = tuple(setup.key for setup in SETUPS)


def commands(evaluation: Evaluation) -> list[str]:
    """The command line of every flight and trial, each once."""
    trials = [
        command(trial.key, setup.craft, seed)
        for setup in BEYOND
        for trial in TRIALS
        for seed in evaluation.seeds[: len(evaluation.trials[trial.key, setup.key])]
    ]
    return list(dict.fromkeys([*(flight.case.command for flight in evaluation.flights.values()), *trials]))


def versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed as a package"
    return found


def numbers(evaluation: Evaluation, tables: Sequence[Table], notes: Notes) -> dict[str, Any]:
    """Everything measured, as plain data. What isn't finite is null."""
    data = {
        "quick": evaluation.quick,
        "seeds": list(evaluation.seeds),
        "versions": versions(),
        "paper": {"overall": OVERALL, "key_errors": KEY_ERRORS},
        "flights": {
            name: {
                "command": flight.case.command,
                "seed": flight.case.seed,
                "true": flight.true,
                "reported": flight.reported,
            }
            for name, flight in evaluation.flights.items()
        },
        "scores": {t.key: [list(s) for s in score(t)] for t in tables if score(t)},
        "trials": [
            {
                "trial": trial.key,
                "measure": measure.title,
                "unit": measure.unit,
                "aim": measure.limit,
                "vehicle": setup.vehicle,
                "set": dict(setup.overrides),
                "by_seed": [values[k] for values in evaluation.trials[trial.key, setup.key]],
            }
            for trial in TRIALS
            for k, measure in enumerate(trial.measures)
            for setup in BEYOND
        ],
        "trims": evaluation.trims,
        "limits": evaluation.limits,
        "loops": evaluation.loops,
        "notes": notes,
    }
    return dict(_finite(data))


def _finite(x: Any) -> Any:
    if isinstance(x, float):
        return x if math.isfinite(x) else None
    if isinstance(x, dict):
        return {key: _finite(value) for key, value in x.items()}
    if isinstance(x, list | tuple):
        return [_finite(value) for value in x]
    return x


def write(
    folder: Path, evaluation: Evaluation, tables: Sequence[Table], figures: Sequence[Drawn], notes: Notes, html: str
) -> None:
    """report.html, numbers.json, numbers.csv, figures/*.svg and *.png, flights/*.csv.

    Also commands.txt, and the missions that its lines name.
    """
    shutil.copytree(HERE / "missions", folder / "missions", dirs_exist_ok=True)
    for name in ("figures", "flights"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "report.html").write_text(html, encoding="utf-8")
    text = json.dumps(numbers(evaluation, tables, notes), indent=1, ensure_ascii=False)
    (folder / "numbers.json").write_text(text + "\n", encoding="utf-8")
    (folder / "commands.txt").write_text("\n".join(commands(evaluation)) + "\n", encoding="utf-8")
    _csv(
        folder / "numbers.csv",
        ("table", "row", "group", "column", "text", "value_SI", "at_or_below_print"),
        as_rows(tables),
    )
    for drawn in figures:
        (folder / "figures" / f"{drawn.plot.key}.svg").write_bytes(drawn.svg)
        (folder / "figures" / f"{drawn.plot.key}.png").write_bytes(drawn.png)
    for name, flight in evaluation.flights.items():
        if flight.case.setup in _DRAWN_FLIGHTS:
            rows = [[f"{v:.6g}" for v in row] for row in flight.samples]
            _csv(folder / "flights" / f"{name}.csv", COLUMNS, rows)


def _csv(path: Path, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
