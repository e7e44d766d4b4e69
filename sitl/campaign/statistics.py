"""What many flights come to: rates with their confidence, spreads, and which settings the errors depend on."""

import math
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CONFIDENCE = 0.95
_QUANTILE = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2.0)


class Rate(NamedTuple):
    """hits of `of`, with the interval that the rate behind it lies in (95 %)."""

    hits: int
    of: int
    low: float
    high: float

    @property
    def rate(self) -> float:
        return self.hits / self.of if self.of else math.nan


def wilson(count: int, of: int) -> Rate:
    """A share's confidence interval by Wilson's score (1927), which holds for few trials and for shares of 0 and 1."""
    if of == 0:
        return Rate(0, 0, 0.0, 1.0)
    z2, p = _QUANTILE**2, count / of
    middle = (p + z2 / (2 * of)) / (1 + z2 / of)
    half = _QUANTILE / (1 + z2 / of) * math.sqrt(p * (1 - p) / of + z2 / (4 * of * of))
    low = 0.0 if count == 0 else max(0.0, middle - half)
    high = 1.0 if count == of else min(1.0, middle + half)
    return Rate(count, of, low, high)


def spread(values: Array) -> dict[str, float]:
    """Mean, standard deviation and quantiles of what is finite."""
    v = values[np.isfinite(values)]
    if not v.size:
        return {}
    quantiles = {"median": 0.5, "p95": 0.95, "p99": 0.99}
    return {
        "mean": float(v.mean()),
        "std": float(v.std(ddof=1)) if v.size > 1 else 0.0,
        "least": float(v.min()),
        **{name: float(np.quantile(v, q)) for name, q in quantiles.items()},
        "greatest": float(v.max()),
    }


class Influence(NamedTuple):
    """How a figure goes with a setting, by ranks, −1 … 1.

    rank: Spearman's correlation. middle: the same of the setting's distance from its median, for what grows to both
    sides. partial, middle_partial: what is left of each once all other settings' share is taken away; NaN where
    there are too few flights for it. noise: of a setting that has no influence 95 of 100 are smaller.
    """

    setting: str
    rank: float
    middle: float
    partial: float
    middle_partial: float
    noise: float

    @property
    def size(self) -> float:
        known = [abs(v) for v in (self.partial, self.middle_partial) if not math.isnan(v)]
        return max(known or [abs(self.rank), abs(self.middle)])


def influences(settings: dict[str, Array], figure: Array) -> list[Influence]:
    """Of each setting on a figure, the greatest first. Flights without the figure are left out."""
    from scipy.stats import rankdata

    known = np.isfinite(figure)
    n = int(known.sum())
    varied = {name: v[known] for name, v in settings.items() if np.unique(v[known]).size > 1}
    if n < 5 or not varied or np.unique(figure[known]).size < 2:
        return []
    y = rankdata(figure[known])
    straight = {name: rankdata(v) for name, v in varied.items()}
    middle = {name: rankdata(np.abs(v - np.median(v))) for name, v in varied.items()}
    features = {("straight", k): v for k, v in straight.items()} | {("middle", k): v for k, v in middle.items()}
    features = {key: v for key, v in features.items() if np.unique(v).size > 1}
    left_over = n - len(features) - 2
    noise = min(1.0, _QUANTILE / math.sqrt(max(1, left_over)))
    found = [
        Influence(
            name,
            _correlation(straight[name], y),
            _correlation(middle[name], y) if ("middle", name) in features else 0.0,
            _partial(features, ("straight", name), y) if left_over > 0 else math.nan,
            _partial(features, ("middle", name), y) if left_over > 0 else math.nan,
            noise,
        )
        for name in varied
    ]
    return sorted(found, key=lambda i: -i.size)


def _correlation(x: Array, y: Array) -> float:
    return float(np.corrcoef(x, y)[0, 1])


def _partial(features: dict[Any, Array], key: Any, y: Array) -> float:
    """Correlation of what linear regression on all other features leaves of x and y; 0 where it leaves nothing."""
    if key not in features:
        return 0.0
    others = np.column_stack([np.ones_like(y), *(v for k, v in features.items() if k != key)])
    left = []
    for v in (features[key], y):
        solution, *_ = np.linalg.lstsq(others, v, rcond=None)
        left.append(v - others @ solution)
    sizes = [float(np.linalg.norm(v)) for v in left]
    if min(sizes) < 1e-9 * float(np.linalg.norm(y)):
        return 0.0
    return float(left[0] @ left[1]) / (sizes[0] * sizes[1])
