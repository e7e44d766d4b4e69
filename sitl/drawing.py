"""Figures as bytes: one style for all of them, the same bytes for the same numbers."""

import io
from collections.abc import Callable
from typing import Any, NamedTuple

# Colours that the colour-blind tell apart (Okabe and Ito), and what everything is measured against in dark grey.
VERMILION, BLUE, PURPLE, GREEN, ORANGE, SKY = "#d55e00", "#0072b2", "#cc79a7", "#009e73", "#e69f00", "#56b4e9"
REFERENCE = "#333333"
_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.edgecolor": "#888888",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.dpi": 100,
    "savefig.dpi": 150,
    "path.simplify_threshold": 0.2,
    "svg.hashsalt": "yawsitter",
}


class Plot(NamedTuple):
    """A figure to be drawn. draw: fills an empty matplotlib figure. note: what to see in it."""

    key: str
    title: str
    note: str
    size_in: tuple[float, float]
    draw: Callable[[Any], None]


class Drawn(NamedTuple):
    plot: Plot
    svg: bytes
    png: bytes  # empty where it wasn't asked for


def drawn(plot: Plot, *, png: bool = True) -> Drawn:
    """The figure in both formats. Needs matplotlib, which is asked for here and nowhere sooner."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=plot.size_in, layout="constrained")
        FigureCanvasAgg(figure)
        plot.draw(figure)
        vectors, pixels = io.BytesIO(), io.BytesIO()
        figure.savefig(vectors, format="svg", metadata={"Date": None})
        if png:
            figure.savefig(pixels, format="png", metadata={"Software": None})
    return Drawn(plot, vectors.getvalue(), pixels.getvalue())


_LEGEND_WIDTH = 100  # characters that fit beside each other above the widest figure


def legend_above(figure: Any, axes: Any) -> None:
    """One legend for the whole figure, from the lines of one of its axes; in as many rows as it takes."""
    handles, labels = axes.get_legend_handles_labels()
    rows = -(-sum(len(label) + 8 for label in labels) // _LEGEND_WIDTH)
    figure.legend(handles, labels, loc="outside upper center", ncols=-(-len(labels) // rows))
