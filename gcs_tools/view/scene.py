"""The 3D scene: ground, light, and each vehicle with what is drawn around it.

Its axes are N itself, north-east-down with −z up: positions, vectors and q_NB are drawn as they come. Vehicles that
started elsewhere stand in a frame of their own, moved by the distance of their origins.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from gcs_tools.view import airframe_mesh
from gcs_tools.view.airframe_nodes import AirframeNodes
from gcs_tools.view.overlays import Overlays, Shown
from gcs_tools.view.topics import Quadruple
from gcs_tools.view.vehicle import Vehicle
from sitl.geodesy import GeoPoint, to_local

UP_N = (0.0, 0.0, -1.0)
SLOW_S = 0.1  # between two drawings of what need not follow every instant
SKY_RGB, FLOOR_RGB = np.array([44.0, 58.0, 78.0]), np.array([14.0, 16.0, 20.0])


class Scene:
    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._scene.set_up_direction(UP_N)
        server.initial_camera.up = UP_N
        server.initial_camera.position = (-2.2, 1.2, -1.2)
        server.initial_camera.look_at = (0.0, 0.0, -0.2)
        self._scene.configure_environment_map("studio", environment_intensity=0.5)
        self._scene.set_background_image(_sky(), format="png")
        self._ground: Any = None
        self._drawn: dict[int, _Drawn] = {}
        self._origin: GeoPoint | None = None
        self._slow_s = float("-inf")
        self._shown = Shown()

    def update(self, vehicles: Mapping[int, Vehicle], selected: Vehicle | None, wall_s: float) -> None:
        slowly = wall_s >= self._slow_s
        if slowly:
            self._slow_s = wall_s + SLOW_S
        for instance, vehicle in vehicles.items():
            if vehicle.description is None or vehicle.mode is None or vehicle.instant is None:
                continue
            drawn = self._drawn.get(instance)
            if drawn is None or drawn.epoch != vehicle.epoch:
                drawn = self._drawn[instance] = self._draw(vehicle)
            if drawn.now_us != vehicle.instant.now_us:
                drawn.now_us = vehicle.instant.now_us
                drawn.airframe.update(vehicle.instant)
                drawn.overlays.update(vehicle, vehicle.instant)
            if slowly:
                drawn.overlays.name(vehicle.name if len(vehicles) > 1 else "")
                drawn.overlays.update_slowly(vehicle)

    def show(self, shown: Shown) -> None:
        """Draw these, and the rest not."""
        if shown != self._shown:
            self._shown = shown
            for drawn in self._drawn.values():
                drawn.show(shown)

    def pose(self, vehicle: Vehicle) -> tuple[NDArray[np.float64], Quadruple, float] | None:
        """Where a vehicle is drawn: position and q in the scene's axes, and its heading [rad]."""
        drawn = self._drawn.get(vehicle.instance)
        if drawn is None or vehicle.instant is None:
            return None
        attitude = vehicle.instant.attitude
        position = drawn.offset_N_m + vehicle.instant.state.position_N_m
        return position, attitude.q_NB, math.radians(attitude.heading_deg)

    def _draw(self, vehicle: Vehicle) -> "_Drawn":
        """Put a vehicle into the scene, in place of what was there of it."""
        assert vehicle.description is not None
        assert vehicle.mode is not None
        told = airframe_mesh.told_or_bundled(vehicle.description)
        d = airframe_mesh.dimensions(told)
        m = vehicle.mode
        origin = GeoPoint(m.origin_lat_deg, m.origin_lon_deg, m.origin_alt_amsl_m)
        if self._origin is None:
            self._origin = origin
        ground_down_m = airframe_mesh.standing_height_m(told)
        if self._ground is None:
            self._ground = self._scene.add_grid(
                "/ground", infinite_grid=True, plane="xy", cell_size=0.5, section_size=5.0,
                cell_color=(52, 60, 72), section_color=(88, 104, 126), cell_thickness=0.7, section_thickness=1.1,
                fade_distance=60.0, fade_strength=1.5, shadow_opacity=0.5, position=(0.0, 0.0, ground_down_m),
            )  # fmt: skip
        north_m, east_m = to_local(self._origin, origin.lat_deg, origin.lon_deg)
        offset_N_m = np.array([north_m, east_m, self._origin.alt_amsl_m - origin.alt_amsl_m])
        root = f"/vehicle/{vehicle.instance}"
        self._scene.add_frame(root, show_axes=False, position=offset_N_m)
        airframe = AirframeNodes(self._scene, root, d)
        drawn = _Drawn(vehicle.epoch, offset_N_m, airframe, Overlays(self._scene, root, d, ground_down_m))
        drawn.show(self._shown)
        return drawn


def _sky() -> NDArray[np.uint8]:
    """A picture (height, width, 3) behind everything: dark, a little lighter above."""
    shade = np.linspace(0.0, 1.0, 64)[:, None, None]
    return np.repeat((SKY_RGB * (1.0 - shade) + FLOOR_RGB * shade).astype(np.uint8), 4, axis=1)


class _Drawn:
    """A vehicle's nodes, and what they show."""

    def __init__(
        self, epoch: int, offset_N_m: NDArray[np.float64], airframe: AirframeNodes, overlays: Overlays
    ) -> None:
        self.epoch, self.offset_N_m, self.airframe, self.overlays = epoch, offset_N_m, airframe, overlays
        self.now_us: int | None = None

    def show(self, shown: Shown) -> None:
        self.airframe.show_wake = shown.wake
        self.overlays.show(shown)
        self.now_us = None  # what comes into sight is as of now
