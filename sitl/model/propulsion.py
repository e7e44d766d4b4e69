"""Two propellers: thrust, reaction torque, slipstream and the side force of their difference."""

import math

from sitl.jit import kernel
from sitl.model.airframe import Airframe
from sitl.quaternion import Vec3


@kernel
def thrust(a: Airframe, rotor_rad_s: float) -> float:
    """T = C_T ω² [N] of one propeller (paper Eq. thrust_force without its sign factor)."""
    return a.thrust_coefficient * rotor_rad_s * rotor_rad_s


@kernel
def rotor_speed(a: Airframe, thrust_N: float) -> float:
    """ω [rad/s] at which one propeller gives `thrust_N`."""
    return math.sqrt(max(thrust_N, 0.0) / a.thrust_coefficient)


@kernel
def wake_speed(a: Airframe, thrust_N: float, u_m_s: float) -> float:
    """Speed [m/s] of the air in one propeller's far wake, along body x.

    Momentum theory, T = ρ π R_s² V_s (V_s + u) for the induced increment V_s (paper Eq. 10–11), so that the wake is
    u + V_s = (u + √(u² + 4 T / (ρ π R_s²))) / 2: 14.6 m/s in hover. Written so, it stays smooth through u = 0.
    """
    radius = a.slipstream_radius_ratio * a.prop_radius_m
    disc = a.air_density_kg_m3 * math.pi * radius * radius
    return 0.5 * (u_m_s + math.sqrt(u_m_s * u_m_s + 4.0 * max(thrust_N, 0.0) / disc))


@kernel
def thrust_loads(a: Airframe, rotor_left_rad_s: float, rotor_right_rad_s: float) -> tuple[Vec3, Vec3]:
    """Force [N] and moment [N·m] in B of both propellers, without the side force.

    M_x = Q_L − Q_R with Q = C_μ ω² (each torque opposes its propeller's spin), M_z = l_y (T_L − T_R).
    """
    left, right = thrust(a, rotor_left_rad_s), thrust(a, rotor_right_rad_s)
    torque = a.torque_coefficient * (rotor_left_rad_s * rotor_left_rad_s - rotor_right_rad_s * rotor_right_rad_s)
    return (left + right, 0.0, 0.0), (torque, 0.0, a.prop_arm_m * (left - right))


@kernel
def side_force(a: Airframe, rotor_left_rad_s: float, rotor_right_rad_s: float) -> float:
    """F_y = K_f (T_L − T_R) [N]: the slipstreams' unequal pressure on the fuselage's sides (paper Eq. 7)."""
    return a.side_force_factor * (thrust(a, rotor_left_rad_s) - thrust(a, rotor_right_rad_s))
