"""Scrolling plots in a column on the left: what the vehicle does beside what it was asked for, of the last seconds."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools.view.history import INDEX
from gcs_tools.view.overlays import thinned
from gcs_tools.view.vehicle import Vehicle

if TYPE_CHECKING:
    from gcs_tools.view.page import Page

PERIOD_S = 0.1
POINTS = 300  # of a curve at most
WINDOWS_S = {"10 s": 10.0, "20 s": 20.0, "60 s": 60.0, "200 s": 200.0}
WIDTH_PX, HEIGHT_PX = 360.0, 120
RED, GREEN, BLUE, GREY = "#ff6b6b", "#51cf66", "#4dabf7", "#ced4da"
CURVE_PX, REFERENCE_PX = 1.6, 1.2
DASH = [5, 4]
STYLE = (
    "<style>.u-legend .u-series:first-child,.u-legend .u-series:last-child{display:none}"
    ".uplot .u-title{font-size:13px;line-height:1.2;opacity:.85}.uplot .u-legend{margin:0}</style>"
)


class Curve(NamedTuple):
    """One line. `minus` is subtracted from `column`."""

    label: str
    column: str
    colour: str
    asked: bool = False  # for, and not done: drawn dashed
    minus: str = ""
    factor: float = 1.0

    def of(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        values = rows[:, INDEX[self.column]]
        if self.minus:
            values = values - rows[:, INDEX[self.minus]]
        return self.factor * values


class Chart(NamedTuple):
    """`step`: what is smaller is not shown. The axis shows at least ±`least`; where `around_zero`, always."""

    title: str
    curves: tuple[Curve, ...]
    step: float
    least: float
    around_zero: bool = False

    def drawn(self, rows: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """The curves' values, and one more curve, unseen, that keeps the axis from magnifying next to nothing."""
        values = [np.round(curve.of(rows) / self.step) * self.step for curve in self.curves]
        middle = 0.0 if self.around_zero else 0.5 * (min(v.min() for v in values) + max(v.max() for v in values))
        kept = np.full(len(rows), middle - self.least)
        kept[-1] = middle + self.least
        return [*values, kept]


def _beside(title: str, column: str, reference: str, colour: str, step: float, least: float) -> Chart:
    curves = (Curve("reference", reference, GREY, asked=True), Curve(title.split()[0], column, colour))
    return Chart(title, curves, step, least)


def _both_sides(
    title: str, left: str, right: str, commands: tuple[str, str] | None, step: float, least: float
) -> Chart:
    asked = [
        Curve(f"{side} asked", column, colour, asked=True)
        for side, column, colour in zip(("left", "right"), commands or (), (RED, GREEN), strict=False)
    ]
    return Chart(title, (*asked, Curve("left", left, RED), Curve("right", right, GREEN)), step, least)


TABS: dict[str, tuple[Chart, ...]] = {
    "Position": (
        _beside("north [m]", "north_m", "reference_north_m", RED, 1e-3, 0.05),
        _beside("east [m]", "east_m", "reference_east_m", GREEN, 1e-3, 0.05),
        _beside("down [m]", "down_m", "reference_down_m", BLUE, 1e-3, 0.05),
        Chart(
            "error [cm]",
            tuple(
                Curve(axis, f"{axis}_m", colour, minus=f"reference_{axis}_m", factor=100.0)
                for axis, colour in (("north", RED), ("east", GREEN), ("down", BLUE))
            ),
            0.01,
            1.0,
            around_zero=True,
        ),
    ),
    "Attitude": (
        _beside("φ [°]", "phi_deg", "phi_command_deg", RED, 0.02, 1.0),
        _beside("θ [°]", "theta_deg", "theta_command_deg", GREEN, 0.02, 1.0),
        _beside("ψ [°]", "psi_deg", "psi_command_deg", BLUE, 0.02, 1.0),
        Chart(
            "error [°]",
            tuple(
                Curve(symbol, f"{name}_deg", colour, minus=f"{name}_command_deg")
                for symbol, name, colour in (("φ", "phi", RED), ("θ", "theta", GREEN), ("ψ", "psi", BLUE))
            ),
            0.01,
            1.0,
            around_zero=True,
        ),
    ),
    "Actuators": (
        _both_sides("thrust asked [N]", "thrust_left_command_N", "thrust_right_command_N", None, 0.02, 1.0),
        _both_sides("rotor [1000/min]", "rotor_left_krpm", "rotor_right_krpm", None, 0.01, 1.0),
        _both_sides(
            "flap [°]",
            "flap_left_deg",
            "flap_right_deg",
            ("flap_left_command_deg", "flap_right_command_deg"),
            0.02,
            1.0,
        ),
    ),
}


class Plots:
    def __init__(self, page: "Page") -> None:
        gui = page.server.gui
        panel = gui.add_panel()
        self._charts: list[tuple[Chart, Any]] = []
        for label, charts in TABS.items():
            with panel.add_tab(label):
                gui.add_html(STYLE)
                self._charts += [(chart, _plot(gui, chart)) for chart in charts]
        panel.dock_left()
        panel.set_width(WIDTH_PX)
        with page.view_tab:
            self._window = gui.add_dropdown("plots show", tuple(WINDOWS_S), initial_value="20 s")
        self._due_s = float("-inf")
        self._drawn: tuple[Any, ...] = ()

    def update(self, vehicle: Vehicle | None, wall_s: float) -> None:
        if vehicle is None or wall_s < self._due_s:
            return
        self._due_s = wall_s + PERIOD_S
        history, window_s = vehicle.history, WINDOWS_S[self._window.value]
        drawn = (vehicle.instance, vehicle.epoch, history.added, window_s)
        if drawn == self._drawn:
            return
        self._drawn = drawn
        rows = thinned(history.last(window_s), POINTS)
        if len(rows) < 2:
            return
        time_s = rows[:, INDEX["t_s"]].copy()
        for chart, plot in self._charts:
            plot.data = (time_s, *chart.drawn(rows))


def _plot(gui: Any, chart: Chart) -> Any:
    import viser.uplot as u

    series: list[u.Series] = [u.Series(label="s")]
    for curve in chart.curves:
        line = u.Series(
            label=curve.label,
            stroke=curve.colour,
            width=REFERENCE_PX if curve.asked else CURVE_PX,
            points=u.Series_Points(show=False),
        )
        if curve.asked:
            line["dash"] = DASH
        series.append(line)
    series.append(u.Series(label="", stroke="transparent", points=u.Series_Points(show=False)))  # keeps the axis wide
    nothing = tuple(np.array([0.0, 1.0]) if k == 0 else np.zeros(2) for k in range(len(series)))
    return gui.add_uplot(
        nothing, tuple(series), title=chart.title, height=HEIGHT_PX, scales={"x": u.Scale(time=False)},
        legend=u.Legend(show=True), padding=(0, 12, 0, 0),
    )  # fmt: skip
