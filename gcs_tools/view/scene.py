"""The 3D scene: ground and vehicles. Its axes are N itself, north-east-down: nothing is converted on the way."""

from collections.abc import Mapping

import viser

from gcs_tools.view.vehicle import Vehicle

UP_N = (0.0, 0.0, -1.0)


class Scene:
    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        server.scene.set_up_direction(UP_N)
        server.initial_camera.up = UP_N
        server.initial_camera.position = (-3.0, 1.5, -1.6)
        server.initial_camera.look_at = (0.0, 0.0, -0.3)
        server.scene.add_grid("/ground", infinite_grid=True, plane="xy", cell_size=1.0, section_size=5.0)
        self._vehicles: dict[int, viser.FrameHandle] = {}

    def update(self, vehicles: Mapping[int, Vehicle], selected: Vehicle | None) -> None:
        for instance, vehicle in vehicles.items():
            if vehicle.instant is None:
                continue
            if instance not in self._vehicles:
                self._vehicles[instance] = self._server.scene.add_frame(
                    f"/vehicle/{instance}", axes_length=0.4, axes_radius=0.01
                )
            frame = self._vehicles[instance]
            frame.position = vehicle.instant.state.position_N_m
            frame.wxyz = vehicle.instant.attitude.q_NB
