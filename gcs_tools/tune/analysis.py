"""What an experiment comes to: figures of each set of gains, and of two sets beside each other."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools.tune.experiment import Trial
from gcs_tools.tune.frequency import NOTHING, ClosedLoop, FrequencyResponse, closed_loop, estimate, evenly
from gcs_tools.tune.loops import Excitation, Loop
from gcs_tools.tune.recorder import Taken
from gcs_tools.tune.response import Effort, StepFigures, effort, step_figures

Array = NDArray[np.float64]
_EDGE_MARGIN_S = 0.04  # the next edge may come a little before its time
FEW_SAMPLES = 10  # in a rise: with fewer the figures are coarse


class Figure(NamedTuple):
    """A row of the table. scale: from the value to the unit. better: −1 where less is better, 0 where neither is."""

    key: str
    label: str
    unit: str
    scale: float
    better: int


class Analysed(NamedTuple):
    """values: by Figure.key; empty where the gains could not be flown. record: the first one, for the plot."""

    trial: Trial
    values: dict[str, float]
    frequency: FrequencyResponse
    record: Taken | None

    @property
    def coarse(self) -> bool:
        """Whether the rise has too few samples for its figures to be believed."""
        return self.record is not None and self.values["rise_s"] * self.record.rate_Hz < FEW_SAMPLES


def figures(loop: Loop) -> list[Figure]:
    """All rows, in order."""
    unit = loop.kind.unit
    return [
        Figure("rise_s", "rise time, 10 to 90 %", "s", 1.0, -1),
        Figure("overshoot", "overshoot", "%", 100.0, -1),
        Figure("settling_s", "settling time", "s", 1.0, -1),
        Figure("steady_error", "steady-state error", unit, 1.0, 0),
        Figure("iae", "IAE", f"{unit}·s", 1.0, -1),
        Figure("itae", "ITAE", f"{unit}·s²", 1.0, -1),
        Figure("energy_s", "control effort ∫Σ(u − u₀)² dt", "s", 1.0, -1),
        Figure("travel_1_s", "control travel Σ|du/dt|", "1/s", 1.0, -1),
        Figure("bandwidth_rad_s", "bandwidth (−3 dB)", "rad/s", 1.0, 1),
        Figure("phase_at_bandwidth_deg", "phase there", "°", 1.0, 0),
        Figure("peak_dB", "peak gain", "dB", 1.0, -1),
        Figure("crossover_rad_s", "crossover of L = H/(1−H)", "rad/s", 1.0, 0),
        Figure("phase_margin_deg", "phase margin", "°", 1.0, 1),
        Figure("gain_margin_dB", "gain margin", "dB", 1.0, 1),
    ]


def first_level(record: Taken, excitation: Excitation) -> tuple[Array, Array]:
    """(t, output) from the first edge to the next one, as the vehicle tells it."""
    t, away = record.t_s, np.abs(record.reference - excitation.size) > 0.5 * abs(excitation.size)
    left = np.flatnonzero(away & (t > 0.0) & (t > 0.5 * excitation.hold_s))
    chosen = (t >= 0.0) & (t < (t[left[0]] - 1e-9 if left.size else math.inf))
    return t[chosen], record.output[chosen]


def _of_record(record: Taken, excitation: Excitation, band: float) -> dict[str, float]:
    t, output = first_level(record, excitation)
    step: StepFigures = step_figures(t, output, 0.0, excitation.size, band)
    u_t, u = record.actuators[:, 0], record.actuators[:, 1:]
    during, before = (u_t >= 0.0) & (u_t <= t[-1]), u_t < 0.0
    rest = u[before].mean(axis=0) if before.any() else u[:1].mean(axis=0) if u.size else np.zeros(u.shape[1])
    pushed: Effort = effort(u_t[during], u[during], rest)
    return step._asdict() | pushed._asdict()


def analyse(trial: Trial, excitation: Excitation, band: float) -> Analysed:
    """The figures of one set of gains, means over its records. Raises response.TooFewSamplesError."""
    if not trial.records or trial.fault:
        return Analysed(trial, {}, NOTHING, trial.records[0] if trial.records else None)
    each = [_of_record(record, excitation, band) for record in trial.records]
    values = {key: float(np.mean([one[key] for one in each])) for key in each[0]}
    spans = []
    for record in trial.records:
        for edge_s, start_s, end_s in excitation.settled_spans_s:
            inside = (record.t_s >= start_s) & (record.t_s < end_s - _EDGE_MARGIN_S)
            spans.append(evenly(record.t_s[inside] - edge_s, record.reference[inside], record.output[inside]))
    frequency = estimate(spans)
    loop: ClosedLoop = closed_loop(frequency)
    return Analysed(trial, values | loop._asdict(), frequency, trial.records[0])


def result(
    loop: Loop, excitation: Excitation, vehicle: str | None, analysed: Sequence[Analysed], band: float
) -> dict[str, Any]:
    """The one JSON object that an experiment comes to. Numbers that there are none of are null."""
    kind = loop.kind
    return {
        "loop": loop.name,
        "unit": kind.unit,
        "vehicle": vehicle,
        "excitation": {
            "kind": excitation.name,
            "size": excitation.size,
            "hold_s": excitation.hold_s,
            "settling_band": band,
        },
        "sets": [
            {
                "name": one.trial.name,
                "gains": {name: one.trial.gains[name] for name in loop.gains},
                "fault": one.trial.fault or None,
                "records": len(one.trial.records),
                "rate_Hz": round(one.record.rate_Hz, 1) if one.record is not None else None,
                "figures": {f.key: _number(one.values.get(f.key, math.nan)) for f in figures(loop)},
                "frequency_response": {
                    "rad_s": [_number(w) for w in one.frequency.frequency_rad_s],
                    "gain_dB": [_number(g) for g in one.frequency.gain_dB],
                    "phase_deg": [_number(p) for p in one.frequency.phase_deg],
                    "coherence": [_number(c) for c in one.frequency.coherence],
                },
            }
            for one in analysed
        ],
    }


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if math.isfinite(value) else None
