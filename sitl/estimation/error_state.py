"""An error-state Kalman filter: the vehicle's motion from IMU, satellite receiver, barometer and magnetometer.

The IMU is integrated in full every control step (strapdown); the filter's covariance is that of the small errors of
this solution. The attitude error is a rotation vector in B, q = q̂ ⊗ exp(δθ/2) (Solà, Quaternion kinematics for the
error-state Kalman filter, 2017, ch. 5 and 6).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.frames import GRAVITY_M_S2
from sitl.jit import kernel
from sitl.navigation import NavState
from sitl.quaternion import Quat, Vec3, multiply, rotate

Array = NDArray[np.float64]
ERRORS = 16
POSITION, VELOCITY, ATTITUDE, GYRO, ACCEL, BARO = 0, 3, 6, 9, 12, 15  # where each error stands; the last three: biases
_BARO_DRIFT = 0.02  # m/√s: what weather and heat do to the barometer's zero


class Tuning(NamedTuple):
    """What the filter believes of its sensors: white noise as density or per reading, and walks of the biases."""

    gyro_noise_rad_s_rtHz: float
    accel_noise_m_s2_rtHz: float
    gyro_walk_rad_s2_rtHz: float
    accel_walk_m_s3_rtHz: float
    gnss_level_m: float
    gnss_height_m: float
    gnss_velocity_m_s: float
    baro_m: float
    heading_rad: float


class Estimate(NamedTuple):
    """The solution, its covariance (ERRORS, ERRORS), and the IMU reading (biases taken off) up to which it goes."""

    position_N: Vec3
    velocity_N: Vec3
    q_NB: Quat
    gyro_bias: Vec3
    accel_bias: Vec3
    baro_offset_m: float
    rates_B: Vec3
    force_B: Vec3
    covariance: Array


@kernel
def copied(e: Estimate) -> Estimate:
    """The same with a covariance of its own."""
    return Estimate(
        e.position_N, e.velocity_N, e.q_NB, e.gyro_bias, e.accel_bias, e.baro_offset_m, e.rates_B, e.force_B,
        e.covariance.copy(),
    )  # fmt: skip


@kernel
def _normalised(q: Quat) -> Quat:
    k = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return k * q[0], k * q[1], k * q[2], k * q[3]


@kernel
def turned(q_NB: Quat, angle_B: Vec3) -> Quat:
    """q ⊗ exp(angle/2): `q_NB` turned by a small rotation vector [rad] in B."""
    x, y, z = 0.5 * angle_B[0], 0.5 * angle_B[1], 0.5 * angle_B[2]
    square = x * x + y * y + z * z
    # sine and cosine of the half angle to the fourth order: 1e-13 at 0.02 rad, what 10 rad/s turn in a step of 2 ms
    c, s = 1.0 - 0.5 * square * (1.0 - square / 12.0), 1.0 - square / 6.0
    return _normalised(multiply(q_NB, (c, s * x, s * y, s * z)))


@kernel
def _middle(a: Vec3, b: Vec3) -> Vec3:
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


@kernel
def predicted(e: Estimate, gyro_rad_s: Vec3, accel_m_s2: Vec3, dt_s: float) -> Estimate:
    """The solution one IMU reading later (trapezoidal between the last reading and this one)."""
    bg, ba = e.gyro_bias, e.accel_bias
    rates = (gyro_rad_s[0] - bg[0], gyro_rad_s[1] - bg[1], gyro_rad_s[2] - bg[2])
    force = (accel_m_s2[0] - ba[0], accel_m_s2[1] - ba[1], accel_m_s2[2] - ba[2])
    w = _middle(e.rates_B, rates)
    q = turned(e.q_NB, (w[0] * dt_s, w[1] * dt_s, w[2] * dt_s))
    an, ae, ad = _middle(rotate(e.q_NB, e.force_B), rotate(q, force))
    ad += GRAVITY_M_S2
    p, v, h = e.position_N, e.velocity_N, 0.5 * dt_s * dt_s
    return Estimate(
        (
            p[0] + v[0] * dt_s + h * an,
            p[1] + v[1] * dt_s + h * ae,
            p[2] + v[2] * dt_s + h * ad,
        ),
        (v[0] + an * dt_s, v[1] + ae * dt_s, v[2] + ad * dt_s),
        q, bg, ba, e.baro_offset_m, rates, force, e.covariance,
    )  # fmt: skip


@kernel
def _cross(a: Vec3, b: Vec3) -> Vec3:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def flat(P: Array) -> Array:
    """The covariance row after row: with a row's length in its indices, compiled code works on a whole row at once."""
    return P.reshape(ERRORS * ERRORS)


@kernel
def _advanced(P: Array, tilting: tuple[Vec3, Vec3, Vec3], R: tuple[Vec3, Vec3, Vec3], w: Vec3, dt_s: float) -> None:
    """P ← F P, P flat: rows added to others, so that the places where F is 0 or 1 cost nothing. tilting: −R [f]×."""
    n = ERRORS
    for j in range(n):
        x, y, z = P[n * ATTITUDE + j], P[n * (ATTITUDE + 1) + j], P[n * (ATTITUDE + 2) + j]
        for i in range(3):
            a, b = tilting[i], R[i]
            gained = dt_s * (
                a[0] * x + a[1] * y + a[2] * z
                - b[0] * P[n * ACCEL + j] - b[1] * P[n * (ACCEL + 1) + j] - b[2] * P[n * (ACCEL + 2) + j]
            )  # fmt: skip
            P[n * (POSITION + i) + j] += dt_s * (P[n * (VELOCITY + i) + j] + 0.5 * gained)
            P[n * (VELOCITY + i) + j] += gained
        P[n * ATTITUDE + j] -= dt_s * (w[1] * z - w[2] * y + P[n * GYRO + j])
        P[n * (ATTITUDE + 1) + j] -= dt_s * (w[2] * x - w[0] * z + P[n * (GYRO + 1) + j])
        P[n * (ATTITUDE + 2) + j] -= dt_s * (w[0] * y - w[1] * x + P[n * (GYRO + 2) + j])


@kernel
def spread(e: Estimate, t: Tuning, dt_s: float) -> None:
    """The covariance `dt_s` later, in place: P ← F P Fᵀ + Q, where F P Fᵀ = F (F P)ᵀ as P is symmetric.

    δṗ = δv, δv̇ = −R [f]× δθ − R δb_a, δθ̇ = −[ω]× δθ − δb_g, to the first order in dt and the second for δp.
    """
    P, f, n = flat(e.covariance), e.force_B, ERRORS
    x, y, z = rotate(e.q_NB, (1.0, 0.0, 0.0)), rotate(e.q_NB, (0.0, 1.0, 0.0)), rotate(e.q_NB, (0.0, 0.0, 1.0))
    R = ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))
    tilting = (_cross(f, R[0]), _cross(f, R[1]), _cross(f, R[2]))  # row r of −R [f]× is f × r
    _advanced(P, tilting, R, e.rates_B, dt_s)
    for i in range(n):
        for j in range(i):
            P[n * i + j], P[n * j + i] = P[n * j + i], P[n * i + j]
    _advanced(P, tilting, R, e.rates_B, dt_s)
    for i in range(3):
        P[(n + 1) * (VELOCITY + i)] += t.accel_noise_m_s2_rtHz**2 * dt_s
        P[(n + 1) * (ATTITUDE + i)] += t.gyro_noise_rad_s_rtHz**2 * dt_s
        P[(n + 1) * (GYRO + i)] += t.gyro_walk_rad_s2_rtHz**2 * dt_s
        P[(n + 1) * (ACCEL + i)] += t.accel_walk_m_s3_rtHz**2 * dt_s
    P[(n + 1) * BARO] += _BARO_DRIFT**2 * dt_s


@kernel
def nav_of(e: Estimate) -> NavState:
    """What the controllers see of it."""
    p, v, q, w = e.position_N, e.velocity_N, e.q_NB, e.rates_B
    return NavState(p[0], p[1], p[2], v[0], v[1], v[2], q[0], q[1], q[2], q[3], w[0], w[1], w[2])
