"""Bandwidth and margins of a loop from its open-loop frequency response."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_HALF_POWER = math.sqrt(0.5)


class Margins(NamedTuple):
    """crossover: the highest frequency at which |L| = 1. bandwidth: where |L / (1 + L)| falls below −3 dB for good.

    gain_up, gain_down: the factors by which the gain can grow and shrink before the loop is lost (∞ and 0: never).
    phase: the least distance to −180° at any |L| = 1. sensitivity: the greatest |1 / (1 + L)|.
    """

    crossover_rad_s: float
    bandwidth_rad_s: float
    gain_up: float
    gain_down: float
    phase_deg: float
    sensitivity: float


def response(M: Array, b: Array, c: Array, dt_s: float, frequency_rad_s: Array) -> Complex:
    """c (e^{jωh} I − M)⁻¹ b over ω."""
    z = np.exp(1j * frequency_rad_s * dt_s)
    system = z[:, np.newaxis, np.newaxis] * np.eye(M.shape[0]) - M
    states = np.linalg.solve(system, np.broadcast_to(b[:, np.newaxis], (z.size, b.size, 1)).astype(complex))
    through: Complex = states[..., 0] @ c.astype(complex)
    return through


def _where(values: Array) -> NDArray[np.intp]:
    """Indices i with a change of sign between i and i + 1."""
    return np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:]))


def _share(values: Array, i: NDArray[np.intp]) -> Array:
    """How far between i and i + 1 the linear interpolation of `values` is zero."""
    share: Array = values[i] / (values[i] - values[i + 1])
    return share


def margins(frequency_rad_s: Array, loop: Complex) -> Margins:
    """Of the open loop L(jω) with negative feedback 1 / (1 + L), on a grid fine enough to interpolate in."""
    log_w, log_gain = np.log(frequency_rad_s), np.log(np.abs(loop))
    phase = np.unwrap(np.angle(loop))

    at = _where(log_gain)
    share = _share(log_gain, at)
    crossings = np.exp(log_w[at] + share * (log_w[at + 1] - log_w[at]))
    phases = phase[at] + share * (phase[at + 1] - phase[at])
    distance = np.abs((phases + 2.0 * math.pi) % (2.0 * math.pi) - math.pi)

    # −180° modulo 360°: the imaginary part changes sign left of the origin
    turns = _where(loop.imag)
    turns = turns[loop.real[turns] < 0.0]
    share = _share(loop.imag, turns)
    there = np.exp(log_gain[turns] + share * (log_gain[turns + 1] - log_gain[turns]))
    complementary = np.abs(loop / (1.0 + loop))
    below = _where(complementary - _HALF_POWER)
    return Margins(
        float(crossings.max(initial=0.0)),
        float(frequency_rad_s[below[-1]]) if below.size else math.nan,
        float(1.0 / there[there < 1.0].max(initial=0.0)) if np.any(there < 1.0) else math.inf,
        float(1.0 / there[there > 1.0].min(initial=math.inf)) if np.any(there > 1.0) else 0.0,
        float(np.degrees(distance.min(initial=math.pi))),
        float((1.0 / np.abs(1.0 + loop)).max()),
    )
