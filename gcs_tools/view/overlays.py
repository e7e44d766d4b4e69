"""What is drawn around one vehicle: where it was and should have been, home, wind, forces."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from gcs_tools.view import forces
from gcs_tools.view.airframe_mesh import Dimensions
from gcs_tools.view.fence_lines import FenceLines
from gcs_tools.view.history import INDEX
from gcs_tools.view.mission_path import MissionPath
from gcs_tools.view.topics import Triple
from gcs_tools.view.vehicle import Instant, Vehicle

TRAIL_S = 60.0
TRAIL_POINTS = 400
ERROR_FULL_M = 0.10  # where the trail's colour ends
METRES_PER_N = 0.035
WIND_METRES_PER_M_S = 0.25
CALM_M_S = 0.05
ABOVE_M = 0.45  # the vehicle: the wind's arrow
NOTHING = np.zeros((1, 2, 3), dtype=np.float32)
_POSITION = [INDEX[name] for name in ("north_m", "east_m", "down_m")]
_REFERENCE = [INDEX[name] for name in ("reference_north_m", "reference_east_m", "reference_down_m")]
_SCALE_RGB = np.array([(0, 150, 140), (70, 180, 30), (240, 150, 0), (220, 20, 20)], dtype=float)


def thinned(rows: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """At most `most` of the rows, evenly, the same ones from call to call as the window moves on; the newest always."""
    step = 1
    while len(rows) > most * step:
        step *= 2
    kept = rows[::-step][::-1]
    return kept


def segments(points: NDArray[np.float64]) -> NDArray[np.float32]:
    """A polyline (n, 3) as (n−1, 2, 3)."""
    if len(points) < 2:
        return NOTHING
    return np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)


def error_colours(error_m: NDArray[np.float64]) -> NDArray[np.uint8]:
    """(n, 3) colours of distances from the reference: from teal at none over green and yellow to red."""
    at = np.clip(error_m / ERROR_FULL_M, 0.0, 1.0) * (len(_SCALE_RGB) - 1)
    known = np.arange(len(_SCALE_RGB))
    return np.stack([np.interp(at, known, _SCALE_RGB[:, k]) for k in range(3)], axis=1).astype(np.uint8)


class Shown(NamedTuple):
    """What is to be drawn."""

    trail: bool = True
    reference: bool = True
    mission: bool = True
    fence: bool = True
    wind: bool = True
    wake: bool = True
    forces: bool = False


class Overlays:
    """The nodes below `root`, a frame whose axes are N; forces hang on the body's own frame."""

    def __init__(self, scene: SceneApi, root: str, d: Dimensions, ground_down_m: float) -> None:
        self._d = d
        self._trail = scene.add_line_segments(
            f"{root}/trail", NOTHING, np.zeros((1, 2, 3), np.uint8), thickness=3.0, thickness_units="screen"
        )
        self._reference = scene.add_line_segments(
            f"{root}/reference", NOTHING, (240, 240, 250), thickness=1.5, thickness_units="screen"
        )
        self._home = scene.add_frame(f"{root}/home", axes_length=0.25, axes_radius=0.006, origin_radius=0.012)
        scene.add_label(f"{root}/home/label", "home", font_screen_scale=0.8)
        self._ground_down_m = ground_down_m
        self._mission = MissionPath(scene, root, ground_down_m)
        self._fence = FenceLines(scene, root, ground_down_m)
        self._name = scene.add_label(
            f"{root}/air/name", "", font_screen_scale=0.9, anchor="top-center", position=(0.0, 0.0, 0.24), visible=False
        )
        self._shown = Shown()
        self._added = 0  # rows of the history when the paths were drawn
        self._air = scene.add_frame(f"{root}/air", show_axes=False)  # goes with the vehicle, without turning
        self._wind: Any = scene.add_arrows(
            f"{root}/air/wind", NOTHING, (120, 220, 255), shaft_radius=0.012, head_radius=0.035, head_length=0.08
        )
        self._wind_label = scene.add_label(
            f"{root}/air/label", "", font_screen_scale=0.8, anchor="bottom-center", position=(0.0, 0.0, -ABOVE_M - 0.06)
        )
        self._forces: Any = scene.add_arrows(
            f"{root}/body/forces", NOTHING, np.zeros((1, 3), np.uint8),
            shaft_radius=0.006, head_radius=0.016, head_length=0.04,
        )  # fmt: skip

    def show(self, shown: Shown) -> None:
        self._trail.visible, self._reference.visible = shown.trail, shown.reference
        self._shown = shown
        self._wind.visible = self._wind_label.visible = self._forces.visible = False  # until there is something to show
        self._mission.visible, self._fence.visible = shown.mission, shown.fence
        self._added = 0

    def name(self, text: str) -> None:
        """Written below the vehicle; empty: nothing."""
        if self._name.text != text:
            self._name.text = text
            self._name.visible = bool(text)

    def update(self, vehicle: Vehicle, instant: Instant) -> None:
        """What moves with the vehicle."""
        if self._shown.forces:
            self._draw_forces(instant)
        self._air.position = instant.state.position_N_m

    def update_slowly(self, vehicle: Vehicle) -> None:
        """What need not follow every instant."""
        self._mission.update(vehicle)
        self._fence.update(vehicle)
        if self._shown.wind and vehicle.instant is not None:
            self._draw_wind(vehicle.instant.state.wind_N_m_s)
        if vehicle.mode is not None:
            north, east, down = vehicle.mode.home_N_m
            self._home.position = (north, east, down + self._ground_down_m)
        if vehicle.history.added != self._added:
            self._added = vehicle.history.added
            self._draw_paths(vehicle)

    def _draw_paths(self, vehicle: Vehicle) -> None:
        rows = thinned(vehicle.history.last(TRAIL_S), TRAIL_POINTS)
        if len(rows) > 1 and self._trail.visible:
            error_m = np.linalg.norm(rows[:, _POSITION] - rows[:, _REFERENCE], axis=1)
            colours = error_colours(error_m)
            self._trail.points = segments(rows[:, _POSITION])
            self._trail.colors = np.stack([colours[:-1], colours[1:]], axis=1)
        if len(rows) > 1 and self._reference.visible:
            self._reference.points = segments(rows[:, _REFERENCE])

    def _draw_wind(self, wind_N_m_s: Triple) -> None:
        """Above the vehicle, with its middle over it."""
        speed = math.hypot(*wind_N_m_s)
        self._wind.visible = self._wind_label.visible = speed >= CALM_M_S
        if speed < CALM_M_S:
            return
        middle = np.array((0.0, 0.0, -ABOVE_M))
        half = 0.5 * WIND_METRES_PER_M_S * np.array(wind_N_m_s)
        self._wind.points = np.array([[middle - half, middle + half]], dtype=np.float32)
        self._wind_label.text = f"wind {speed:.1f} m/s"

    def _draw_forces(self, instant: Instant) -> None:
        arrows = forces.arrows(instant.loads.causes, instant.loads.total, self._d)
        points = np.array([[a.at_B_m, np.add(a.at_B_m, np.multiply(METRES_PER_N, a.force_B_N))] for a in arrows])
        self._forces.visible = bool(arrows)
        if arrows:
            self._forces.points = points.astype(np.float32)
            self._forces.colors = np.array([forces.colour(a.cause) for a in arrows], dtype=np.uint8)
