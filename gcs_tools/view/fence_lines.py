"""The stored fence in the scene: each area's border on the ground and above it, with posts between; the rally points.

An area has no height; the upper line is drawn as high as a person sees it from.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from gcs_tools.view.topics import Area, Triple
from gcs_tools.view.vehicle import Vehicle

INSIDE_RGB, OUTSIDE_RGB = (70, 200, 110), (230, 60, 50)  # to stay within, to stay out of
RALLY_RGB = (120, 170, 255)
HEIGHT_M = 2.0
POINT_M = 0.06
_CIRCLE_SIDES = 48


def corners(area: Area) -> list[tuple[float, float]]:
    """Of the polygon, or of one that stands for the circle."""
    if area.radius_m is None:
        return area.corners_N_m
    [(north, east)] = area.corners_N_m
    angles = (2.0 * math.pi * k / _CIRCLE_SIDES for k in range(_CIRCLE_SIDES))
    return [(north + area.radius_m * math.cos(a), east + area.radius_m * math.sin(a)) for a in angles]


def lines(areas: Sequence[Area], ground_down_m: float) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Segments (n, 2, 3) and their colours: borders on the ground and HEIGHT_M above it, and posts between them."""
    segments, colours = [], []
    for area in areas:
        drawn = corners(area)
        for (n1, e1), (n2, e2) in zip(drawn, (*drawn[1:], drawn[0]), strict=True):
            low, high = ground_down_m, ground_down_m - HEIGHT_M
            segments += [
                ((n1, e1, low), (n2, e2, low)), ((n1, e1, high), (n2, e2, high)), ((n1, e1, low), (n1, e1, high)),
            ]  # fmt: skip
            colours += [[INSIDE_RGB if area.inclusion else OUTSIDE_RGB] * 2] * 3
    return np.array(segments, dtype=np.float32), np.array(colours, dtype=np.uint8)


class FenceLines:
    """The nodes below `root`, a frame whose axes are N."""

    def __init__(self, scene: SceneApi, root: str, ground_down_m: float) -> None:
        self._scene, self._root, self._ground_down_m = scene, f"{root}/fence", ground_down_m
        self._all = scene.add_frame(self._root, show_axes=False)
        self._drawn: tuple[list[Area], list[Triple]] = ([], [])
        self.visible = True

    def update(self, vehicle: Vehicle) -> None:
        mission = vehicle.mission
        wanted = ([], []) if mission is None else (mission.fence, mission.rally_N_m)
        if wanted != self._drawn:
            self._drawn = wanted
            self._draw(*wanted)
        self._all.visible = self.visible

    def _draw(self, areas: list[Area], rally: list[Triple]) -> None:
        self._all.remove()  # with all that is below
        self._all = self._scene.add_frame(self._root, show_axes=False, visible=self.visible)
        if areas:
            segments, colours = lines(areas, self._ground_down_m)
            self._scene.add_line_segments(
                f"{self._root}/lines", segments, colours, thickness=1.5, thickness_units="screen"
            )  # fmt: skip
        for k, (north, east, _) in enumerate(rally):
            name = f"{self._root}/rally{k}"
            place = (north, east, self._ground_down_m)
            self._scene.add_icosphere(name, POINT_M, color=RALLY_RGB, position=place)
            self._scene.add_label(f"{name}/label", f"rally {k}", position=(0.0, 0.0, -0.1), font_screen_scale=0.75)
