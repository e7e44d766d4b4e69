"""Figures of a flight, summed up in compiled code while it is flown.

A tally is a flat array; `sample` adds the vehicle as it is now, at every tick of the measured flight. Integrals are
trapezoidal: every sample counts whole, and half of the first and of the last is taken off at the end.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.control.reference import Reference
from sitl.jit import kernel
from sitl.model.rigid_body import State
from sitl.quaternion import Vec3

Array = NDArray[np.float64]
TICK_US = 20_000  # of the onboard logic, and between two samples
HIGH_M = 0.5  # a reference higher than this means to be in the air
NOTHING = np.zeros((0, 3))
_NAN: Vec3 = (math.nan, math.nan, math.nan)

# places in the array; errors are |position − reference| of the three axes and of the distance in space
_START_US, _END_US, _COUNT, _SUM, _SQUARES, _MOST, _FIRST, _LAST, _UPRIGHT, _LOWEST, _SIZE = (
    0, 1, 2, 3, 7, 11, 15, 19, 23, 24, 25,
)  # fmt: skip


def tally(start_us: float = math.inf) -> Array:
    """A tally that counts from simulation time `start_us` on, for as long as `end` doesn't say otherwise."""
    x = np.zeros(_SIZE)
    x[_START_US], x[_END_US], x[_UPRIGHT], x[_LOWEST] = start_us, math.inf, 1.0, math.inf
    return x


def end(x: Array, end_us: float) -> None:
    """Count nothing after `end_us`."""
    x[_END_US] = end_us


@kernel
def sample(x: Array, wanted: Array, s: State, reference: Reference, now_us: int) -> None:
    """Count the vehicle now. wanted: (n, 3) where it should be, a place for every tick; empty: at `reference`."""
    if not x[_START_US] <= now_us <= x[_END_US]:
        return
    north, east, down = reference.north_m, reference.east_m, reference.down_m
    if wanted.shape[0] > 0:
        k = min(int(now_us - x[_START_US]) // TICK_US, wanted.shape[0] - 1)
        north, east, down = wanted[k, 0], wanted[k, 1], wanted[k, 2]
    n, e, d = abs(s.north_m - north), abs(s.east_m - east), abs(s.down_m - down)
    errors = (n, e, d, math.sqrt(n * n + e * e + d * d))
    for i in range(4):
        x[_SUM + i] += errors[i]
        x[_SQUARES + i] += errors[i] * errors[i]
        x[_MOST + i] = max(x[_MOST + i], errors[i])
        x[_LAST + i] = errors[i]
        if x[_COUNT] == 0.0:
            x[_FIRST + i] = errors[i]
    x[_COUNT] += 1.0
    x[_UPRIGHT] = min(x[_UPRIGHT], 2.0 * (s.qw * s.qy - s.qx * s.qz))
    if down < -HIGH_M:
        x[_LOWEST] = min(x[_LOWEST], -s.down_m)


class Figures(NamedTuple):
    """Per axis north, east, down, as gcs_tools.metrics has them; the distance in space; NaN where nothing was counted.

    duration_s: of the flight, else from the first sample to the last.
    max_tilt_deg: the largest angle of the nose from straight up.
    least_height_m: above the start, while the reference was higher than HIGH_M.
    """

    duration_s: float
    mae_m: Vec3 = _NAN
    rmse_m: Vec3 = _NAN
    iae_m_s: Vec3 = _NAN
    max_error_m: Vec3 = _NAN
    final_error_m: Vec3 = _NAN
    mean_distance_m: float = math.nan
    max_distance_m: float = math.nan
    max_tilt_deg: float = math.nan
    least_height_m: float = math.nan


def figures(x: Array, duration_s: float = math.nan) -> Figures:
    """What the tally comes to. duration_s: of the flight, where it lasts longer than to the last sample."""
    tick_s = TICK_US * 1e-6
    seconds = (x[_COUNT] - 1.0) * tick_s
    duration = seconds if math.isnan(duration_s) else duration_s
    if seconds <= 0.0:
        return Figures(duration if x[_COUNT] else math.nan)
    first, last = x[_FIRST : _FIRST + 4], x[_LAST : _LAST + 4]
    held = duration - seconds  # the last sample stands for what comes after it
    iae = tick_s * (x[_SUM : _SUM + 4] - 0.5 * (first + last)) + held * last
    squares = tick_s * (x[_SQUARES : _SQUARES + 4] - 0.5 * (first**2 + last**2)) + held * last**2
    most = x[_MOST : _MOST + 4]
    return Figures(
        float(duration),
        _vec(iae / duration),
        _vec(np.sqrt(np.maximum(squares, 0.0) / duration)),
        _vec(iae),
        _vec(most),
        _vec(last),
        float(iae[3] / duration),
        float(most[3]),
        math.degrees(math.acos(max(-1.0, min(1.0, x[_UPRIGHT])))),
        float(x[_LOWEST]) if x[_LOWEST] < math.inf else math.nan,
    )


def _vec(values: Array) -> Vec3:
    return float(values[0]), float(values[1]), float(values[2])
