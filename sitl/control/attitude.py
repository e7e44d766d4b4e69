"""Attitude loop: from the attitude error to body rates (paper, Attitude Control and Desired Angular Rates)."""

import math

from sitl.control.gains import Loop
from sitl.control.pid import pid
from sitl.frames import quaternion_to_yxz, wrap_pi
from sitl.jit import kernel
from sitl.quaternion import Quat, Vec3, about_y, about_z, conjugate, multiply, rotate_back, rotation_vector


@kernel
def attitude_of(heading_rad: float, pitch_rad: float, lean_rad: float) -> Quat:
    """q_NB = q_z(heading) ⊗ q_y(pitch) ⊗ q_z(lean). At heading 0 these are the paper's θ and ψ with φ = 0."""
    return multiply(multiply(about_z(heading_rad), about_y(pitch_rad)), about_z(lean_rad))


@kernel
def rates_of(lean_rad: float, pitch_rad: float, heading_rate: float, pitch_rate: float, lean_rate: float) -> Vec3:
    """Body rates [rad/s] of an attitude given by heading, pitch and lean that change at the given rates."""
    # heading turns about N's down axis, which stands at (−sin θ, 0, cos θ) before the lean about body z is undone
    x, y, z = rotate_back(
        about_z(lean_rad),
        (-math.sin(pitch_rad) * heading_rate, pitch_rate, math.cos(pitch_rad) * heading_rate),
    )
    return x, y, z + lean_rate


@kernel
def error_quaternion(q_NB: Quat, target: Quat) -> Vec3:
    """Rotation vector [rad, B] from the present attitude to the target, the short way; no singularity."""
    return rotation_vector(multiply(conjugate(q_NB), target))


@kernel
def error_yxz(q_NB: Quat, target: Quat) -> Vec3:
    """The paper's error: differences of φ, θ, ψ [rad], wrapped to ±π. Singular at φ = ±90° (heading ±90° in hover)."""
    phi, theta, psi = quaternion_to_yxz(q_NB[0], q_NB[1], q_NB[2], q_NB[3])
    phi_t, theta_t, psi_t = quaternion_to_yxz(target[0], target[1], target[2], target[3])
    return wrap_pi(phi_t - phi), wrap_pi(theta_t - theta), wrap_pi(psi_t - psi)


@kernel
def rate_command(g: Loop, error: Vec3, integral: Vec3, rates_B: Vec3, feedforward_B: Vec3) -> Vec3:
    """ω = K_p e + K_i ∫e + K_d (ω_ff − ω) + ω_ff [rad/s, B]: the derivative acts on the rates only."""
    return (
        pid(g.x, error[0], integral[0], feedforward_B[0] - rates_B[0]) + feedforward_B[0],
        pid(g.y, error[1], integral[1], feedforward_B[1] - rates_B[1]) + feedforward_B[1],
        pid(g.z, error[2], integral[2], feedforward_B[2] - rates_B[2]) + feedforward_B[2],
    )
