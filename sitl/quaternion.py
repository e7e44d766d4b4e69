"""Unit quaternions as scalars (w, x, y, z), Hamilton convention; compiled, and plain Python without the JIT."""

import math

from sitl.jit import kernel

Quat = tuple[float, float, float, float]
Vec3 = tuple[float, float, float]


@kernel
def multiply(a: Quat, b: Quat) -> Quat:
    """a ⊗ b: first b, then a."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@kernel
def conjugate(q: Quat) -> Quat:
    return q[0], -q[1], -q[2], -q[3]


@kernel
def rotate(q: Quat, v: Vec3) -> Vec3:
    """R(q) v: with q_NB, takes v from B to N."""
    w, x, y, z = q
    tx = 2.0 * (y * v[2] - z * v[1])
    ty = 2.0 * (z * v[0] - x * v[2])
    tz = 2.0 * (x * v[1] - y * v[0])
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


@kernel
def rotate_back(q: Quat, v: Vec3) -> Vec3:
    """R(q)ᵀ v: with q_NB, takes v from N to B."""
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


@kernel
def about_x(angle: float) -> Quat:
    return math.cos(0.5 * angle), math.sin(0.5 * angle), 0.0, 0.0


@kernel
def about_y(angle: float) -> Quat:
    return math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0


@kernel
def about_z(angle: float) -> Quat:
    return math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)
