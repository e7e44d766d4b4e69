"""This simulator: whole flights of the paper's rectangle by a shipped vehicle, or a slower copy of its own.

Arguments: vehicle, control rate in Hz. The slower copy is the vehicle's file with another `control_rate_hz`.
"""

import re
import sys
import tempfile
from pathlib import Path

import timed

from gcs_tools import plan
from sitl import batch
from sitl.vehicle import load_vehicle

PAPER_M = (0.0317, 0.0135, 0.0099)  # the rectangle's mean absolute errors as it prints them

ROOT = Path(__file__).parents[2]
name, rate_Hz = sys.argv[1:]
rectangle = plan.load(ROOT / "missions" / "rectangle.yaml")
with tempfile.TemporaryDirectory() as folder:
    text = (ROOT / "sitl" / "vehicles" / f"{name}.yaml").read_text()
    mine = Path(folder) / f"{name}.yaml"
    mine.write_text(re.sub(r"control_rate_hz: \d+", f"control_rate_hz: {rate_Hz}", text))
    spec = load_vehicle(str(mine))


def fly(seconds: float) -> float:
    flown = batch.fly(rectangle, spec, seed=1)
    assert not flown.fault, flown.fault
    assert all(error < paper for error, paper in zip(flown.mae_m, PAPER_M, strict=True)), flown.mae_m
    return flown.end_s


timed.tell(fly, 72.0)
