"""Forces by cause as arrows in B: where each acts, and how it is split where the moment tells so."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from gcs_tools.view.airframe_mesh import Dimensions
from gcs_tools.view.topics import Load, Triple

COLOURS_RGB = {
    "gravity": (235, 160, 0),
    "thrust": (225, 40, 40),
    "aero": (30, 110, 240),
    "flaps": (30, 180, 80),
    "side_force": (175, 60, 225),
    "drag": (130, 140, 150),
    "ground": (150, 95, 50),
    "total": (245, 245, 245),
}
OTHER_RGB = (0, 200, 200)  # of a cause that has no name here
LEAST_N = 0.02  # smaller ones are not drawn


class Arrow(NamedTuple):
    cause: str
    at_B_m: Triple
    force_B_N: Triple

    @property
    def size_N(self) -> float:
        return math.hypot(*self.force_B_N)


def colour(cause: str) -> tuple[int, int, int]:
    return COLOURS_RGB.get(cause, OTHER_RGB)


def arrows(causes: Mapping[str, Load], total: Load, d: Dimensions) -> list[Arrow]:
    """An arrow for each cause worth drawing.

    Thrust and flap forces are two each: their sum is `force`, their difference follows from the moment that it makes
    about z (thrusts at ±l_y) and about x (flaps at ±l_y, in the slipstreams).
    """
    found = []
    for cause, load in (*causes.items(), ("total", total)):
        if cause == "thrust":
            half, difference = 0.5 * load.force_B_N[0], 0.5 * load.moment_B_N_m[2] / d.prop_arm_m
            for side, size in ((-1, half + difference), (1, half - difference)):
                found.append(Arrow(cause, (d.prop_x_m, side * d.prop_arm_m, 0.0), (size, 0.0, 0.0)))
        elif cause == "flaps":
            half, difference = 0.5 * load.force_B_N[2], 0.5 * load.moment_B_N_m[0] / d.prop_arm_m
            for side, size in ((-1, half - difference), (1, half + difference)):
                found.append(Arrow(cause, (d.hinge_m, side * d.prop_arm_m, 0.0), (0.0, 0.0, size)))
        else:
            found.append(Arrow(cause, _place(cause, d), load.force_B_N))
    return [arrow for arrow in found if arrow.size_N >= LEAST_N]


def _place(cause: str, d: Dimensions) -> Triple:
    """Where a force is drawn to act; those without a place of their own at the centre of mass."""
    if cause == "aero":
        return d.leading_edge_m - 0.25 * d.chord_m, 0.0, 0.0
    if cause == "ground":
        north, east, down = d.feet_B.mean(axis=0)
        return float(north), float(east), float(down)
    return 0.0, 0.0, 0.0
