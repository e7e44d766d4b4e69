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
    turned,
)
from sitl.jit import kernel
from sitl.quaternion import Vec3, rotate

GATE = 4.0
_STILL_M_S, _STILL_RAD_S = 0.01, 0.001  # how still a vehicle that stands is taken to be


@kernel
def _fuse(P: Array, dx: Array, h: Array, innovation: float, variance: float) -> None:
    """One scalar reading z = h·x + noise: `dx` (the errors found so far) and `P`, in place."""
    ph, predicted, s = np.empty(ERRORS), 0.0, variance
    for i in range(ERRORS):
        total = 0.0
        for j in range(ERRORS):
            if h[j] != 0.0:
                total += P[i, j] * h[j]
        ph[i] = total
        predicted += h[i] * dx[i]
    for i in range(ERRORS):
        s += h[i] * ph[i]
    left = innovation - predicted
    s = max(s, abs(left) * math.sqrt(s) / GATE)
    for i in range(ERRORS):
        k = ph[i] / s
        dx[i] += k * left
        for j in range(ERRORS):
            P[i, j] -= k * ph[j]


@kernel
def _axis(h: Array, index: int) -> Array:
    h[:] = 0.0
    h[index] = 1.0
    return h


@kernel
def _injected(e: Estimate, dx: Array) -> Estimate:
    """The solution with the errors found taken out of it."""
    P = e.covariance
    for i in range(ERRORS):  # rounding must not make it lopsided
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
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
        P,
    )


@kernel
def with_gnss(e: Estimate, t: Tuning, position_N: Vec3, velocity_N: Vec3) -> Estimate:
    """A satellite fix: position [m] and velocity [m/s] in N."""
    dx, h = np.zeros(ERRORS), np.empty(ERRORS)
    for i in range(3):
        sigma = t.gnss_height_m if i == 2 else t.gnss_level_m
        _fuse(e.covariance, dx, _axis(h, POSITION + i), position_N[i] - e.position_N[i], sigma * sigma)
        _fuse(e.covariance, dx, _axis(h, VELOCITY + i), velocity_N[i] - e.velocity_N[i], t.gnss_velocity_m_s**2)
    return _injected(e, dx)


@kernel
def with_baro(e: Estimate, t: Tuning, height_m: float) -> Estimate:
    """The barometer's height above the start [m]; its slowly changing offset is part of the estimate."""
    dx, h = np.zeros(ERRORS), np.zeros(ERRORS)
    h[POSITION + 2], h[BARO] = -1.0, 1.0
    _fuse(e.covariance, dx, h, height_m + e.position_N[2] - e.baro_offset_m, t.baro_m**2)
    return _injected(e, dx)


@kernel
def with_field(e: Estimate, t: Tuning, field_B: Vec3) -> Estimate:
    """The magnetic field in B: its level direction tells how far the attitude is turned about N's down axis.

    Where the field dips steeply, a tilt about the north axis looks like such a turn, tan(dip) times as large.
    """
    north, east, down = rotate(e.q_NB, field_B)
    steep = down / max(math.sqrt(north * north + east * east), 0.1)
    dx, h = np.zeros(ERRORS), np.zeros(ERRORS)
    for i in range(3):
        axis = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
        turned_N = rotate(e.q_NB, axis)
        h[ATTITUDE + i] = turned_N[2] - steep * turned_N[0]
    _fuse(e.covariance, dx, h, -math.atan2(east, north), t.heading_rad**2)
    return _injected(e, dx)


@kernel
def at_rest(e: Estimate, t: Tuning, dt_s: float) -> Estimate:
    """A vehicle that stands with its motors off: neither moves nor turns, which shows the gyro's bias.

    dt_s: between two readings of the IMU.
    """
    dx, h = np.zeros(ERRORS), np.empty(ERRORS)
    reading = t.gyro_noise_rad_s_rtHz**2 / dt_s + _STILL_RAD_S**2
    for i in range(3):
        _fuse(e.covariance, dx, _axis(h, VELOCITY + i), -e.velocity_N[i], _STILL_M_S**2)
        # the reading with the bias taken off should be zero: what is left of it is bias
        _fuse(e.covariance, dx, _axis(h, GYRO + i), e.rates_B[i], reading)
    return _injected(e, dx)
