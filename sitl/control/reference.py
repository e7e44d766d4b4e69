"""Reference trajectories: piecewise polynomials of time in north, east, down and heading."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.jit import kernel

DEGREE = 5


class Trajectory(NamedTuple):
    """Piecewise polynomials; the only form in which a reference reaches the cascade.

    start_s: (n,) start of each segment in simulation seconds, ascending.
    coefficients: (n, 4, 6) per segment and axis (north, east, down in m, heading in rad) the coefficients of
        (t - start)**k, k = 0..5, k ascending.
    end_s: after it the reference rests where it is then (velocity, acceleration, jerk zero). inf: never.
    Before start_s[0] the reference rests at the first segment's start.
    """

    start_s: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    end_s: float


class Reference(NamedTuple):
    """A trajectory at one instant (m, s, rad; NED)."""

    north_m: float
    east_m: float
    down_m: float
    v_north_m_s: float
    v_east_m_s: float
    v_down_m_s: float
    a_north_m_s2: float
    a_east_m_s2: float
    a_down_m_s2: float
    j_north_m_s3: float
    j_east_m_s3: float
    j_down_m_s3: float
    heading_rad: float
    heading_rate_rad_s: float


@kernel
def _evaluate(c: NDArray[np.float64], t: float) -> tuple[float, float, float, float]:
    """Value and first three derivatives of one axis' polynomial (Horner)."""
    x = ((((c[5] * t + c[4]) * t + c[3]) * t + c[2]) * t + c[1]) * t + c[0]
    v = (((5.0 * c[5] * t + 4.0 * c[4]) * t + 3.0 * c[3]) * t + 2.0 * c[2]) * t + c[1]
    a = ((20.0 * c[5] * t + 12.0 * c[4]) * t + 6.0 * c[3]) * t + 2.0 * c[2]
    j = (60.0 * c[5] * t + 24.0 * c[4]) * t + 6.0 * c[3]
    return x, v, a, j


@kernel
def sample(trajectory: Trajectory, t_s: float) -> Reference:
    """The trajectory at simulation time t_s."""
    start = trajectory.start_s
    first, k = 0, start.shape[0] - 1
    while first < k:
        middle = (first + k + 1) // 2
        if t_s < start[middle]:
            k = middle - 1
        else:
            first = middle
    resting = t_s < start[0] or t_s >= trajectory.end_s
    t = max(min(t_s, trajectory.end_s) - start[k], 0.0)
    c = trajectory.coefficients[k]
    n, vn, an, jn = _evaluate(c[0], t)
    e, ve, ae, je = _evaluate(c[1], t)
    d, vd, ad, jd = _evaluate(c[2], t)
    h, vh, _, _ = _evaluate(c[3], t)
    if resting:
        return Reference(n, e, d, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, h, 0.0)
    return Reference(n, e, d, vn, ve, vd, an, ae, ad, jn, je, jd, h, vh)


def rest_at(north_m: float, east_m: float, down_m: float, heading_rad: float) -> Trajectory:
    """The trajectory that stays at one point."""
    coefficients = np.zeros((1, 4, DEGREE + 1))
    coefficients[0, :, 0] = (north_m, east_m, down_m, heading_rad)
    return Trajectory(np.zeros(1), coefficients, 0.0)
