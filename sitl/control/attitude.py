"""Attitude loop: from the attitude error to body rates (paper, Attitude Control and Desired Angular Rates)."""

import math

from sitl.control.gains import Loop
from sitl.control.pid import pid
from sitl.frames import quaternion_to_yxz, wrap_pi
from sitl.jit import kernel
from sitl.quaternion import Quat, Vec3, about_y, about_z, conjugate, multiply, rotate_back


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
def error_quaternion(q_NB: Quat, target: Quat) -> tuple[Vec3, float]:
    """(error as a rotation vector [rad, B], cosine of the angle between the noses); no singularity.

    The nose, along which the thrust points, goes to its target the short way; the turn about the nose that is then
    left counts less the further the nose is off (reduced attitude, as in Brescianini & D'Andrea 2018).
    """
    w, x, y, z = multiply(conjugate(q_NB), target)
    nose_x = 1.0 - 2.0 * (y * y + z * z)  # the target's nose in B
    nose_y = 2.0 * (x * y + w * z)
    nose_z = 2.0 * (x * z - w * y)
    sine = math.sqrt(nose_y * nose_y + nose_z * nose_z)
    if sine < 1e-12:
        pitch, yaw = 0.0, 0.0 if nose_x > 0.0 else math.pi
    else:
        angle = math.atan2(sine, nose_x)
        pitch, yaw = -nose_z / sine * angle, nose_y / sine * angle
    return (max(0.0, nose_x) * wrap_pi(2.0 * math.atan2(x, w)), pitch, yaw), nose_x


@kernel
def error_yxz(q_NB: Quat, target: Quat) -> Vec3:
    """The paper's error: differences of φ, θ, ψ [rad], wrapped to ±π. Singular at φ = ±90° (heading ±90° in hover)."""
    phi, theta, psi = quaternion_to_yxz(q_NB[0], q_NB[1], q_NB[2], q_NB[3])
    phi_t, theta_t, psi_t = quaternion_to_yxz(target[0], target[1], target[2], target[3])
    return wrap_pi(phi_t - phi), wrap_pi(theta_t - theta), wrap_pi(psi_t - psi)


@kernel
def braked(error: float, p: float, braking_rad_s2: float) -> float:
    """The error [rad] made smaller where K_p times it would be a rate from which the actuators can't brake in time.

    Linear while p² e is below the braking acceleration α, then √(2 α (|e| − α / 2p²)) / p.
    """
    linear = braking_rad_s2 / (p * p) if p > 0.0 else math.inf
    if abs(error) <= linear:
        return error
    return math.copysign(math.sqrt(2.0 * braking_rad_s2 * (abs(error) - 0.5 * linear)) / p, error)


@kernel
def braked_together(y: float, z: float, p_y: float, p_z: float, braking_y: float, braking_z: float) -> float:
    """By what factor two errors [rad] shrink when both axes have to brake in time without leaving their direction."""
    size = math.sqrt(y * y + z * z)
    if size < 1e-9:
        return 1.0
    braking = min(braking_y * size / max(abs(y), 1e-9), braking_z * size / max(abs(z), 1e-9))
    return braked(size, max(p_y, p_z), braking) / size


@kernel
def rate_command(g: Loop, error: Vec3, integral: Vec3, rates_B: Vec3, feedforward_B: Vec3) -> Vec3:
    """ω = K_p e + K_i ∫e + K_d (ω_ff − ω) + ω_ff [rad/s, B]: the derivative acts on the rates only."""
    return (
        pid(g.x, error[0], integral[0], feedforward_B[0] - rates_B[0]) + feedforward_B[0],
        pid(g.y, error[1], integral[1], feedforward_B[1] - rates_B[1]) + feedforward_B[1],
        pid(g.z, error[2], integral[2], feedforward_B[2] - rates_B[2]) + feedforward_B[2],
    )
