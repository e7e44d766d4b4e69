"""The report's plots. Times are those of the flight: from its start."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from gcs_tools.plan import Plan
from gcs_tools.report.log import Log
from gcs_tools.report.measure import Measured, planned, track
from sitl.drawing import BLUE, GREEN, ORANGE, PURPLE, REFERENCE, SKY, VERMILION, Plot, legend_above

_AXES = ("x north", "y east", "z down")
_SPARSE_S = 5.0  # between two values, above which there is nothing to draw
_POINTS = 2000  # of a line, at most: more than a page has pixels
_MARGIN_S = 2.0  # shown before and after the flight
_MODE_COLOURS = {
    "takeoff": SKY, "hold": GREEN, "mission": BLUE, "offboard": PURPLE, "return": ORANGE, "land": ORANGE,
    "position": VERMILION, "orbit": BLUE,
}  # fmt: skip
_NAMED_SHARE = 0.06  # of the width, from which on a mode's name fits into its strip


def plots(log: Log, m: Measured, plan: Plan | None) -> list[Plot]:
    drawer = _Drawer(log, m, plan)
    wanted = (
        drawer.path, drawer.position, drawer.errors, drawer.velocity, drawer.angles, drawer.actuators, drawer.battery,
        drawer.wind, drawer.estimate, drawer.link,
    )  # fmt: skip
    return [plot for make in wanted if (plot := make()) is not None]


class _Drawer:
    """Each method makes one plot, or None where the log has nothing to draw."""

    def __init__(self, log: Log, m: Measured, plan: Plan | None) -> None:
        self._log, self._m, self._plan = log, m, plan
        self._begin_s = max(log.span_s[0], m.t0_s - _MARGIN_S) - m.t0_s
        self._end_s = min(log.span_s[1], m.end_s + _MARGIN_S) - m.t0_s
        self._reported = track(log.reported, m) if log.reported.positions else None
        self._true = track(log.true, m) if log.true.positions else None
        self._tracks = [
            (name, colour, found)
            for name, colour, found in (("true", GREEN, self._true), ("reported", BLUE, self._reported))
            if found is not None
        ]

    # Pieces.

    def _series(self, name: str) -> Any:
        rows = self._log.series(name)
        rows[:, 0] -= self._m.t0_s
        return self._shown(rows)

    def _shown(self, rows: Any) -> Any:
        """What of rows (time first) is drawn."""
        rows = rows[(rows[:, 0] >= self._begin_s) & (rows[:, 0] <= self._end_s)]
        return rows[:: max(1, len(rows) // _POINTS)]

    def _of(self, t_s: Any, values: Any) -> Any:
        return self._shown(np.column_stack([t_s, values]))

    def _lines(
        self, figure: Any, labels: Sequence[str], drawn: Iterable[tuple[str, str, str, Any]], height: int | None = None
    ) -> Any:
        """A panel for each label; drawn: (name, colour, style, rows), a column of rows for each panel."""
        panels = np.atleast_1d(figure.subplots(height or len(labels), 1, sharex=True))
        for name, colour, style, rows in drawn:
            for k, axes in enumerate(panels[: rows.shape[1] - 1]):
                on_top = {"zorder": 3.0, "linewidth": 0.9} if style == "--" else {}
                axes.plot(rows[:, 0], rows[:, 1 + k], style, color=colour, label=name, **on_top)
        for axes, label in zip(panels, labels, strict=False):
            axes.set(ylabel=label)
        self._time_axis(panels)
        return panels

    def _time_axis(self, panels: Any) -> None:
        panels[-1].set(xlabel="t [s]", xlim=(self._begin_s, self._end_s))
        for axes in panels:
            for end_s in (0.0, self._m.duration_s):
                axes.axvline(end_s, color="#aaaaaa", linewidth=0.8, linestyle=":")
        self._modes(panels)

    def _modes(self, panels: Any) -> None:
        """Modes as a tint behind the panels, named at the top."""
        status = [s for s in self._log.status if s.mode is not None]
        starts = [s.t_s - self._m.t0_s for s in status]
        spans: list[tuple[str, float, float]] = []
        for now, begin_s, end_s in zip(status, starts, [*starts[1:], self._end_s], strict=True):
            begin_s, end_s = max(begin_s, self._begin_s), min(end_s, self._end_s)
            if end_s <= begin_s or now.mode is None:
                continue
            if spans and spans[-1][0] == now.mode:
                spans[-1] = (now.mode, spans[-1][1], end_s)
            else:
                spans.append((now.mode, begin_s, end_s))
        for mode, begin_s, end_s in spans:
            for axes in panels:
                axes.axvspan(begin_s, end_s, color=_MODE_COLOURS.get(mode, "#888888"), alpha=0.07, linewidth=0.0)
            if end_s - begin_s >= _NAMED_SHARE * (self._end_s - self._begin_s):
                panels[0].text(
                    0.5 * (begin_s + end_s), 1.01, mode, transform=panels[0].get_xaxis_transform(),
                    ha="center", va="bottom", fontsize=8, color="#555555",
                )  # fmt: skip

    # Plots.

    def path(self) -> Plot | None:
        if not self._tracks:
            return None
        begin_s, end_s = self._begin_s, self._end_s
        if self._log.armed_spans():
            begin_s, end_s = 0.0, self._m.duration_s

        def draw(figure: Any) -> None:
            above, north, east = figure.subplots(1, 3, width_ratios=(1.25, 1, 1))
            lines = []
            wanted = planned(self._plan, self._m)
            if wanted is not None:
                lines.append(("mission", ORANGE, "-", wanted))
            elif np.isfinite(self._tracks[-1][2].reference_m).any():
                lines.append(("reference", REFERENCE, "--", self._tracks[-1][2].reference_m))
            for name, colour, found in self._tracks:
                lines.append((name, colour, "-", found.position_m[(found.t_s >= begin_s) & (found.t_s <= end_s)]))
            for name, colour, style, rows in lines:
                p = rows[:: max(1, len(rows) // _POINTS)]
                wide = {"linewidth": 3.0, "alpha": 0.5} if name == "mission" else {}
                above.plot(p[:, 1], p[:, 0], style, color=colour, label=name, **wide)
                north.plot(p[:, 0], -p[:, 2], style, color=colour, **wide)
                east.plot(p[:, 1], -p[:, 2], style, color=colour, **wide)
            flown = lines[-1][3]
            for marker, label, at in (("o", "start", flown[0]), ("s", "end", flown[-1])):
                above.plot(at[1], at[0], marker, color=REFERENCE, markersize=5, label=label, fillstyle="none")
                for axes, k in ((north, 0), (east, 1)):
                    axes.plot(at[k], -at[2], marker, color=REFERENCE, markersize=5, fillstyle="none")
            above.set(title="from above", xlabel="east [m]", ylabel="north [m]")
            above.set_aspect("equal", adjustable="datalim")
            north.set(title="from the side", xlabel="north [m]", ylabel="height [m]")
            east.set(title="from the side", xlabel="east [m]", ylabel="height [m]")
            legend_above(figure, above)

        return Plot("track", "Track", "Height is above the vehicle's origin.", (10.5, 4.2), draw)

    def position(self) -> Plot | None:
        if not self._tracks:
            return None
        last = self._tracks[-1][2]
        drawn = [("reference", REFERENCE, "--", self._of(last.t_s, last.reference_m))]
        drawn += [(name, colour, "-", self._of(t.t_s, t.position_m)) for name, colour, t in self._tracks]

        def draw(figure: Any) -> None:
            legend_above(figure, self._lines(figure, [f"{a} [m]" for a in _AXES], drawn)[0])

        return Plot("position", "Position and reference", "", (10.5, 5.6), draw)

    def errors(self) -> Plot | None:
        drawn = [
            (name, colour, "-", self._of(t.t_s, 1000.0 * (t.position_m - t.reference_m)))
            for name, colour, t in self._tracks
            if np.isfinite(t.reference_m).any()
        ]
        if not drawn:
            return None

        def draw(figure: Any) -> None:
            legend_above(figure, self._lines(figure, [f"{a} [mm]" for a in _AXES], drawn)[0])

        return Plot("errors", "Position error", "Measured minus reference.", (10.5, 5.2), draw)

    def velocity(self) -> Plot | None:
        return self._compared(
            "velocity",
            "Velocity",
            [f"{a} [m/s]" for a in _AXES],
            (("reference_velocity", "reference"), ("true_velocity", "true"), ("velocity", "reported")),
        )

    def angles(self) -> Plot | None:
        note = "The paper's YXZ angles: θ is about 90° in hover, ψ the lateral lean, −φ the heading."
        labels = ("roll φ [°]", "pitch θ [°]", "yaw ψ [°]")
        wanted = (("angles_command", "commanded"), ("angles", "reported"))
        return self._compared("angles", "Angles", labels, wanted, note)

    def _compared(
        self, key: str, title: str, labels: Sequence[str], wanted: Sequence[tuple[str, str]], note: str = ""
    ) -> Plot | None:
        looks = {"reference": (REFERENCE, "--"), "commanded": (REFERENCE, "--"), "true": (GREEN, "-")}
        drawn = [
            (told, *looks.get(told, (BLUE, "-")), self._series(name)) for name, told in wanted if self._log.rows[name]
        ]
        if not any(told == "reported" and len(rows) for told, _, _, rows in drawn):
            return None

        def draw(figure: Any) -> None:
            legend_above(figure, self._lines(figure, labels, drawn)[0])

        return Plot(key, title, note, (10.5, 5.2), draw)

    def actuators(self) -> Plot | None:
        thrust = self._series("thrust")
        flaps = self._tracks[-1][2].flaps if self._tracks else np.empty((0, 3))
        if not len(thrust) and not len(flaps):
            return None

        def draw(figure: Any) -> None:
            panels = figure.subplots(2, 1, sharex=True)
            for axes, rows in zip(panels, (thrust, self._shown(flaps)), strict=True):
                for k, (name, colour) in enumerate((("left", BLUE), ("right", VERMILION))):
                    axes.plot(rows[:, 0], rows[:, 1 + k], color=colour, label=name, linewidth=0.8, alpha=0.8)
            panels[0].set(ylabel="thrust [N]")
            panels[1].set(ylabel="flaps [°]")
            self._time_axis(panels)
            legend_above(figure, panels[0])

        return Plot("actuators", "Thrust and flaps", "Thrust as commanded; flaps as they stand.", (10.5, 4.4), draw)

    def battery(self) -> Plot | None:
        rows = self._series("battery")
        if len(rows) < 2 or float(np.diff(rows[:, 0]).max()) > _SPARSE_S:
            return None

        def draw(figure: Any) -> None:
            self._lines(figure, ("voltage [V]", "current [A]", "left [%]"), [("battery", BLUE, "-", rows)])

        return Plot("battery", "Battery", "", (10.5, 4.2), draw)

    def wind(self) -> Plot | None:
        rows = self._series("wind")
        if len(rows) < 2 or not np.abs(rows[:, 1:]).max() > 0.0:
            return None

        def draw(figure: Any) -> None:
            (axes,) = self._lines(figure, ["air's motion [m/s]"], [], 1)
            for k, (name, colour) in enumerate((("north", BLUE), ("east", VERMILION), ("down", GREEN))):
                axes.plot(rows[:, 0], rows[:, 1 + k], color=colour, label=name)
            legend_above(figure, axes)

        return Plot("wind", "Wind", "The direction in which the air moves, at the vehicle.", (10.5, 2.6), draw)

    def estimate(self) -> Plot | None:
        """What the vehicle believes less what is true."""
        if self._true is None or self._reported is None:
            return None
        off = self._of(self._reported.t_s, 1000.0 * (self._reported.position_m - self._true.position_m))
        believed, true = self._series("velocity"), self._series("true_velocity")
        turned = self._series("turned")

        def draw(figure: Any) -> None:
            panels = figure.subplots(3, 1, sharex=True)
            for k, (name, colour) in enumerate((("north", BLUE), ("east", VERMILION), ("down", GREEN))):
                panels[0].plot(off[:, 0], off[:, 1 + k], color=colour, label=name)
                panels[1].plot(true[:, 0], 1000.0 * (believed - true)[:, 1 + k], color=colour)
            panels[2].plot(turned[:, 0], turned[:, 1], color=PURPLE)
            for axes, label in zip(panels, ("position [mm]", "velocity [mm/s]", "attitude [°]"), strict=True):
                axes.set(ylabel=label)
            self._time_axis(panels)
            legend_above(figure, panels[0])

        note = "Believed minus true; of the attitude, the angle between both."
        return Plot("estimator", "Error of the estimate", note, (10.5, 5.2), draw)

    def link(self) -> Plot | None:
        link = self._log.link
        if link is None or len(link.per_second) < 2:
            return None
        seconds, counts = zip(*link.per_second, strict=True)

        def draw(figure: Any) -> None:
            axes = figure.subplots()
            axes.step(seconds, counts, where="post", color=BLUE)
            axes.set(xlabel="wall time from the log's start [s]", ylabel="frames/s", ylim=(0, None))

        return Plot("link", "Frames heard from the vehicle", "In each second of wall time.", (10.5, 2.4), draw)
