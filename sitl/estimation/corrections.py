"""What each sensor tells the filter: one scalar after the other, so that no matrix is inverted.

A reading that is further off than GATE standard deviations counts less the further it is off (Huber's weights): one
outlier does no harm, and a filter that has gone astray is not locked out of its own sensors.
"""

import math

import numpy as np

from sitl.estimation.error_state import (
    ACCEL,
    ATTITUDE,
    BARO,
    ERRORS,
    GYRO,
    POSITION,
    VELOCITY,
    Array,
    Estimate,
    Tuning,
    flat,
    turned,
)
from sitl.jit import kernel
from sitl.quaternion import Vec3, rotate

GATE = 4.0
_STILL_M_S, _STILL_RAD_S = 0.01, 0.001  # how still a vehicle that stands is taken to be


@kernel
def _fuse(P: Array, dx: Array, at: tuple[int, int, int], h: Vec3, innovation: float, variance: float) -> None:
    """One scalar reading z = h₀ x[at₀] + h₁ x[at₁] + h₂ x[at₂] + noise: `dx` (the errors so far) and flat `P`."""
    n, ph = ERRORS, np.empty(ERRORS)
    for j in range(n):
        ph[j] = h[0] * P[n * at[0] + j] + h[1] * P[n * at[1] + j] + h[2] * P[n * at[2] + j]  # P is symmetric
    left = innovation - (h[0] * dx[at[0]] + h[1] * dx[at[1]] + h[2] * dx[at[2]])
    s = variance + (h[0] * ph[at[0]] + h[1] * ph[at[1]] + h[2] * ph[at[2]])
    s = max(s, abs(left) * math.sqrt(s) / GATE)
    for i in range(n):
        k = ph[i] / s
        dx[i] += k * left
        for j in range(n):
            P[n * i + j] -= k * ph[j]


@kernel
def _fuse_one(P: Array, dx: Array, at: int, innovation: float, variance: float) -> None:
    """A reading of one error itself."""
    _fuse(P, dx, (at, at, at), (1.0, 0.0, 0.0), innovation, variance)


@kernel
def _injected(e: Estimate, dx: Array) -> Estimate:
    """The solution with the errors found taken out of it."""
    P, n = flat(e.covariance), ERRORS
    for i in range(n):  # rounding must not make it lopsided
        for j in range(i):
            P[n * i + j] = P[n * j + i] = 0.5 * (P[n * i + j] + P[n * j + i])
    p, v, bg, ba, rates, force = e.position_N, e.velocity_N, e.gyro_bias, e.accel_bias, e.rates_B, e.force_B
    return Estimate(
        (p[0] + dx[POSITION], p[1] + dx[POSITION + 1], p[2] + dx[POSITION + 2]),
        (v[0] + dx[VELOCITY], v[1] + dx[VELOCITY + 1], v[2] + dx[VELOCITY + 2]),
        turned(e.q_NB, (dx[ATTITUDE], dx[ATTITUDE + 1], dx[ATTITUDE + 2])),
        (bg[0] + dx[GYRO], bg[1] + dx[GYRO + 1], bg[2] + dx[GYRO + 2]),
        (ba[0] + dx[ACCEL], ba[1] + dx[ACCEL + 1], ba[2] + dx[ACCEL + 2]),
        e.baro_offset_m + dx[BARO],
        (rates[0] - dx[GYRO], rates[1] - dx[GYRO + 1], rates[2] - dx[GYRO + 2]),
        (force[0] - dx[ACCEL], force[1] - dx[ACCEL + 1], force[2] - dx[ACCEL + 2]),
        e.covariance,
    )


@kernel
def with_gnss(e: Estimate, t: Tuning, position_N: Vec3, velocity_N: Vec3) -> Estimate:
    """A satellite fix: position [m] and velocity [m/s] in N."""
    P, dx = flat(e.covariance), np.zeros(ERRORS)
    for i in range(3):
        sigma = t.gnss_height_m if i == 2 else t.gnss_level_m
        _fuse_one(P, dx, POSITION + i, position_N[i] - e.position_N[i], sigma * sigma)
        _fuse_one(P, dx, VELOCITY + i, velocity_N[i] - e.velocity_N[i], t.gnss_velocity_m_s**2)
    return _injected(e, dx)


@kernel
def with_baro(e: Estimate, t: Tuning, height_m: float) -> Estimate:
    """The barometer's height above the start [m]; its slowly changing offset is part of the estimate."""
    P, dx, at, h = flat(e.covariance), np.zeros(ERRORS), (POSITION + 2, BARO, BARO), (-1.0, 1.0, 0.0)
    _fuse(P, dx, at, h, height_m + e.position_N[2] - e.baro_offset_m, t.baro_m**2)
    return _injected(e, dx)


@kernel
def with_field(e: Estimate, t: Tuning, field_B: Vec3) -> Estimate:
    """The magnetic field in B: its level direction tells how far the attitude is turned about N's down axis.

    Where the field dips steeply, a tilt about the north axis looks like such a turn, tan(dip) times as large.
    """
    north, east, down = rotate(e.q_NB, field_B)
    steep = down / max(math.sqrt(north * north + east * east), 0.1)
    x, y, z = rotate(e.q_NB, (1.0, 0.0, 0.0)), rotate(e.q_NB, (0.0, 1.0, 0.0)), rotate(e.q_NB, (0.0, 0.0, 1.0))
    P, dx, at = flat(e.covariance), np.zeros(ERRORS), (ATTITUDE, ATTITUDE + 1, ATTITUDE + 2)
    h = (x[2] - steep * x[0], y[2] - steep * y[0], z[2] - steep * z[0])
    _fuse(P, dx, at, h, -math.atan2(east, north), t.heading_rad**2)
    return _injected(e, dx)


@kernel
def at_rest(e: Estimate, t: Tuning, dt_s: float) -> Estimate:
    """A vehicle that stands with its motors off: neither moves nor turns, which shows the gyro's bias.

    dt_s: between two readings of the IMU.
    """
    P, dx = flat(e.covariance), np.zeros(ERRORS)
    reading = t.gyro_noise_rad_s_rtHz**2 / dt_s + _STILL_RAD_S**2
    for i in range(3):
        _fuse_one(P, dx, VELOCITY + i, -e.velocity_N[i], _STILL_M_S**2)
        # the reading with the bias taken off should be zero: what is left of it is bias
        _fuse_one(P, dx, GYRO + i, e.rates_B[i], reading)
    return _injected(e, dx)
