"""The trim's inverse model: which pitch, lean, thrust and flap give a wanted force, and what a reference needs."""

import math
from typing import NamedTuple

from sitl.control.attitude import rates_of
from sitl.control.reference import Reference
from sitl.frames import GRAVITY_M_S2
from sitl.jit import kernel
from sitl.model.aerodynamics import flap_pressure, panel
from sitl.model.airframe import Airframe
from sitl.model.propulsion import wake_speed
from sitl.quaternion import Vec3

_STEP = 1e-4  # rad, for the slope of the pitch equation
_LOOK_S = 0.02  # how far before and after now a reference is inverted for its attitude rates


class Trim(NamedTuple):
    """Balance of forces and pitching moment in the heading frame: R_NB = R_z(heading) R_y(pitch) R_z(lean)."""

    pitch_rad: float
    lean_rad: float
    thrust_N: float
    flap_rad: float  # both flaps
    slope_N_rad: float  # of the force balance along body z over pitch
    residual_N: float  # of that balance before the last pass


class Course(NamedTuple):
    """The trims that the reference needs now, and _LOOK_S before and after."""

    before: Trim
    now: Trim
    after: Trim


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
def refined(a: Airframe, force: Vec3, air: Vec3, moment_y: float, start: Trim, slope_N_rad: float) -> Trim:
    """One Newton pass from `start` toward the trim that gives `force` at air velocity `air`; see `invert`.

    Enough where `start` is the solution of a moment ago. slope_N_rad: of the balance, where that of a trim nearby will
    do; nan: found afresh, at twice the cost.
    """
    residual, lean, thrust, flap = _balance(a, force, air, moment_y, start.pitch_rad, start.thrust_N)
    slope = slope_N_rad
    if math.isnan(slope):
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
        trim = refined(a, force, air, moment_y, trim, math.nan)
    return trim


@kernel
def heading_frame(heading_rad: float, x: float, y: float, z: float) -> Vec3:
    """A vector of N in the frame that is turned by the heading about N's down axis."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return c * x + s * y, c * y - s * x, z


@kernel
def _needed(a: Airframe, r: Reference) -> tuple[Vec3, Vec3]:
    """(force [N], air velocity [m/s]) in the heading frame of a flight that follows the reference exactly."""
    m = a.mass_kg
    force = heading_frame(r.heading_rad, m * r.a_north_m_s2, m * r.a_east_m_s2, m * (r.a_down_m_s2 - GRAVITY_M_S2))
    return force, heading_frame(r.heading_rad, r.v_north_m_s, r.v_east_m_s, r.v_down_m_s)


@kernel
def _carried(r: Reference, h: float) -> Reference:
    """The reference's velocity and acceleration h seconds on, at constant jerk."""
    k = 0.5 * h * h
    return Reference(
        r.north_m, r.east_m, r.down_m,
        r.v_north_m_s + h * r.a_north_m_s2 + k * r.j_north_m_s3,
        r.v_east_m_s + h * r.a_east_m_s2 + k * r.j_east_m_s3,
        r.v_down_m_s + h * r.a_down_m_s2 + k * r.j_down_m_s3,
        r.a_north_m_s2 + h * r.j_north_m_s3,
        r.a_east_m_s2 + h * r.j_east_m_s3,
        r.a_down_m_s2 + h * r.j_down_m_s3,
        r.j_north_m_s3, r.j_east_m_s3, r.j_down_m_s3,
        r.heading_rad + h * r.heading_rate_rad_s, r.heading_rate_rad_s,
    )  # fmt: skip


@kernel
def reference_needs(a: Airframe, r: Reference, start: Course, ahead: bool) -> tuple[Course, Vec3, Vec3]:
    """(trims, body rates [rad/s], moment [N·m, B]) that the reference itself needs; both zero unless looked `ahead`.

    Rates and moment are those of its trim's attitude, from its trim now, a moment ago and a moment on. Each goes one
    Newton pass on from where it was a control step ago (`start`).
    """
    zero = (0.0, 0.0, 0.0)
    force, air = _needed(a, r)
    now = refined(a, force, air, 0.0, start.now, math.nan)
    if not ahead:
        return Course(now, now, now), zero, zero
    force, air = _needed(a, _carried(r, -_LOOK_S))
    before = refined(a, force, air, 0.0, start.before, now.slope_N_rad)
    force, air = _needed(a, _carried(r, _LOOK_S))
    after = refined(a, force, air, 0.0, start.after, now.slope_N_rad)
    pitch_rate = (after.pitch_rad - before.pitch_rad) / (2.0 * _LOOK_S)
    lean_rate = (after.lean_rad - before.lean_rad) / (2.0 * _LOOK_S)
    pitching = (after.pitch_rad - 2.0 * now.pitch_rad + before.pitch_rad) / (_LOOK_S * _LOOK_S)
    leaning = (after.lean_rad - 2.0 * now.lean_rad + before.lean_rad) / (_LOOK_S * _LOOK_S)
    rates = rates_of(now.lean_rad, now.pitch_rad, r.heading_rate_rad_s, pitch_rate, lean_rate)
    return Course(before, now, after), rates, (0.0, a.jyy_kg_m2 * pitching, a.jzz_kg_m2 * leaning)
