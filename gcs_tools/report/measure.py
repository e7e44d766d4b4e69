"""One flight of a log: when it was, against what it is measured, and how well it followed."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gcs_tools.convert import local_m
from gcs_tools.metrics import Metrics, TooFewSamplesError, Track, evaluate
from gcs_tools.plan import Plan, Streamed, Uploaded
from gcs_tools.recording import Recording
from gcs_tools.reference import Reference, Vector
from gcs_tools.report.log import Log
from gcs_tools.timeline import rows as timeline_rows
from sitl.strict_yaml import ConfigError

_BEFORE_S, _AFTER_S = 5.0, 60.0  # of arming, in which a streamed flight's time may have started
_COARSE_S = 0.1
_SAMPLES = 400  # of the recorded reference that a mission is laid over
_APART_M = 0.5  # RMS from the recorded reference, above which a mission isn't the one that was flown
_SETTLED_S = 0.5  # shorter than this a change of the landed state is bouncing


class Measured(NamedTuple):
    """t0_s: when its time starts, in the log's. The figures run from there to duration_s later.

    reported, true: by what the vehicle believes and by the truth; None where there is nothing to measure.
    """

    number: int
    spans: list[tuple[float, float]]  # of all flights in the log, from arming to disarming
    t0_s: float
    duration_s: float
    against: str
    reference: Reference | None  # the mission's own
    reported: Metrics | None
    true: Metrics | None
    distance_m: float
    top_speed_m_s: float
    height_m: float  # the greatest, above the origin

    @property
    def end_s(self) -> float:
        return self.t0_s + self.duration_s


def measure(log: Log, number: int | None, plan: Plan | None) -> Measured:
    """number: of the flight, from 1; None: the longest. Raises ConfigError."""
    spans = log.armed_spans()
    if number is not None and not 1 <= number <= len(spans):
        raise ConfigError(f"{log.path}: no flight {number} in it; allowed: 1 to {len(spans)}")
    if number is None:
        number = 1 + max(range(len(spans)), key=lambda k: spans[k][1] - spans[k][0]) if spans else 0
    begin_s, end_s = spans[number - 1] if spans else log.span_s
    reference, against = None, "the recorded reference" if log.reported.targets else "nothing: no reference is recorded"
    t0_s, duration_s = begin_s, end_s - begin_s
    points: Sequence[tuple[float, Vector | None]] = [
        (t - begin_s, None) for t, _ in log.reached if begin_s <= t <= end_s
    ]
    if isinstance(plan, Streamed):
        t0_s, apart_m = _aligned(log, plan, begin_s, end_s)
        reference, duration_s = plan.reference, min(plan.duration_s, log.span_s[1] - t0_s)
        against = f"{plan.name}, which begins at {t0_s:.2f} s (what was recorded of it is {apart_m * 1e3:.1f} mm off)"
        points = [(t, plan.reference.at(t).position_m) for t in plan.key_times_s if t <= duration_s]
    elif isinstance(plan, Uploaded):
        places = [local_m(item, plan.home) for item in plan.items]
        points = [
            (t - begin_s, places[seq] if seq < len(places) else None) for t, seq in log.reached if begin_s <= t <= end_s
        ]
    reported, true = (_figures(r, t0_s, duration_s, reference, points) for r in (log.reported, log.true))
    distance_m, top_m_s = _way(log, begin_s, end_s)
    heights = [-row[3] for row in _best(log).positions if begin_s <= row[0] <= end_s and row[3] is not None]
    height_m = max(heights, default=0.0)
    return Measured(number, spans, t0_s, duration_s, against, reference, reported, true, distance_m, top_m_s, height_m)


def track(recording: Recording, m: Measured) -> Track:
    return recording.track(m.t0_s, m.reference)


def planned(plan: Plan | None, m: Measured) -> Any:
    """(n, 3) places of a mission's path, those of its items where it is uploaded; None without a mission."""
    if isinstance(plan, Streamed):
        return np.array([plan.reference.at(float(t)).position_m for t in np.arange(0.0, m.duration_s, 0.05)])
    if isinstance(plan, Uploaded):
        places = [row.place_m for row in timeline_rows(plan) if row.place_m is not None]
        return np.array(places) if places else None
    return None


def _best(log: Log) -> Recording:
    return log.true if log.true.positions else log.reported


def _figures(
    recording: Recording,
    t0_s: float,
    duration_s: float,
    reference: Reference | None,
    points: Sequence[tuple[float, Vector | None]],
) -> Metrics | None:
    if not recording.positions or (reference is None and not recording.targets) or duration_s <= 0.0:
        return None
    try:
        return evaluate(recording.track(t0_s, reference), duration_s, points)
    except TooFewSamplesError:
        return None


def _way(log: Log, begin_s: float, end_s: float) -> tuple[float, float]:
    """(length [m], top speed [m/s]): the speed integrated, as noise in the position adds way that was not flown."""
    rows = log.series("true_velocity" if log.rows["true_velocity"] else "velocity")
    rows = rows[(rows[:, 0] >= begin_s) & (rows[:, 0] <= end_s)]
    if len(rows) < 2:
        return 0.0, 0.0
    speed = np.linalg.norm(rows[:, 1:], axis=1)
    return float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(rows[:, 0]))), float(np.nanmax(speed))


def _aligned(log: Log, plan: Streamed, begin_s: float, end_s: float) -> tuple[float, float]:
    """When the plan's time starts, and how far [m RMS] what was flown is from it then. Raises ConfigError.

    The start itself is in no log: it is where the plan lies best over the reference that the vehicle or a client told.
    """
    told = np.array(log.reported.targets or log.rows["sent"], dtype=float).reshape(-1, 4)
    told = told[(told[:, 0] >= begin_s) & (told[:, 0] <= end_s)]
    told = told[:: max(1, len(told) // _SAMPLES)]
    if len(told) < 10:
        raise ConfigError(f"{log.path}: no reference is recorded that {plan.source} could be laid over")
    grid = np.arange(0.0, plan.duration_s + 0.02, 0.02)
    wanted = np.array([plan.reference.at(float(t)).position_m for t in grid])

    # laid over its edge alone, standing on the ground, any mission fits
    least = max(10, round(0.5 * len(told) * min(1.0, plan.duration_s / float(told[-1, 0] - told[0, 0]))))

    def apart(t0_s: float) -> float:
        inside = (told[:, 0] >= t0_s) & (told[:, 0] <= t0_s + plan.duration_s)
        if np.count_nonzero(inside) < least:
            return math.inf
        at = told[inside, 0] - t0_s
        there = np.column_stack([np.interp(at, grid, wanted[:, k]) for k in range(3)])
        return float(np.sqrt(np.mean(np.sum((told[inside, 1:] - there) ** 2, axis=1))))

    starts = np.arange(begin_s - _BEFORE_S, min(end_s, begin_s + _AFTER_S), _COARSE_S)
    best = float(min(starts, key=apart))
    step = _COARSE_S
    while step > 1e-4:
        best = min((best - step, best, best + step), key=apart)
        step *= 0.5
    if not apart(best) <= _APART_M:
        raise ConfigError(f"{log.path}: {plan.source} isn't what was flown: {apart(best):.2f} m off (RMS) at best")
    return best, apart(best)


def timeline(log: Log) -> list[tuple[float, str, str]]:
    """(t_s, kind, text) of changes and events in their order; bouncing on the ground is left out."""
    told: list[tuple[float, str, str]] = [(e.t_s, e.kind, e.text) for e in log.events]
    status = log.status
    ends = [s.t_s for s in status[1:]] + [math.inf]
    mode: Any = None
    armed: Any = None
    landed: Any = None
    for now, end_s in zip(status, ends, strict=True):
        if now.mode is not None and now.mode != mode:
            mode = now.mode
            told.append((now.t_s, "mode", now.mode))
        if now.armed is not None and now.armed != armed:
            if armed is not None or now.armed:
                told.append((now.t_s, "armed", "armed" if now.armed else "disarmed"))
            armed = now.armed
        if now.landed is not None and now.landed != landed and end_s - now.t_s >= _SETTLED_S:
            landed = now.landed
            told.append((now.t_s, "landed", now.landed))
    return sorted(told, key=lambda entry: entry[0])
