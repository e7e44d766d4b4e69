"""Where a measured flight goes: one JSON object, a table, files in a folder."""

import csv
import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from gcs_tools import table
from gcs_tools.flight import Flight
from gcs_tools.metrics import Track, report
from sitl.strict_yaml import ConfigError

GAP_S = 0.5  # of the vehicle's time without a position sample, above which the figures deserve a warning
COLUMNS = (
    "t_s",
    "ref_north_m",
    "ref_east_m",
    "ref_down_m",
    "north_m",
    "east_m",
    "down_m",
    "err_north_m",
    "err_east_m",
    "err_down_m",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
    "thrust_N",
    "flap_left_deg",
    "flap_right_deg",
)


def prepare(out: Path | None) -> None:
    """Make the folder before anything is flown: raises ConfigError if results can't be written there."""
    if out is None:
        return
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{out}: can't be made a folder: {error.strerror}") from None
    if not os.access(out, os.W_OK | os.X_OK):
        raise ConfigError(f"{out}: can't be written to")


def conclude(
    flight: Flight,
    *,
    vehicle: str | None,
    factor: float,
    out: Path | None,
    as_json: bool,
    true: dict[str, Any] | None = None,
) -> None:
    """Measure a flown flight and tell the result; `out` is a folder that `prepare` has made.

    true: figures of the true position, where they are known.
    """
    metrics = flight.metrics()
    assert flight.measured_s is not None
    result = report(flight.plan.name, vehicle, flight.measured_s, metrics, factor)
    if true is not None:
        result["true"] = true
    if metrics.largest_gap_s > GAP_S:
        print(f"warning: {metrics.largest_gap_s:.1f} s of the flight went without a sample", file=sys.stderr)
    if out is not None:
        write(out, result, flight.track())
    if as_json:
        print(json.dumps(result))
    else:
        table.show(result, flight.plan.paper)


def write(folder: Path, result: dict[str, Any], track: Track) -> None:
    """result.json and track.csv."""
    (folder / "result.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    with (folder / "track.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([f"{v:.6g}" if np.isfinite(v) else "" for v in row] for row in rows(track))


def rows(track: Track) -> Any:
    """One row per position sample; what is sent less often is interpolated."""
    t = track.t_s
    error = track.position_m - track.reference_m
    slow = [
        np.interp(t, s[:, 0], s[:, k]) if s.shape[0] else np.full_like(t, np.nan)
        for s in (track.angles, track.thrust, track.flaps)
        for k in range(1, s.shape[1])
    ]
    return np.column_stack([t, track.reference_m, track.position_m, error, *slow])
