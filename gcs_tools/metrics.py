"""How well a flight followed its reference: the figures of the paper's section V.

Errors are measured minus reference, metres, north-east-down, each at the time the sample itself carries. Integrals are
trapezoidal over time, so uneven or missing samples carry the weight of the time they stand for.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools.reference import Vector

Array = NDArray[np.float64]
AIRBORNE_M = 0.05  # above the start; below it the angles and thrust are those of a vehicle that stands


class Track(NamedTuple):
    """What was recorded of a flight, times in seconds from its start on the vehicle's clock.

    The attitude (paper's φ, θ, ψ), thrust and flap series have their own times; they are sent less often.
    """

    t_s: Array  # (n,)
    reference_m: Array  # (n, 3)
    position_m: Array  # (n, 3)
    angles: Array  # (k, 4) t_s, φ, θ, ψ in degrees
    thrust: Array  # (k, 2) t_s, total in N
    flaps: Array  # (k, 3) t_s, left, right in degrees


class KeyPoint(NamedTuple):
    t_s: float
    target: Vector
    error: Vector


class Metrics(NamedTuple):
    """Per axis north, east, down. mae, rmse, max_overshoot, final_error in m; iae in m·s."""

    mae: Vector
    rmse: Vector
    iae: Vector
    max_overshoot: Vector  # the largest |error|
    final_error: Vector  # |error| at the end
    waypoints: tuple[KeyPoint, ...]
    ranges: dict[str, list[float] | None]  # least and greatest while airborne; None if never heard
    largest_gap_s: float  # between two samples: how much of the flight went unseen


class TooFewSamplesError(ValueError):
    pass


def evaluate(track: Track, duration_s: float, key_points: Sequence[tuple[float, Vector | None]] = ()) -> Metrics:
    """The figures over 0 ≤ t ≤ duration_s. A key point without a target takes the reference of its instant."""
    t, error = _window(track.t_s, track.position_m - track.reference_m, duration_s)
    size = np.abs(error)
    iae = _integral(size, t)
    return Metrics(
        mae=_vector(iae / duration_s),
        rmse=_vector(np.sqrt(_integral(error**2, t) / duration_s)),
        iae=_vector(iae),
        max_overshoot=_vector(size.max(axis=0)),
        final_error=_vector(size[-1]),
        waypoints=tuple(
            KeyPoint(
                at_s,
                _vector(_interpolate(at_s, track.t_s, track.reference_m)) if target is None else target,
                _vector(_interpolate(at_s, t, error)),
            )
            for at_s, target in key_points
        ),
        ranges=_ranges(track, duration_s),
        largest_gap_s=float(np.diff(t).max()),
    )


def _integral(values: Array, t: Array) -> Array:
    """∫ values dt by the trapezoid rule, per column."""
    total: Array = np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(t)[:, np.newaxis], axis=0)
    return total


def _window(t: Array, values: Array, duration_s: float) -> tuple[Array, Array]:
    """The samples in 0..duration_s, with both ends filled in: interpolated, or held where the record stops short."""
    inside = (t > 0.0) & (t < duration_s)
    if t.size < 2 or np.count_nonzero(inside) < 2:
        raise TooFewSamplesError("too few position samples came from the vehicle to measure the flight")
    ends = [_interpolate(at, t, values) for at in (0.0, duration_s)]
    return (
        np.concatenate(([0.0], t[inside], [duration_s])),
        np.vstack((ends[0], values[inside], ends[1])),
    )


def _interpolate(at_s: float, t: Array, values: Array) -> Array:
    return np.array([np.interp(at_s, t, values[:, k]) for k in range(values.shape[1])])


def _vector(values: Array) -> Vector:
    x, y, z = (float(v) for v in values)
    return x, y, z


def _ranges(track: Track, duration_s: float) -> dict[str, list[float] | None]:
    return {
        "roll_deg": _range(track, duration_s, track.angles, (1,)),
        "pitch_deg": _range(track, duration_s, track.angles, (2,)),
        "yaw_deg": _range(track, duration_s, track.angles, (3,)),
        "thrust_N": _range(track, duration_s, track.thrust, (1,)),
        "flap_deg": _range(track, duration_s, track.flaps, (1, 2)),
    }


def _range(track: Track, duration_s: float, series: Array, columns: tuple[int, ...]) -> list[float] | None:
    """Least and greatest of some columns of a series while the vehicle was off the ground."""
    if series.shape[0] == 0:
        return None
    t = series[:, 0]
    height = -np.interp(t, track.t_s, track.position_m[:, 2])
    chosen = series[(t >= 0.0) & (t <= duration_s) & (height > AIRBORNE_M)][:, columns]
    return [float(chosen.min()), float(chosen.max())] if chosen.size else None


def distance(track: Track, duration_s: float) -> tuple[float, float]:
    """(mean, greatest) distance from the reference in space over 0 ≤ t ≤ duration_s [m]."""
    t, error = _window(track.t_s, track.position_m - track.reference_m, duration_s)
    away = np.sqrt(np.sum(error**2, axis=1, keepdims=True))
    return float(_integral(away, t)[0] / duration_s), float(away.max())


def report(mission: str, vehicle: str | None, duration_s: float, m: Metrics, real_time_factor: float) -> dict[str, Any]:
    """The one JSON object that a measured flight comes to."""
    return {
        "mission": mission,
        "vehicle": vehicle,
        "duration_s": round(duration_s, 3),
        "mae": _rounded(m.mae),
        "rmse": _rounded(m.rmse),
        "iae": _rounded(m.iae),
        "max_overshoot": _rounded(m.max_overshoot),
        "final_error": _rounded(m.final_error),
        "waypoints": [
            {"t_s": round(w.t_s, 3), "target": _rounded(w.target), "error": _rounded(w.error)} for w in m.waypoints
        ],
        "ranges": {name: _rounded(pair, 3) if pair else None for name, pair in m.ranges.items()},
        "real_time_factor": round(real_time_factor, 2),
    }


def _rounded(values: Sequence[float], digits: int = 6) -> list[float]:
    return [round(v, digits) + 0.0 for v in values]
