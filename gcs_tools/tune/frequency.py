"""The closed loop's frequency response from records of steps and doublets.

Each record begins and ends with the loop at rest. Reference r and output y are differenced, so that a step becomes an
impulse, which excites every frequency alike, and an offset drops out; the last quarter fades away along a half cosine,
so that what has not quite settled leaks less. With R and Y the Fourier transforms of what is left, over all records,

    H(jω) = Σ R* Y / Σ |R|²,   coherence γ² = |Σ R* Y|² / (Σ |R|² Σ |Y|²)

(the H1 estimate of Bendat and Piersol, Random Data: unbiased by noise on y). Frequencies begin with a quarter of a
period in the time from the first edge to the end, and are left out where the excitation has little of them. They end
where the records contradict each other (γ² < 0.8, with two records or more) or where little of the excitation comes
through (|H| < 0.03). The open loop, as seen from the error, is L = H / (1 − H): its margins are sitl.margins'.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.margins import Margins, margins

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
POINTS_PER_DECADE = 30
_PERIODS = 0.25  # in the record, of the lowest frequency
_FADE_SHARE = 0.25
_EXCITED = 0.3  # of the greatest |R|
_COHERENT = 0.8
_THROUGH = 0.03
_HALF_POWER = math.sqrt(0.5)
_NYQUIST_SHARE = 0.4  # of the sampling frequency
_DISTINCT = 1e-6  # |1 − H| below which the open loop can't be told


class Record(NamedTuple):
    """t_s: (n,) evenly spaced, the first edge at 0; reference and output: (n,)."""

    t_s: Array
    reference: Array
    output: Array


class FrequencyResponse(NamedTuple):
    """frequency_rad_s: (m,) rising. response: (m,) complex. coherence: (m,), 1 where there is only one record."""

    frequency_rad_s: Array
    response: Complex
    coherence: Array

    @property
    def gain_dB(self) -> Array:
        gain: Array = 20.0 * np.log10(np.abs(self.response))
        return gain

    @property
    def phase_deg(self) -> Array:
        phase: Array = np.degrees(np.unwrap(np.angle(self.response)))
        return phase


class ClosedLoop(NamedTuple):
    """bandwidth_rad_s: the lowest frequency at which |H| falls through −3 dB. peak_dB: the greatest |H|, at peak_rad_s.

    crossover_rad_s, phase_margin_deg, gain_margin_dB: of L = H / (1 − H). NaN: not within the frequencies told.
    """

    bandwidth_rad_s: float
    phase_at_bandwidth_deg: float
    peak_dB: float
    peak_rad_s: float
    crossover_rad_s: float
    phase_margin_deg: float
    gain_margin_dB: float


UNKNOWN = ClosedLoop(*(math.nan,) * 7)
NOTHING = FrequencyResponse(np.zeros(0), np.zeros(0, complex), np.zeros(0))


def evenly(t_s: Array, reference: Array, output: Array) -> Record:
    """Samples as they came, times rising and 0 at the first edge, on an even grid: the reference held, the output
    interpolated.
    """
    step = float(np.median(np.diff(t_s)))
    grid = t_s[0] + step * np.arange(int((t_s[-1] - t_s[0]) / step) + 1)
    held = np.clip(np.searchsorted(t_s, grid + 1e-9, side="right") - 1, 0, t_s.size - 1)
    return Record(grid, reference[held], np.interp(grid, t_s, output))


def estimate(records: Sequence[Record]) -> FrequencyResponse:
    """H over the frequencies that these records tell; NOTHING where there are none."""
    first = records[0]
    dt = float(first.t_s[1] - first.t_s[0])
    lowest = 2.0 * math.pi * _PERIODS / max(float(first.t_s[-1]), dt)
    highest = 2.0 * math.pi * _NYQUIST_SHARE / dt
    if highest <= lowest:
        return NOTHING
    w = np.geomspace(lowest, highest, max(2, round(POINTS_PER_DECADE * math.log10(highest / lowest))))
    cross, excitation, answer = np.zeros(w.size, complex), np.zeros(w.size), np.zeros(w.size)
    for record in records:
        R, Y = (_transform(record.t_s, x, w) for x in (record.reference, record.output))
        cross += np.conj(R) * Y
        excitation += np.abs(R) ** 2
        answer += np.abs(Y) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        H, coherence = cross / excitation, np.abs(cross) ** 2 / (excitation * answer)
    told = excitation > _EXCITED**2 * excitation.max()
    w, H, coherence = w[told], H[told], coherence[told]
    bad = np.flatnonzero((coherence < _COHERENT) | (np.abs(H) < _THROUGH) | ~np.isfinite(H))
    end = int(bad[0]) if bad.size else w.size
    return FrequencyResponse(w[:end], H[:end], coherence[:end])


def _transform(t_s: Array, x: Array, w: Array) -> Complex:
    """Of the differences of x, the end faded out."""
    t, dx = t_s[1:], np.diff(x)
    start = t[-1] - _FADE_SHARE * (t[-1] - t[0])
    fade = np.where(t < start, 1.0, 0.5 + 0.5 * np.cos(np.pi * (t - start) / max(t[-1] - start, 1e-12)))
    moves = np.flatnonzero(dx)
    result: Complex = np.exp(-1j * np.outer(w, t[moves])) @ (dx * fade)[moves].astype(complex)
    return result


def closed_loop(f: FrequencyResponse) -> ClosedLoop:
    """What a response comes to in numbers."""
    w, H = f.frequency_rad_s, f.response
    if w.size < 3:
        return UNKNOWN
    gain, phase = np.abs(H), f.phase_deg
    top = int(np.argmax(gain))
    below = np.flatnonzero((gain[:-1] >= _HALF_POWER) & (gain[1:] < _HALF_POWER))
    bandwidth = at_bandwidth = math.nan
    if below.size:
        k = int(below[0])
        share = math.log(gain[k] / _HALF_POWER) / math.log(gain[k] / gain[k + 1])
        bandwidth = float(w[k] * (w[k + 1] / w[k]) ** share)
        at_bandwidth = float(phase[k] + share * (phase[k + 1] - phase[k]))
    m = _open_loop(w, H)
    return ClosedLoop(
        bandwidth_rad_s=bandwidth,
        phase_at_bandwidth_deg=at_bandwidth,
        peak_dB=float(20.0 * np.log10(gain[top])),
        peak_rad_s=float(w[top]),
        crossover_rad_s=m.crossover_rad_s or math.nan if m else math.nan,
        phase_margin_deg=m.phase_deg if m and m.crossover_rad_s else math.nan,
        gain_margin_dB=20.0 * math.log10(m.gain_up) if m and math.isfinite(m.gain_up) else math.nan,
    )


def _open_loop(w: Array, H: Complex) -> Margins | None:
    apart = np.abs(1.0 - H) > _DISTINCT
    return margins(w[apart], H[apart] / (1.0 - H[apart])) if np.count_nonzero(apart) > 2 else None
