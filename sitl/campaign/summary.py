"""A campaign's results as plain data: what summary.json has and the report shows."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.campaign.distributions import Choice, Grid
from sitl.campaign.file import Campaign
from sitl.campaign.results import FIGURES, OUTCOMES
from sitl.campaign.statistics import Rate, influences, spread, wilson

Array = NDArray[Any]
SENSITIVITY_OF = ("mae_3d_m", "max_3d_m")
WORST_OF = ("max_3d_m", "mae_3d_m", "max_tilt_deg")
WORST = 5  # flights of each
TOLD_FAILURES = 20
LEVELS_MAX = 25  # values of a setting that has a table of its own
OWN = ("seed", "mission", "vehicle")


class Results:
    """The table of flights by column."""

    def __init__(self, campaign: Campaign, table: Any) -> None:
        self.campaign = campaign
        self.columns: dict[str, Array] = {
            name: np.array(table[name].to_pylist()) for name in table.column_names if name != "reason"
        }
        self.reasons: list[str] = table["reason"].to_pylist()
        self.count = len(self.reasons)

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]

    @property
    def completed(self) -> Array:
        done: Array = self["outcome"] == "completed"
        return done

    def varied(self, *kinds: type[Any]) -> list[str]:
        """Settings that differ between flights."""
        named = [s.name for s in self.campaign.settings.values() if not kinds or isinstance(s.distribution, kinds)]
        return [name for name in named if name in self.columns and np.unique(self[name]).size > 1]

    def numbers(self) -> dict[str, Array]:
        """Settings whose values have an order."""
        return {n: self[n] for n in self.varied() if n != "seed" and self[n].dtype.kind == "f"}

    def levels(self) -> list[str]:
        """Settings with few values, to be told one by one."""
        few = [n for n in self.varied(Grid, Choice) if np.unique(self[n]).size <= LEVELS_MAX]
        return few


def summarise(results: Results, record: dict[str, Any]) -> dict[str, Any]:
    r = results
    return {
        "name": r.campaign.name,
        "description": r.campaign.description,
        "flights": r.count,
        "of": record["flights"],
        "outcomes": {o: int(np.sum(r["outcome"] == o)) for o in OUTCOMES if np.any(r["outcome"] == o)},
        "success": {"limits": r.campaign.success, **rate(wilson(int(r["success"].sum()), r.count))},
        "completed": rate(wilson(int(r.completed.sum()), r.count)),
        "figures": {c.name: spread(r[c.name][r.completed]) for c in FIGURES},
        "worst": {name: worst(r, name) for name in WORST_OF},
        "not_completed": [
            _flight(r, k) | {"reason": r.reasons[k]} for k in np.flatnonzero(~r.completed)[:TOLD_FAILURES]
        ],
        "sensitivity": {
            name: [i._asdict() for i in influences(r.numbers(), np.where(r.completed, r[name], np.nan))]
            for name in SENSITIVITY_OF
        },
        "levels": {name: levels(r, name) for name in r.levels()},
        "simulated_s": float(r["simulated_s"].sum()),
        "record": record,
    }


def rate(x: Rate) -> dict[str, float]:
    return {"count": x.hits, "rate": x.rate, "low": x.low, "high": x.high}


def worst(r: Results, figure: str) -> list[dict[str, Any]]:
    """Completed flights, the greatest figure first."""
    values = np.where(r.completed, r[figure], -math.inf)
    order = np.argsort(-values, kind="stable")[:WORST]
    return [_flight(r, k) | {"value": float(r[figure][k])} for k in order if math.isfinite(values[k])]


def _flight(r: Results, k: int) -> dict[str, Any]:
    return {
        "index": int(r["index"][k]),
        "outcome": str(r["outcome"][k]),
        "settings": {name: r[name][k].item() for name in r.varied()},
        "command": str(r["command"][k]),
    }


def levels(r: Results, name: str) -> list[dict[str, Any]]:
    """For each value of a setting what its flights came to."""
    found = []
    for value in np.unique(r[name]):
        here = r[name] == value
        done = here & r.completed
        found.append(
            {
                "value": value.item(),
                "flights": int(here.sum()),
                "success": rate(wilson(int(r["success"][here].sum()), int(here.sum()))),
                **{f: spread(r[f][done]).get("mean") for f in SENSITIVITY_OF},
                "max_3d_m_p95": spread(r["max_3d_m"][done]).get("p95"),
            }
        )
    return found


def finite(x: Any) -> Any:
    """For JSON: what isn't finite is null."""
    if isinstance(x, float):
        return x if math.isfinite(x) else None
    if isinstance(x, dict):
        return {key: finite(value) for key, value in x.items()}
    if isinstance(x, list | tuple):
        return [finite(value) for value in x]
    return x
