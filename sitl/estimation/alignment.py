"""Where the filter starts: standing at N's origin, its attitude from gravity and the magnetic field."""

import math

import numpy as np

from sitl.estimation.error_state import ACCEL, ATTITUDE, BARO, ERRORS, GYRO, POSITION, VELOCITY, Estimate
from sitl.quaternion import Quat, Vec3

# standard deviations of what an alignment leaves
_START = ((POSITION, 0.02), (VELOCITY, 0.02), (ATTITUDE, 0.02), (GYRO, 0.01), (ACCEL, 0.05), (BARO, 0.5))


def _unit(v: Vec3) -> Vec3:
    k = 1.0 / math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return k * v[0], k * v[1], k * v[2]


def _cross(a: Vec3, b: Vec3) -> Vec3:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def attitude_from(force_B: Vec3, field_B: Vec3) -> Quat:
    """q_NB of a vehicle at rest from its specific force [m/s²] and the magnetic field (TRIAD: Black 1964)."""
    down = _unit((-force_B[0], -force_B[1], -force_B[2]))
    east = _unit(_cross(down, field_B))
    north = _cross(east, down)
    # the largest of the four squares first, so that nothing is divided by little (Shepperd 1978)
    trace = north[0] + east[1] + down[2]
    squares = (trace, north[0], east[1], down[2])
    k = squares.index(max(squares))
    if k == 0:
        q = (1.0 + trace, down[1] - east[2], north[2] - down[0], east[0] - north[1])
    elif k == 1:
        q = (down[1] - east[2], 1.0 + 2.0 * north[0] - trace, north[1] + east[0], north[2] + down[0])
    elif k == 2:
        q = (north[2] - down[0], north[1] + east[0], 1.0 + 2.0 * east[1] - trace, east[2] + down[1])
    else:
        q = (east[0] - north[1], north[2] + down[0], east[2] + down[1], 1.0 + 2.0 * down[2] - trace)
    n = 1.0 / math.sqrt(sum(c * c for c in q))
    return n * q[0], n * q[1], n * q[2], n * q[3]


def starting(position_N: Vec3, velocity_N: Vec3, q_NB: Quat, rates_B: Vec3, force_B: Vec3) -> Estimate:
    """An estimate that begins at the given motion, with the uncertainty of an alignment on the ground."""
    covariance = np.zeros((ERRORS, ERRORS))
    for first, sigma in _START:
        for i in range(first, min(first + 3, ERRORS)):
            covariance[i, i] = sigma * sigma
    zero = (0.0, 0.0, 0.0)
    return Estimate(position_N, velocity_N, q_NB, zero, zero, 0.0, rates_B, force_B, covariance)


def aligned(force_B: Vec3, field_B: Vec3) -> Estimate:
    """The estimate of a vehicle that stands at the origin."""
    zero = (0.0, 0.0, 0.0)
    return starting(zero, zero, attitude_from(force_B, field_B), zero, force_B)
