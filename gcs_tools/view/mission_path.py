"""The stored mission in the scene: its points numbered and joined, each with a plumb line, the current one marked."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from gcs_tools.view.topics import Mission, Triple
from gcs_tools.view.vehicle import Vehicle

RGB = (255, 150, 0)
PLUMB_RGB = (90, 60, 10)
LABELLED_MAX = 40  # points; a survey's hundreds would hide the scene
POINT_M, CURRENT_M = 0.03, 0.055


def path(mission: Mission) -> list[Triple]:
    """The points in order, of the items that have one."""
    return [item.position_N_m for item in mission.items if item.position_N_m is not None]


def lines(points: list[Triple], ground_down_m: float) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Segments (n, 2, 3) and their colours: from point to point, and from each down to the ground."""
    legs = list(pairwise(points))
    plumbs = [(p, (p[0], p[1], ground_down_m)) for p in points]
    colours = [[RGB, RGB]] * len(legs) + [[PLUMB_RGB, PLUMB_RGB]] * len(plumbs)
    return np.array(legs + plumbs, dtype=np.float32), np.array(colours, dtype=np.uint8)


class MissionPath:
    """The nodes below `root`, a frame whose axes are N."""

    def __init__(self, scene: SceneApi, root: str, ground_down_m: float) -> None:
        self._scene, self._root, self._ground_down_m = scene, f"{root}/mission", ground_down_m
        self._all = scene.add_frame(self._root, show_axes=False)
        self._current = scene.add_icosphere(f"{root}/current", CURRENT_M, color=RGB, opacity=0.6, visible=False)
        self._drawn: Mission | None = None
        self.visible = True

    def update(self, vehicle: Vehicle) -> None:
        mission, mode = vehicle.mission, vehicle.mode
        if mission is None or mode is None:
            return
        if mission != self._drawn:
            self._drawn = mission
            self._draw(mission)
        self._all.visible = self.visible
        here = next((item.position_N_m for item in mission.items if item.index == mode.mission_current), None)
        self._current.visible = self.visible and here is not None and mode.mission_plan_id == mission.plan_id
        if here is not None:
            self._current.position = here

    def _draw(self, mission: Mission) -> None:
        self._all.remove()  # with all that is below
        self._all = self._scene.add_frame(self._root, show_axes=False, visible=self.visible)
        points = path(mission)
        if not points:
            return
        segments, colours = lines(points, self._ground_down_m)
        self._scene.add_line_segments(
            f"{self._root}/lines", segments, colours, thickness=2.0, thickness_units="screen"
        )  # fmt: skip
        for item in [item for item in mission.items if item.position_N_m is not None][:LABELLED_MAX]:
            name = f"{self._root}/{item.index}"
            assert item.position_N_m is not None
            self._scene.add_icosphere(name, POINT_M, color=RGB, position=item.position_N_m)
            self._scene.add_label(
                f"{name}/label", f"{item.index} {item.command}", position=(0.0, 0.0, -0.08), font_screen_scale=0.75,
                anchor="bottom-center",
            )  # fmt: skip
