"""One flight of a campaign: a case goes in, a row of figures comes out, and a trace where one is kept."""

import hashlib
import math
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import gcs_tools
import sitl
from sitl import batch
from sitl.batch import Outcome
from sitl.campaign.cases import Case, Equipment
from sitl.campaign.mcap_file import recording
from sitl.campaign.results import FIGURES, TRACE, TRACE_SOURCES
from sitl.closed_loop import TRACE_COLUMNS

GROUND_M = 0.1  # a vehicle lower than this whose reference is in the air has hit the ground
_TIMEOUT = ("isn't done after", "given up on")  # in the faults that batch.fly tells
_PICKED = [TRACE_COLUMNS.index(name) for name in TRACE_SOURCES]


class Job(NamedTuple):
    """A flight to be flown.

    trace_hz: 0 keeps no trace. success: figures and their limits. mcap: the trace is wanted as .mcap too.
    """

    case: Case
    trace_hz: float
    success: tuple[tuple[str, float], ...] = ()
    mcap: bool = False


class Flight(NamedTuple):
    """What is kept of one. trace: a column for each of TRACE behind the index, times from the flight's start."""

    number: int
    row: dict[str, Any]
    trace: list[NDArray[Any]] | None = None
    mcap: bytes | None = None


def fly(equipment: Equipment, job: Job) -> Flight:
    """Fly it. Whatever goes wrong stands in the row."""
    case = job.case
    try:
        outcome = batch.fly(
            equipment.mission(case),
            equipment.vehicles[case.vehicle],
            seed=case.seed,
            wind_N=case.wind_N,
            gust_m_s=case.gust_m_s,
            parameters=equipment.gains.get(case.gains, {}) | dict(case.parameters),
            plant=dict(case.plant),
            believed=dict(case.believed),
            heading_rad=math.radians(case.heading_deg),
            traced=job.trace_hz > 0.0,
        )
    except Exception as error:
        return lost(job, f"{type(error).__name__}: {error}")
    word, reason = _judged(outcome)
    figures = _figures(outcome)
    success = word == "completed" and all(figures[name] <= limit for name, limit in job.success)
    row = _row(case, word, reason, success) | figures | {"simulated_s": outcome.end_s}
    trace = _trace(outcome, job.trace_hz)
    return Flight(case.number, row, trace, recording(trace, row) if job.mcap and trace else None)


def lost(job: Job, reason: str) -> Flight:
    """A flight that could not be flown."""
    nothing = dict.fromkeys((c.name for c in FIGURES), math.nan)
    return Flight(job.case.number, _row(job.case, "error", reason, False) | nothing | {"simulated_s": 0.0})


def _row(case: Case, outcome: str, reason: str, success: bool) -> dict[str, Any]:
    return {
        "index": case.number,
        "draw": case.draw,
        "outcome": outcome,
        "reason": reason,
        "success": success,
        "mission": case.mission,
        "vehicle": case.vehicle,
        "seed": case.seed,
        **dict(case.varied),
        "command": case.command,
    }


def _judged(o: Outcome) -> tuple[str, str]:
    """What became of a flight, and why."""
    hit = o.least_height_m < GROUND_M
    if o.tipped_over:
        return "tipped over", o.fault or "it lay on the ground in the end"
    if hit:
        return "crashed", o.fault or f"came down to {max(o.least_height_m, 0.0):.2f} m where it was to be in the air"
    if any(words in o.fault for words in _TIMEOUT):
        return "timeout", o.fault
    if o.fault:
        return "failed", o.fault
    return ("completed", "") if o.landed else ("failed", "it did not stand with its motors off in the end")


def _figures(o: Outcome) -> dict[str, float]:
    rms_3d = math.sqrt(sum(v * v for v in o.rmse_m))
    values = (
        *o.mae_m, o.mean_distance_m, *o.rmse_m, rms_3d, *o.max_error_m, o.max_distance_m,
        o.max_tilt_deg, o.energy_J, o.duration_s,
    )  # fmt: skip
    return dict(zip((c.name for c in FIGURES), values, strict=True))


def _trace(outcome: Outcome, hz: float) -> list[NDArray[Any]] | None:
    rows = outcome.trace
    if rows is None or not len(rows):
        return None
    step_s = rows[1, 0] - rows[0, 0] if len(rows) > 1 else 1.0
    kept = rows[:: max(1, round(1.0 / (hz * step_s)))]
    signals = (kept[:, k].astype(np.float32) for k in _PICKED)
    columns: list[NDArray[Any]] = [np.round(kept[:, 0] - outcome.start_s, 6), *signals]
    assert len(columns) == len(TRACE) - 1
    return columns


@cache
def fingerprint() -> str:
    """Of the simulator's own source text: flights of two are comparable to the bit only where it is the same."""
    whole = hashlib.sha256()
    for package in (sitl, gcs_tools):
        root = Path(str(package.__file__)).parent
        for path in sorted(p for end in ("py", "yaml") for p in root.rglob(f"*.{end}")):
            whole.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return whole.hexdigest()[:16]
