"""What a control engineer reads off a step response.

Everything is relative to the step: of size A from a reference at rest r₀ to r₀ + A, at t = 0. Errors are reference
minus output. Times in s from the step; integrals are trapezoidal.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LAST_SHARE = 0.2  # of the record, over which the steady state is taken
BAND = 0.02  # of the step's size, within which the output counts as settled


class TooFewSamplesError(ValueError):
    """The record of a step is too thin to be measured."""


class StepFigures(NamedTuple):
    """rise_s: from 10 to 90 % of the step. settling_s: from when on the output stays within the band. Both are NaN
    where the output doesn't get there within the record. peak_s: when the output is furthest.

    overshoot: beyond the new reference, as a share of the step; 0 where it never goes beyond. steady_error: mean over
    the last fifth. iae, itae: ∫|e| dt and ∫ t|e| dt, in the output's unit times s and s².
    """

    rise_s: float
    overshoot: float
    peak_s: float
    settling_s: float
    steady_error: float
    iae: float
    itae: float


class Effort(NamedTuple):
    """What a response asks of the actuators, each counted as a share of its range (motor 0 … 1, flap −1 … 1).

    energy_s: ∫ Σ (u − u₀)² dt, u₀ being where they were before the step. travel_1_s: mean over the record of Σ |du/dt|,
    which tells nervous actuators from busy ones.
    """

    energy_s: float
    travel_1_s: float


def step_figures(t_s: Array, output: Array, start: float, size: float, band: float = BAND) -> StepFigures:
    """Of a record that begins with the step, from the reference `start` to `start` + `size`."""
    if t_s.size < 3:
        raise TooFewSamplesError("too few samples came from the vehicle to measure the step")
    y = (output - start) / size
    error = np.abs(1.0 - y)
    tenth, nine_tenths = _first_crossing(t_s, y, 0.1), _first_crossing(t_s, y, 0.9)
    last = t_s >= t_s[-1] - LAST_SHARE * (t_s[-1] - t_s[0])
    return StepFigures(
        rise_s=nine_tenths - tenth,
        overshoot=max(0.0, float(y.max()) - 1.0),
        peak_s=float(t_s[np.argmax(y)]),
        settling_s=_last_crossing(t_s, error, band),
        steady_error=float(np.mean(start + size - output[last])),
        iae=abs(size) * _integral(error, t_s),
        itae=abs(size) * _integral(t_s * error, t_s),
    )


def effort(t_s: Array, actuators: Array, before: Array) -> Effort:
    """Of actuators (n, m) over a record; before: (m,) where they stood. NaN where nothing was heard of them."""
    if t_s.size < 2:
        return Effort(float("nan"), float("nan"))
    away = np.sum((actuators - before) ** 2, axis=1)
    travel = float(np.abs(np.diff(actuators, axis=0)).sum())
    return Effort(_integral(away, t_s), travel / float(t_s[-1] - t_s[0]))


def _integral(values: Array, t_s: Array) -> float:
    return float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(t_s)))


def _first_crossing(t_s: Array, y: Array, level: float) -> float:
    """When y first reaches the level, interpolated between samples; NaN: never."""
    above = np.flatnonzero(y >= level)
    if not above.size:
        return float("nan")
    k = int(above[0])
    if k == 0:
        return float(t_s[0])
    share = (level - y[k - 1]) / (y[k] - y[k - 1])
    return float(t_s[k - 1] + share * (t_s[k] - t_s[k - 1]))


def _last_crossing(t_s: Array, error: Array, band: float) -> float:
    """From when on the error stays within the band; NaN where it is outside at the end."""
    outside = np.flatnonzero(error > band)
    if not outside.size:
        return float(t_s[0])
    k = int(outside[-1])
    if k == error.size - 1:
        return float("nan")
    share = (error[k] - band) / (error[k] - error[k + 1])
    return float(t_s[k] + share * (t_s[k + 1] - t_s[k]))


def as_dict(*groups: Any) -> dict[str, float | None]:
    """The figures by name, NaN as null."""
    return {
        name: None if np.isnan(value) else float(value) for group in groups for name, value in group._asdict().items()
    }
