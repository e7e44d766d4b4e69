"""The rigid body: the plant's state and Newton-Euler's equations (paper Eq. 1) on quaternions."""

from typing import NamedTuple

from sitl.frames import GRAVITY_M_S2
from sitl.jit import kernel
from sitl.model.airframe import Airframe
from sitl.quaternion import Vec3, rotate


class State(NamedTuple):
    """The plant's state. World N (north, east, down), body B (forward, right, down), q_NB, SI and radians."""

    north_m: float
    east_m: float
    down_m: float
    v_north_m_s: float
    v_east_m_s: float
    v_down_m_s: float
    qw: float
    qx: float
    qy: float
    qz: float
    p_rad_s: float
    q_rad_s: float
    r_rad_s: float
    rotor_left_rad_s: float
    rotor_right_rad_s: float
    flap_left_rad: float
    flap_right_rad: float


@kernel
def accelerations(a: Airframe, s: State, force_B: Vec3, moment_B: Vec3) -> tuple[Vec3, Vec3]:
    """Acceleration of the CM in N [m/s²] and angular acceleration in B [rad/s²]; `force_B` without gravity.

    v̇_N = R_NB F_B / m + g,   ω̇ = J⁻¹ (M − ω × J ω),   J diagonal.
    """
    fn, fe, fd = rotate((s.qw, s.qx, s.qy, s.qz), force_B)
    p, q, r = s.p_rad_s, s.q_rad_s, s.r_rad_s
    return (
        (fn / a.mass_kg, fe / a.mass_kg, fd / a.mass_kg + GRAVITY_M_S2),
        (
            (moment_B[0] - (a.jzz_kg_m2 - a.jyy_kg_m2) * q * r) / a.jxx_kg_m2,
            (moment_B[1] - (a.jxx_kg_m2 - a.jzz_kg_m2) * r * p) / a.jyy_kg_m2,
            (moment_B[2] - (a.jyy_kg_m2 - a.jxx_kg_m2) * p * q) / a.jzz_kg_m2,
        ),
    )


@kernel
def moved(s: State, h: float, k: State) -> State:
    """s + h k, field by field: a step of length h [s] along the rates k."""
    return State(
        s.north_m + h * k.north_m,
        s.east_m + h * k.east_m,
        s.down_m + h * k.down_m,
        s.v_north_m_s + h * k.v_north_m_s,
        s.v_east_m_s + h * k.v_east_m_s,
        s.v_down_m_s + h * k.v_down_m_s,
        s.qw + h * k.qw,
        s.qx + h * k.qx,
        s.qy + h * k.qy,
        s.qz + h * k.qz,
        s.p_rad_s + h * k.p_rad_s,
        s.q_rad_s + h * k.q_rad_s,
        s.r_rad_s + h * k.r_rad_s,
        s.rotor_left_rad_s + h * k.rotor_left_rad_s,
        s.rotor_right_rad_s + h * k.rotor_right_rad_s,
        s.flap_left_rad + h * k.flap_left_rad,
        s.flap_right_rad + h * k.flap_right_rad,
    )
