"""The trim's inverse model: which pitch, lean, thrust and flap give a wanted force at a given velocity."""

import math
from typing import NamedTuple

from sitl.jit import kernel
from sitl.model.aerodynamics import flap_pressure, panel
from sitl.model.airframe import Airframe
from sitl.model.propulsion import wake_speed
from sitl.quaternion import Vec3

_STEP = 1e-4  # rad, for the slope of the pitch equation


class Trim(NamedTuple):
    """Balance of forces and pitching moment in the heading frame: R_NB = R_z(heading) R_y(pitch) R_z(lean)."""

    pitch_rad: float
    lean_rad: float
    thrust_N: float
    flap_rad: float  # both flaps
    slope_N_rad: float  # of the force balance along body z over pitch
    residual_N: float  # of that balance before the last pass


@kernel
def _balance(
    a: Airframe, force: Vec3, air: Vec3, moment_y: float, pitch: float, thrust: float
) -> tuple[float, float, float, float]:
    """(residual force along body z [N], lean, thrust, flap) at a trial pitch and thrust."""
    c, s = math.cos(pitch), math.sin(pitch)
    gx, gz = c * force[0] - s * force[2], s * force[0] + c * force[2]
    along = math.sqrt(gx * gx + force[1] * force[1])
    lean = math.atan2(force[1], gx)
    u_plane, w = c * air[0] - s * air[2], s * air[0] + c * air[2]
    u = (gx * u_plane + force[1] * air[1]) / along if along > 1e-9 else u_plane
    wake = wake_speed(a, 0.5 * thrust, u)
    ix, iz, im = panel(a, wake, w, a.immersed_fraction)
    fx, fz, fm = panel(a, u, w, 1.0 - a.immersed_fraction)
    pressure_area = 2.0 * a.flap_area_m2 * flap_pressure(a, w, wake)
    flap = (moment_y - im - fm) / (pressure_area * a.chord_m * a.flap_moment_slope)
    flap = max(-a.flap_max_rad, min(a.flap_max_rad, flap))
    flap_z = -pressure_area * a.flap_lift_slope * flap
    thrust = max(2.0 * a.thrust_min_N, min(2.0 * a.thrust_max_N, along - ix - fx))
    return gz - iz - fz - flap_z, lean, thrust, flap


@kernel
def refined(a: Airframe, force: Vec3, air: Vec3, moment_y: float, start: Trim, fresh_slope: bool) -> Trim:
    """One Newton pass from `start` toward the trim that gives `force` at air velocity `air`; see `invert`.

    Enough where `start` is the solution of a moment ago. Without `fresh_slope` the start's slope serves again, at
    half of the cost.
    """
    residual, lean, thrust, flap = _balance(a, force, air, moment_y, start.pitch_rad, start.thrust_N)
    slope = start.slope_N_rad
    if fresh_slope:
        ahead, _, _, _ = _balance(a, force, air, moment_y, start.pitch_rad + _STEP, start.thrust_N)
        slope = (ahead - residual) / _STEP
        if abs(slope) < 1.0:
            slope = 1.0 if slope >= 0.0 else -1.0
    pitch = start.pitch_rad - max(-0.2, min(0.2, residual / slope))
    return Trim(pitch, lean, thrust, flap, slope, residual)


@kernel
def invert(
    a: Airframe, force: Vec3, air: Vec3, moment_y: float, pitch_rad: float, thrust_N: float, passes: int
) -> Trim:
    """The trim that gives `force` [N, heading frame, without gravity] at air velocity `air` [m/s, heading frame].

    Newton's method on the pitch for the force along body z (paper Eq. deltas, read as an equation for θ), with the
    flap from the pitching moment and the thrust from the force along body x in each pass.
    """
    trim = Trim(pitch_rad, 0.0, thrust_N, 0.0, 1.0, 0.0)
    for _ in range(passes):
        trim = refined(a, force, air, moment_y, trim, True)
    return trim
