"""Frames and angles.

World N is north-east-down. Body B is the aeroplane's forward-right-down: x out of the nose, which points up in hover.
`v_N = R_NB @ v_B`, and `q_NB` (w, x, y, z) is the same rotation. The multicopter frame H, used on the MAVLink wire,
is the body pitched by −90°: x out of the belly's front in hover, z down.
"""

import math

from sitl.jit import kernel
from sitl.quaternion import Quat, Vec3, about_y, multiply

GRAVITY_M_S2 = 9.80665  # standard gravity, along N's down axis
HALF_SQRT2 = math.sqrt(0.5)
BODY_TO_WIRE: Quat = (HALF_SQRT2, 0.0, -HALF_SQRT2, 0.0)  # q_y(-90 deg)
WIRE_TO_BODY: Quat = (HALF_SQRT2, 0.0, HALF_SQRT2, 0.0)


@kernel
def wrap_pi(angle: float) -> float:
    """The same angle in [-π, π)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def quaternion_to_yxz(qw: float, qx: float, qy: float, qz: float) -> Vec3:
    """The paper's angles (φ, θ, ψ) [rad] with R_NB = R_y(θ) R_x(φ) R_z(ψ); θ ≈ 90° in hover, singular at φ = ±90°."""
    r12 = 2.0 * (qy * qz - qw * qx)
    r02 = 2.0 * (qx * qz + qw * qy)
    r22 = 1.0 - 2.0 * (qx * qx + qy * qy)
    r10 = 2.0 * (qx * qy + qw * qz)
    r11 = 1.0 - 2.0 * (qx * qx + qz * qz)
    return math.asin(max(-1.0, min(1.0, -r12))), math.atan2(r02, r22), math.atan2(r10, r11)


@kernel
def quaternion_from_yxz(phi: float, theta: float, psi: float) -> Quat:
    """q_NB of the paper's angles [rad]."""
    cx, sx = math.cos(0.5 * phi), math.sin(0.5 * phi)
    cy, sy = math.cos(0.5 * theta), math.sin(0.5 * theta)
    cz, sz = math.cos(0.5 * psi), math.sin(0.5 * psi)
    return (
        cy * cx * cz + sy * sx * sz,
        cy * sx * cz + sy * cx * sz,
        sy * cx * cz - cy * sx * sz,
        cy * cx * sz - sy * sx * cz,
    )


@kernel
def euler_321(qw: float, qx: float, qy: float, qz: float) -> Vec3:
    """Roll, pitch, yaw [rad] of the aerospace 3-2-1 sequence, as MAVLink's ATTITUDE shows them."""
    roll = math.atan2(2.0 * (qw * qx + qy * qz), 1.0 - 2.0 * (qx * qx + qy * qy))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (qw * qy - qz * qx))))
    yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    return roll, pitch, yaw


@kernel
def quaternion_from_321(roll: float, pitch: float, yaw: float) -> Quat:
    """The quaternion of roll, pitch, yaw [rad] in the 3-2-1 sequence."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@kernel
def wire_quaternion(qw: float, qx: float, qy: float, qz: float) -> Quat:
    """Attitude of the multicopter frame H: q_NB ⊗ q_y(−90°). Upright hover reads roll = pitch = 0."""
    return multiply((qw, qx, qy, qz), BODY_TO_WIRE)


@kernel
def body_quaternion(w: float, x: float, y: float, z: float) -> Quat:
    """q_NB of an attitude given in the multicopter frame."""
    return multiply((w, x, y, z), WIRE_TO_BODY)


@kernel
def wire_rates(p: float, q: float, r: float) -> Vec3:
    """Body rates as the wire's rollspeed, pitchspeed, yawspeed: (r, q, −p)."""
    return r, q, -p


@kernel
def body_rates(rollspeed: float, pitchspeed: float, yawspeed: float) -> Vec3:
    """The wire's rates as body rates p, q, r."""
    return -yawspeed, pitchspeed, rollspeed


@kernel
def heading(qw: float, qx: float, qy: float, qz: float) -> float:
    """Where the belly faces [rad, from north toward east]: MAVLink's yaw in hover."""
    w, x, y, z = multiply((qw, qx, qy, qz), BODY_TO_WIRE)
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@kernel
def standing(heading_rad: float, pitch_rad: float) -> Quat:
    """q_NB of a vehicle with its belly to `heading_rad` and the paper's pitch θ, without lean."""
    return multiply((math.cos(0.5 * heading_rad), 0.0, 0.0, math.sin(0.5 * heading_rad)), about_y(pitch_rad))
