"""One flight of the evaluation: a flight as `sitl.fly` makes it, of a mission and a vehicle that a case names."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools import plan as plans
from gcs_tools.plan import Streamed
from sitl import api
from sitl.api import CAUSES, COLUMNS
from sitl.reproduce.cases import Case
from sitl.vehicle import load_vehicle

__all__ = ["CAUSES", "COLUMNS", "HERE", "Flight", "FlightError", "fly", "mission"]

Array = NDArray[np.float64]
HERE = Path(__file__).parent


class FlightError(RuntimeError):
    """A flight of the evaluation that did not reach its end."""


class Flight(NamedTuple):
    """A case and its flight; the fields are those of sitl.api.Flown."""

    case: Case
    reported: dict[str, Any]
    true: dict[str, Any]
    samples: Array

    def column(self, name: str) -> Array:
        values: Array = self.samples[:, COLUMNS.index(name)]
        return values


def mission(name: str) -> Streamed:
    plan = plans.load(HERE / "missions" / f"{name}.yaml")
    assert isinstance(plan, Streamed)
    return plan


def fly(case: Case) -> Flight:
    """Fly one case from standing to standing. Raises FlightError where it fails on the way."""
    try:
        flown = api.fly(
            mission(case.mission),
            load_vehicle(case.vehicle),
            seed=case.seed,
            wind_N=case.wind_N,
            gust_m_s=case.gust_m_s,
            parameters=dict(case.overrides),
            plant=dict(case.plant),
            believed=dict(case.believed),
        )
    except api.FlightError as error:
        raise FlightError(f"{case.command}: {error}") from None
    return Flight(case, flown.reported, flown.true, flown.samples)
