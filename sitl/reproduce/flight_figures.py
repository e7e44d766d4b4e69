"""Figures of the flights: tracking, attitude, actuators, forces, paths."""

from typing import Any

import numpy as np

from sitl.drawing import REFERENCE, Plot, legend_above
from sitl.reproduce.cases import MISSIONS, SETUPS
from sitl.reproduce.colours import COLOURS
from sitl.reproduce.evaluation import Evaluation
from sitl.reproduce.fly import CAUSES, Flight
from sitl.reproduce.printed import AXES, OVERALL, ROWS

_POSITIONS = (("north_m", "x north"), ("east_m", "y east"), ("down_m", "z down"))
_ANGLES = (("roll_deg", "roll φ [°]"), ("pitch_deg", "pitch θ [°]"), ("yaw_deg", "yaw ψ [°]"))
_CAUSE_COLOURS = ("#333333", "#0072b2", "#cc79a7", "#009e73", "#d55e00")
_EVERY = 4  # samples drawn: 12.5 a second are smooth on a page


def plots(evaluation: Evaluation) -> list[Plot]:
    flights = {m: {s.key: evaluation.flight(s.key, m) for s in SETUPS} for m in MISSIONS}
    found = [_summary(flights)]
    for mission in MISSIONS:
        found += [_position(mission, flights[mission]), _attitude(mission, flights[mission])]
    for mission in MISSIONS:
        found += [_actuators(mission, flights[mission]), _forces(mission, flights[mission]["feedforward"])]
    return [*found, _path(flights)]


def _t(flight: Flight) -> Any:
    return flight.column("t_s")[::_EVERY]


def _y(flight: Flight, column: str) -> Any:
    return flight.column(column)[::_EVERY]


def _summary(flights: dict[str, dict[str, Flight]]) -> Plot:
    def draw(figure: Any) -> None:
        panels = figure.subplots(1, 2, sharey=True)
        labels = [f"{label.split(' [')[0]} {axis}" for _, label in ROWS for axis in AXES]
        rows = np.arange(len(labels))[::-1]
        for axes, (mission, by_setup) in zip(panels, flights.items(), strict=True):
            printed = np.array([OVERALL[mission][key] for key, _ in ROWS]).ravel()
            for setup in SETUPS:
                values = np.array([by_setup[setup.key].true[key] for key, _ in ROWS]).ravel()
                axes.plot(np.maximum(values / printed, 1e-3), rows, "o", color=COLOURS[setup.key], label=setup.title)
            axes.axvline(1.0, color=REFERENCE, linestyle="--", linewidth=1.0, label="print")
            axes.set(xscale="log", title=mission, xlabel="measured / print", yticks=rows, yticklabels=labels)
        legend_above(figure, panels[0])

    note = "Left of the dashed line is at or below print. What is below a thousandth is drawn at a thousandth."
    return Plot("summary", "Every overall figure as a share of print", note, (10.5, 4.8), draw)


def _position(mission: str, by_setup: dict[str, Flight]) -> Plot:
    def draw(figure: Any) -> None:
        panels = figure.subplots(3, 2, sharex=True)
        for k, (column, label) in enumerate(_POSITIONS):
            left, right = panels[k]
            reference = by_setup["feedforward"]
            left.plot(_t(reference), _y(reference, f"ref_{column}"), "--", color=REFERENCE, label="reference")
            for setup in SETUPS:
                flight, colour = by_setup[setup.key], COLOURS[setup.key]
                left.plot(_t(flight), _y(flight, column), color=colour, label=setup.title)
                error = flight.column(column) - flight.column(f"ref_{column}")
                right.plot(_t(flight), error[::_EVERY], color=colour)
            right.axhline(OVERALL[mission]["max_overshoot"][k], color=REFERENCE, linestyle=":", linewidth=1.0)
            right.axhline(-OVERALL[mission]["max_overshoot"][k], color=REFERENCE, linestyle=":", linewidth=1.0)
            right.set_yscale("symlog", linthresh=0.01)
            right.axhspan(-0.01, 0.01, color="#f3f3f3", zorder=0)
            left.set_ylabel(f"{label} [m]")
        panels[0][0].set_title("position")
        panels[0][1].set_title("error [m]: logarithmic outside the grey band; dotted: print's largest")
        for axes in panels[-1]:
            axes.set_xlabel("t [s]")
        legend_above(figure, panels[0][0])

    note = (
        "True positions. Only feedback alone can be told from the reference by eye: it arrives late. On the right the "
        "same as errors: feed-forward brings them from decimetres to millimetres, and a filter's own error to a "
        "centimetre or two."
    )
    return Plot(f"{mission}-position", f"{mission.capitalize()}: positions over time", note, (10.5, 6.0), draw)


def _attitude(mission: str, by_setup: dict[str, Flight]) -> Plot:
    def draw(figure: Any) -> None:
        panels = figure.subplots(3, 1, sharex=True)
        for axes, (column, label) in zip(panels, _ANGLES, strict=True):
            for setup in SETUPS:
                flight = by_setup[setup.key]
                axes.plot(_t(flight), _y(flight, column), color=COLOURS[setup.key], label=setup.title)
            axes.set_ylabel(label)
        panels[-1].set_xlabel("t [s]")
        legend_above(figure, panels[0])

    notes = {
        "rectangle": (
            "The paper's YXZ angles. Yaw ψ is the lean that starts and stops each lateral leg, twice as much for the "
            "10 m of the third leg as for the 5 m of the others. Pitch θ carries the 20 m legs: nose down out, nose "
            "up back, around hover's 99.5°. Roll φ is the heading; on a filter's estimate it begins off by the "
            "magnetometer's error, until the accelerations of the legs tell it better."
        ),
        "circle": (
            "The paper's YXZ angles. Going round at 0.28 m/s takes a pitch that swings by two degrees with the "
            "airspeed along the wing's normal, and a fifth of a degree of lean; the bumps of yaw ψ at 7 s and 52 s "
            "are the lap's start and end. Roll φ is the heading; so gentle a flight tells a filter little of it, and "
            "the magnetometer's error stays."
        ),
    }
    title = f"{mission.capitalize()}: attitude over time"
    return Plot(f"{mission}-attitude", title, notes[mission], (10.5, 5.5), draw)


def _actuators(mission: str, by_setup: dict[str, Flight]) -> Plot:
    def draw(figure: Any) -> None:
        shown = [setup for setup in SETUPS if setup.key in ("feedforward", "tuned")]
        panels = figure.subplots(2, len(shown), sharex=True, sharey="row")
        for column, setup in enumerate(shown):
            flight = by_setup[setup.key]
            for side, colour in (("left", "#0072b2"), ("right", "#d55e00")):
                t = _t(flight)
                panels[0][column].plot(t, _y(flight, f"thrust_{side}_N"), color=colour, label=side, linewidth=0.9)
                panels[1][column].plot(t, _y(flight, f"flap_{side}_deg"), color=colour, linewidth=0.9)
            panels[0][column].set_title(setup.title)
            panels[1][column].set_xlabel("t [s]")
        panels[0][0].set_ylabel("thrust [N]")
        panels[1][0].set_ylabel("flap [°]")
        legend_above(figure, panels[0][0])

    note = (
        "What the actuators do, not what they are told. Left and right are one line as far as the eye can tell: "
        "lateral legs take differences of millinewtons. Real sensors keep the flaps moving by half a degree. Spikes "
        "stand where a reference begins or ends a leg along x, because its jerk jumps there."
    )
    return Plot(f"{mission}-actuators", f"{mission.capitalize()}: actuators over time", note, (10.5, 4.5), draw)


def _forces(mission: str, flight: Flight) -> Plot:
    def draw(figure: Any) -> None:
        panels = figure.subplots(3, 1, sharex=True)
        for axes, axis in zip(panels, "xyz", strict=True):
            for cause, colour in zip(CAUSES, _CAUSE_COLOURS, strict=True):
                label = {"aero": "wing"}.get(cause, cause.replace("_", " "))
                axes.plot(_t(flight), _y(flight, f"{cause}_{axis}_N"), color=colour, label=label, linewidth=1.0)
            axes.set_ylabel(f"F_{axis} in B [N]")
        panels[-1].set_xlabel("t [s]")
        legend_above(figure, panels[0])

    note = (
        "Body axes: x along the nose (up in hover), y to the right, z to the belly's side. Along y nothing but "
        "gravity's part, which is lean, can be seen: the side force is there but as small as the differences of "
        "thrust. Along z the wing in its slipstream pushes against gravity; flaps give the rest."
    )
    title = f"{mission.capitalize()}: forces by cause, printed gains with feed-forward"
    return Plot(f"{mission}-forces", title, note, (10.5, 5.5), draw)


def _path(flights: dict[str, dict[str, Flight]]) -> Plot:
    def draw(figure: Any) -> None:
        for k, (mission, by_setup) in enumerate(flights.items()):
            axes = figure.add_subplot(1, 2, k + 1, projection="3d")
            reference = by_setup["feedforward"]
            axes.plot(
                *(_y(reference, f"ref_{c}") for c in ("east_m", "north_m")), -_y(reference, "ref_down_m"),
                "--", color=REFERENCE, label="reference",
            )  # fmt: skip
            for setup in SETUPS:
                f = by_setup[setup.key]
                path = (_y(f, "east_m"), _y(f, "north_m"), -_y(f, "down_m"))
                axes.plot(*path, color=COLOURS[setup.key], label=setup.title)
            axes.set(xlabel="east [m]", ylabel="north [m]", zlabel="up [m]", title=mission)
            axes.set_box_aspect((1, 1, 0.6))
            axes.locator_params(nbins=5)
        legend_above(figure, figure.axes[0])

    return Plot(
        "paths",
        "Both flights in space",
        "Seen from the south and above; north, east and up to different scales.",
        (10.5, 5.0),
        draw,
    )
