"""One vehicle in the scene: the parts of its airframe, moved as the telemetry says."""

import math

import viser
from viser import SceneApi

from gcs_tools.view import airframe_mesh as shape
from gcs_tools.view.airframe_mesh import Dimensions
from gcs_tools.view.solids import Mesh
from gcs_tools.view.vehicle import Instant

WHITE = (232, 235, 240)
DARK = (52, 58, 70)
GLASS = (60, 130, 190)
RUBBER = (30, 32, 36)
ORANGE = (240, 120, 40)
RED, GREEN = (230, 50, 50), (50, 205, 90)
BLUR_RPM = 1500.0  # where an eye no longer follows the blades
_SIDES = ((-1, "left"), (1, "right"))


class AirframeNodes:
    """The nodes below `root`, a frame whose axes are N. `body` is the frame B in it."""

    def __init__(self, scene: SceneApi, root: str, d: Dimensions) -> None:
        self.dimensions = d
        self._scene = scene
        self.body = scene.add_frame(f"{root}/body", show_axes=False)
        for name, mesh, colour in (
            ("wing", shape.wing(d), WHITE),
            ("fuselage", shape.fuselage(d), DARK),
            ("canopy", shape.canopy(d), GLASS),
            ("nacelles", shape.nacelles(d), DARK),
            ("fins", shape.fins(d), WHITE),
            ("pads", shape.feet_pads(d), RUBBER),
            ("belly", shape.belly(d), ORANGE),
            ("light_left", shape.tip_light(d, -1), RED),
            ("light_right", shape.tip_light(d, 1), GREEN),
        ):
            self._mesh(f"{root}/body/{name}", mesh, colour)
        self._flaps, self._rotors, self._blades, self._discs, self._wakes = [], [], [], [], []
        for (side, name), hub in zip(_SIDES, shape.hubs(d), strict=True):
            flap = f"{root}/body/flap_{name}"
            self._flaps.append(scene.add_frame(flap, show_axes=False, position=(d.hinge_m, 0.0, 0.0)))
            self._mesh(f"{flap}/panel", shape.flap(d, side), ORANGE)
            rotor = f"{root}/body/rotor_{name}"
            self._rotors.append(scene.add_frame(rotor, show_axes=False, position=hub))
            self._mesh(f"{rotor}/spinner", shape.spinner(), ORANGE)
            self._blades.append(self._mesh(f"{rotor}/blades", shape.propeller(d, side), RUBBER, opacity=1.0))
            self._discs.append(
                self._mesh(f"{rotor}/disc", shape.disc(d), (170, 180, 195), opacity=0.0, cast_shadow=False)
            )
            self._wakes.append(
                self._mesh(
                    f"{root}/body/wake_{name}", shape.slipstream(d), (120, 190, 255), opacity=0.0, cast_shadow=False,
                    side="double", position=hub,
                )
            )  # fmt: skip
        self._angles = [0.0, 0.0]
        self._now_us: int | None = None
        self.show_wake = True

    def _mesh(self, name: str, mesh: Mesh, colour: tuple[int, int, int], **options: object) -> viser.MeshHandle:
        return self._scene.add_mesh_simple(name, mesh.vertices, mesh.faces, color=colour, **options)  # type: ignore[arg-type]

    def update(self, instant: Instant) -> None:
        """As the instant says: pose, flaps, propellers turned on by their speed times the time since the last one."""
        u = instant.actuators
        self.body.position = instant.state.position_N_m
        self.body.wxyz = instant.attitude.q_NB
        passed_s = 0.0 if self._now_us is None else (instant.now_us - self._now_us) * 1e-6
        self._now_us = instant.now_us
        for k, (side, rpm, flap_deg) in enumerate(
            ((-1, u.rotor_left_rpm, u.flap_left_deg), (1, u.rotor_right_rpm, u.flap_right_deg))
        ):
            self._flaps[k].wxyz = flap_quaternion(flap_deg)
            self._angles[k] = (self._angles[k] + side * rpm * passed_s * math.tau / 60.0) % math.tau
            self._rotors[k].wxyz = (math.cos(0.5 * self._angles[k]), math.sin(0.5 * self._angles[k]), 0.0, 0.0)
            blur = min(1.0, rpm / BLUR_RPM)
            self._blades[k].opacity = round(1.0 - 0.6 * blur, 1)
            self._discs[k].opacity = round(0.22 * blur, 2)
            self._wakes[k].opacity = round(0.14 * min(1.0, (rpm / 7500.0) ** 2), 2) if self.show_wake else 0.0


def flap_quaternion(deflection_deg: float) -> tuple[float, float, float, float]:
    """A flap's rotation in B. Positive: trailing edge (−x) down (+z), a right-hand turn about +y."""
    half = 0.5 * math.radians(deflection_deg)
    return math.cos(half), 0.0, math.sin(half), 0.0
