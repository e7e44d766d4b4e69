"""Figures of the model: coefficients over the angle of attack, and the poles in hover."""

import math
from typing import Any

import numpy as np

from sitl.drawing import REFERENCE, Plot, legend_above
from sitl.model.aerodynamics import coefficients
from sitl.model.airframe import Airframe
from sitl.page import told
from sitl.reproduce.colours import EXACT, FEEDBACK, FEEDFORWARD, TUNED
from sitl.reproduce.linear import READINGS
from sitl.vehicle_spec import load_vehicle

_RANGE_DEG = 40.0
_LOOP_COLOURS = (REFERENCE, FEEDFORWARD, TUNED, FEEDBACK)
_LABELS = ("(a) C_m", "(b) C_L", "(c) C_D")


def as_flown(a: Airframe, alpha: float, flap_rad: float) -> tuple[float, float, float]:
    """(C_m, C_L, C_D) of wing and both flaps in one flow, referred to the wing: what the plant's forces come to."""
    c, s = math.cos(alpha), math.sin(alpha)
    lift, drag, moment = coefficients(a, alpha, c, s)
    share = 2.0 * a.flap_area_m2 / a.wing_area_m2
    normal = share * a.flap_lift_slope * flap_rad  # along −z, whatever the angle of attack
    return moment + share * a.flap_moment_slope * flap_rad, lift + normal * c, drag + normal * s


def as_printed(a: Airframe, alpha: float, flap_rad: float) -> tuple[float, float, float]:
    """(C_m, C_L, C_D) by the paper's linear sums, valid before the stall."""
    lift = a.lift_at_zero + a.lift_slope * alpha + a.flap_lift_slope * flap_rad
    drag = a.drag_at_zero + lift * lift / (math.pi * a.oswald * a.aspect_ratio)
    return a.moment_at_zero + a.moment_slope * alpha + a.flap_moment_slope * flap_rad, lift, drag


def coefficient_plot() -> Plot:
    a = load_vehicle("yawsitter").airframe.airframe
    degrees = np.linspace(-_RANGE_DEG, _RANGE_DEG, 321)
    flaps = ((-a.flap_max_rad, FEEDBACK), (0.0, REFERENCE), (a.flap_max_rad, FEEDFORWARD))

    def draw(figure: Any) -> None:
        panels = figure.subplots(1, 3)
        for flap, colour in flaps:
            flown = np.array([as_flown(a, math.radians(d), flap) for d in degrees])
            attached = np.abs(degrees) < math.degrees(a.stall_angle_rad)
            printed = np.array([as_printed(a, math.radians(d), flap) for d in degrees[attached]])
            for k, axes in enumerate(panels):
                axes.plot(degrees, flown[:, k], color=colour, label=f"flaps {told(math.degrees(flap), 0, True)}°")
                axes.plot(degrees[attached], printed[:, k], "--", color=colour, linewidth=0.9)
        for axes, label in zip(panels, _LABELS, strict=True):
            axes.set(title=label, xlabel="angle of attack α [°]")
        legend_above(figure, panels[0])

    note = (
        "Solid: what the plant's forces come to, referred to the wing's area. Dashed: the printed linear sums, in "
        "which a flap of 0.02 m² acts as if it had the wing's 0.088 m²; that is why the flaps' effect is smaller here. "
        "C_D of deflected flaps leans over because their force stands on the chord, not on the flow. "
        "The paper gives its curves as a figure without numbers, so there is no error to state."
    )
    return Plot("coefficients", "C_m, C_L and C_D over α for least, zero and greatest flap", note, (10.5, 3.6), draw)


def pole_plot(loops: list[dict[str, Any]]) -> Plot:
    cases = (("paper", "ideal"), ("tuned", "real"))

    def draw(figure: Any) -> None:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (gains, actuators) in zip(panels, cases, strict=True):
            axes.axvspan(0.0, 1e4, color="#fbe9e0", zorder=0)
            for reading, marker, colour in zip(READINGS, "o^s", (TUNED, FEEDBACK, FEEDFORWARD), strict=True):
                line = _line(loops, gains, actuators, reading)
                s = np.array(line["poles_1_s"])
                axes.plot(
                    s[:, 0], s[:, 1], marker, color=colour, markersize=5, fillstyle="none", linestyle="none",
                    label=f"M_des = {reading}",
                )  # fmt: skip
            axes.set_xscale("symlog", linthresh=1.0)
            axes.set_yscale("symlog", linthresh=1.0)
            axes.set(title=f"{gains} gains, {actuators} actuators", xlabel="Re s [1/s]", xlim=(-1e4, 1e4))
        panels[0].set_ylabel("Im s [rad/s]")
        legend_above(figure, panels[0])

    note = "Continuous equivalents of the discrete poles, ln(z)/h; the shaded half is unstable."
    return Plot("poles", "Poles of the closed loop in hover, by reading of M_des", note, (10.0, 4.5), draw)


def loops_plot(shapes: dict[str, dict[str, Any]], zero_1_s: float) -> Plot:
    def draw(figure: Any) -> None:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (gains, by_loop) in zip(panels, shapes.items(), strict=True):
            for (loop, (w, gain)), colour in zip(
                by_loop.items(), (REFERENCE, FEEDFORWARD, TUNED, FEEDBACK), strict=True
            ):
                axes.loglog(w, gain, color=colour, label=loop)
            axes.axhline(1.0, color="#888888", linewidth=0.8)
            axes.axvline(zero_1_s, color=EXACT, linestyle="--", linewidth=1.0, label="unstable zero")
            axes.set(title=f"{gains} gains", xlabel="ω [rad/s]", ylim=(1e-3, 1e3))
        panels[0].set_ylabel("|L(jω)|")
        legend_above(figure, panels[0])

    note = (
        "The chain that moves the vehicle north, each loop closed around those inside it; where a line crosses 1 is "
        "its loop's speed. A cascade wants them well apart, the outer two left of the zero. Printed gains with ideal "
        "actuators, tuned with real ones."
    )
    return Plot("loops", "Open loops from pitch rate to north", note, (10.5, 4.0), draw)


def _line(loops: list[dict[str, Any]], gains: str, actuators: str, reading: str) -> dict[str, Any]:
    lines = [x for x in loops if (x["gains"], x["actuators"], x["reading"]) == (gains, actuators, reading)]
    return min(lines, key=lambda x: int(x["rate_hz"]))
