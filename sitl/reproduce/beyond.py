"""The section beyond the paper: its table, its figure, and what is said of them."""

import math
from typing import Any

import numpy as np

from sitl.drawing import REFERENCE, Plot, legend_above
from sitl.page import Cell, Group, Row, Table, told
from sitl.reproduce.cases import BEYOND
from sitl.reproduce.colours import COLOURS
from sitl.reproduce.evaluation import Evaluation
from sitl.reproduce.robustness import ANGLES_DEG, AXES, STEP_LASTS_S
from sitl.reproduce.trials import TRIALS, Measure

_SETTLED, _OVERSHOOT = 0.02, 0.05


def worst(evaluation: Evaluation, trial: str, setup: str) -> tuple[float, ...]:
    """The greatest of each measure over the seeds."""
    return tuple(max(values) for values in zip(*evaluation.trials[trial, setup], strict=True))


def _cell(value: float, measure: Measure) -> Cell:
    if math.isfinite(value):
        return Cell(told(value, 3 if measure.limit < 1.0 else 2), value, value <= measure.limit)
    return Cell(f"not in {STEP_LASTS_S:g} s" if measure.unit == "s" else "lost", None, False)


def table(evaluation: Evaluation) -> Table:
    """Every trial's measures: what is aimed at, and the worst of the seeds per set-up."""
    rows, last = [], ""
    for trial in TRIALS:
        for k, measure in enumerate(trial.measures):
            unit = f" [{measure.unit}]" if measure.unit else ""
            cells = [_cell(worst(evaluation, trial.key, setup.key)[k], measure) for setup in BEYOND]
            heading = trial.group if trial.group != last else ""
            label = f"{trial.title}: {measure.title}{unit}"
            rows.append(Row(label, [Cell(f"≤ {measure.limit:g}", measure.limit), *cells], heading))
            last = trial.group
    columns = ("aim", *(setup.title for setup in BEYOND))
    return Table("trials", "What is aimed at, and the worst of the seeds", [Group("", columns)], rows)


def notes(evaluation: Evaluation) -> list[str]:
    """How to read the table, and how much of it is met."""
    met = []
    for setup in BEYOND:
        marks = [
            value <= measure.limit
            for trial in TRIALS
            for value, measure in zip(worst(evaluation, trial.key, setup.key), trial.measures, strict=True)
        ]
        met.append(f"{setup.title} {sum(marks)} of {len(marks)}")
    return [
        f"Beyond the paper, aims met: {'; '.join(met)}. The aims are this project's own; the paper has nothing to "
        "compare with.",
        f"Seeds {', '.join(map(str, evaluation.seeds))} where chance has a part (gusts, an erring filter), one flight "
        "where it has none. Steps are of position targets without velocity or acceleration, so nothing is fed "
        "forward; z steps up. Recovery starts with motors off, 20 m up.",
    ]


def plots(evaluation: Evaluation) -> list[Plot]:
    return [_steps(evaluation), _recoveries(evaluation)]


def _steps(evaluation: Evaluation) -> Plot:
    def draw(figure: Any) -> None:
        panels = figure.subplots(1, 3, sharey=True)
        for axis, axes in enumerate(panels):
            axes.axhspan(1.0 - _SETTLED, 1.0 + _SETTLED, color="#eeeeee", zorder=0)
            axes.axhline(1.0 + _OVERSHOOT, color=REFERENCE, linestyle=":", linewidth=1.0, label="overshoot of 5 %")
            for setup in BEYOND:
                response = evaluation.steps[setup.key, axis][::10]
                axes.plot(response[:, 0], response[:, 1], color=COLOURS[setup.key], label=setup.title)
            axes.set(title=f"3 m along {AXES[axis]}", xlabel="t since the step [s]")
        panels[0].set_ylabel("share of the step")
        legend_above(figure, panels[0])

    note = (
        "Grey: within 2 %. Along x it goes the wrong way first: a flap that tips the vehicle over pushes it backward."
    )
    return Plot("steps", "Steps of the bare position target", note, (10.5, 3.8), draw)


def _recoveries(evaluation: Evaluation) -> Plot:
    order = np.argsort(ANGLES_DEG)

    def draw(figure: Any) -> None:
        panels = figure.subplots(1, 3, sharey=True)
        for axis, axes in enumerate(panels):
            for setup in BEYOND:
                away = evaluation.recoveries[setup.key][axis][order]
                axes.plot(np.array(ANGLES_DEG)[order], away, "o-", color=COLOURS[setup.key], label=setup.title)
            axes.axhline(4.0, color=REFERENCE, linestyle=":", linewidth=1.0, label="aim")
            axes.set(title=f"turned about body {AXES[axis]}", xlabel="initial angle [°]", xticks=range(-180, 181, 60))
            axes.set_yscale("log")
        panels[0].set_ylabel("greatest excursion [m]")
        legend_above(figure, panels[0])

    note = "Each point is one start at rest: how far it gets from where it should stay before it is back."
    return Plot("recoveries", "Recovery from any attitude at rest", note, (10.5, 3.8), draw)
