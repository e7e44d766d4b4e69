"""The report's figures."""

from typing import Any

import numpy as np

from sitl.campaign.distributions import Grid
from sitl.campaign.statistics import Influence
from sitl.campaign.summary import SENSITIVITY_OF, Results
from sitl.drawing import BLUE, GREEN, ORANGE, REFERENCE, VERMILION, Plot

_AXES = (("north", BLUE), ("east", ORANGE), ("down", GREEN), ("3d", REFERENCE))
_SCATTERED = 6  # settings that are drawn one by one
_SHOWN = 15  # bars of the ranking
TITLES = {
    "mae_3d_m": "mean error in space [m]",
    "max_3d_m": "greatest error in space [m]",
    "max_tilt_deg": "largest tilt [°]",
}


def all_plots(r: Results, ranking: dict[str, list[Influence]]) -> list[Plot]:
    plots = []
    if r.completed.sum() > 1:
        plots += [_errors(r), _histograms(r)]
    if any(ranking.values()):
        plots += [_ranking(ranking), _scatter(r, ranking["max_3d_m"] or ranking["mae_3d_m"])]
    grid = [n for n in r.varied(Grid) if r[n].dtype.kind == "f" and n != "seed"]
    if len(grid) == 2 and r.completed.any():
        plots.append(_map(r, grid[0], grid[1]))
    return plots


def _errors(r: Results) -> Plot:
    def draw(figure: Any) -> None:
        for axes, (kind, title) in zip(
            figure.subplots(1, 2, sharey=True), (("mae", "mean error"), ("max", "greatest error")), strict=True
        ):
            for axis, colour in _AXES:
                values = np.sort(r[f"{kind}_{axis}_m"][r.completed])
                share = np.arange(1, values.size + 1) / values.size
                axes.step(
                    np.maximum(values, 1e-6), share, where="post", color=colour, label=axis.replace("3d", "in space")
                )
            limit = r.campaign.success.get(f"{kind}_3d_m")
            if limit:
                axes.axvline(limit, color=VERMILION, linestyle="--", label="limit in space")
            axes.set(xscale="log", xlabel=f"{title} [m]", ylim=(0.0, 1.02))
            _plainly(axes.xaxis)
            axes.legend(loc="lower right")
        figure.axes[0].set_ylabel("share of completed flights with less")

    note = "Each curve says which share of the completed flights stayed below an error, by axis and in space."
    return Plot("errors", "Errors of the true position", note, (11.0, 4.0), draw)


def _plainly(axis: Any) -> None:
    """Marks of a logarithmic axis at 1, 2 and 5, as plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _histograms(r: Results) -> Plot:
    def draw(figure: Any) -> None:
        for axes, (name, title) in zip(figure.subplots(1, 3), TITLES.items(), strict=True):
            values = r[name][r.completed]
            axes.hist(values, bins=min(60, max(10, int(np.sqrt(values.size)))), color=BLUE)
            median = float(np.median(values))
            p95 = float(np.quantile(values, 0.95))
            axes.axvline(median, color=REFERENCE, label=f"median {median:.3g}")
            axes.axvline(p95, color=VERMILION, linestyle="--", label=f"95 % {p95:.3g}")
            axes.set(xlabel=title)
            axes.legend()
        figure.axes[0].set_ylabel("completed flights")

    return Plot("histograms", "How the figures spread", "Completed flights only.", (11.0, 3.4), draw)


def _ranking(ranking: dict[str, list[Influence]]) -> Plot:
    rows = max(len(found) for found in ranking.values())

    def draw(figure: Any) -> None:
        for axes, name in zip(figure.subplots(1, len(SENSITIVITY_OF)), SENSITIVITY_OF, strict=True):
            found = list(reversed(ranking[name][:_SHOWN]))
            places = np.arange(len(found))
            partial = [i.rank if i.partial != i.partial else i.partial for i in found]
            axes.barh(places + 0.19, [i.share for i in found], 0.36, color=BLUE, label="share of the spread explained")
            axes.barh(places - 0.19, partial, 0.36, color=ORANGE, label="partial rank correlation")
            for place, i in zip(places, found, strict=True):
                for at, low, high in (
                    (place + 0.19, 0.0, i.share_noise),
                    (place - 0.19, -i.partial_noise, i.partial_noise),
                ):
                    axes.plot([low, high], [at, at], color=REFERENCE, linewidth=3.0, alpha=0.45, label="_")
            axes.set_yticks(places, [i.setting for i in found])
            axes.set(xlim=(-1.0, 1.0), title=TITLES[name])
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)

    note = (
        "Blue: the share of the error's spread (by ranks) that a setting explains by itself, whatever the shape. "
        "Orange: to the right, more of the setting goes with more error, all others held. A setting without influence "
        "stays within the grey lines 19 times of 20."
    )
    return Plot("sensitivity", "What the errors depend on", note, (11.0, 1.6 + 0.42 * min(rows, _SHOWN)), draw)


def _scatter(r: Results, found: list[Influence]) -> Plot:
    names = [i.setting for i in found[:_SCATTERED]]
    rows = -(-len(names) // 3)

    def draw(figure: Any) -> None:
        done = r.completed
        values = r["max_3d_m"]
        most = float(values[done].max()) if done.any() else 1.0
        for axes, name in zip(
            figure.subplots(rows, 3, squeeze=False).flat, [*names, *[None] * (3 * rows - len(names))], strict=True
        ):
            if name is None:
                axes.set_axis_off()
                continue
            axes.scatter(
                r[name][done],
                values[done],
                s=6,
                alpha=0.5,
                color=BLUE,
                linewidths=0,
                label="completed",
                rasterized=True,
            )
            if not done.all():
                lost = r[name][~done]
                axes.scatter(
                    lost, np.full(lost.size, 1.15 * most), s=18, marker="x", color=VERMILION, label="not completed"
                )
            axes.set(xlabel=name, yscale="log")
            _plainly(axes.yaxis)
        for axes in figure.axes[::3]:
            axes.set_ylabel("greatest error [m]")
        if not done.all():
            figure.axes[0].legend()

    note = "A point a flight, over the settings that matter most; flights that were not completed stand on top."
    return Plot("scatter", "Greatest error in space over the settings", note, (11.0, 0.6 + 2.9 * rows), draw)


def _map(r: Results, across: str, up: str) -> Plot:
    x, y = np.unique(r[across]), np.unique(r[up])

    def draw(figure: Any) -> None:
        panels = (("success rate", r["success"].astype(float), np.ones(r.count, bool)), *(
            (f"{TITLES[name]}, mean", r[name], r.completed) for name in SENSITIVITY_OF
        ))  # fmt: skip
        for axes, (title, values, counted) in zip(figure.subplots(1, 3), panels, strict=True):
            cells = np.full((y.size, x.size), np.nan)
            for i, b in enumerate(y):
                for k, a in enumerate(x):
                    here = (r[across] == a) & (r[up] == b) & counted
                    if here.any():
                        cells[i, k] = values[here].mean()
            rate = title == "success rate"
            image = axes.imshow(
                cells, origin="lower", aspect="auto", cmap="viridis" if rate else "viridis_r",
                vmin=0.0 if rate else None, vmax=1.0 if rate else None,
            )  # fmt: skip
            axes.grid(False)
            if cells.size <= 80:
                for (i, k), value in np.ndenumerate(cells):
                    if np.isfinite(value):
                        axes.text(k, i, f"{value:.2g}", ha="center", va="center", fontsize=7.5, color="white",
                                  bbox={"facecolor": "#00000066", "edgecolor": "none", "pad": 1.0})  # fmt: skip
            for set_ticks, marks in ((axes.set_xticks, x), (axes.set_yticks, y)):
                step = max(1, marks.size // 8)
                set_ticks(range(0, marks.size, step), [f"{v:g}" for v in marks[::step]])
            axes.set(xlabel=across, ylabel=up, title=title)
            figure.colorbar(image, ax=axes)

    return Plot(
        "map", f"Over the grid of {across} and {up}", "White: no flight of that point was completed.", (11.0, 3.6), draw
    )
