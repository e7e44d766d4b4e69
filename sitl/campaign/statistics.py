"""What many flights come to: rates with their confidence, spreads, and which settings the errors depend on."""

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CONFIDENCE = 0.95
_LEAST = 5  # flights, below which nothing is told of influences
_BINS, _IN_BIN = 20, 10  # at most, and flights in each at least
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
    """How a figure goes with a setting, by ranks.

    rank: Spearman's correlation, −1 … 1. partial: what is left of it once all other settings' share is taken away; NaN
    where there are too few flights for it. share: of the figure's spread, what the setting explains by itself whatever
    the shape (the correlation ratio η² over bins of like many flights, adjusted for their number), 0 … 1.
    partial_noise, share_noise: of a setting without influence 95 of 100 are smaller.
    """

    setting: str
    rank: float
    partial: float
    share: float
    partial_noise: float
    share_noise: float

    @property
    def size(self) -> float:
        """Of the figure's spread, the part that goes with it by either measure."""
        return max(self.share, (self.rank if math.isnan(self.partial) else self.partial) ** 2)


def influences(settings: dict[str, Array], figure: Array) -> list[Influence]:
    """Of each setting on a figure, the greatest first. Flights without the figure are left out."""
    from scipy.stats import rankdata

    known = np.isfinite(figure)
    n = int(known.sum())
    varied = {name: rankdata(v[known]) for name, v in settings.items() if np.unique(v[known]).size > 1}
    if n < _LEAST or not varied or np.unique(figure[known]).size < 2:
        return []
    y = rankdata(figure[known])
    left_over = n - len(varied) - 2
    noise = min(1.0, _QUANTILE / math.sqrt(max(1, left_over)))
    found = []
    for name, x in varied.items():
        partial = _partial(varied, name, y) if left_over > 0 else math.nan
        share, share_noise = _share(x, y)
        found.append(Influence(name, _correlation(x, y), partial, share, noise, share_noise))
    return sorted(found, key=lambda i: -i.size)


def _share(x: Array, y: Array) -> tuple[float, float]:
    """η² of y over bins of x, adjusted, and what it stays below 95 times of 100 without influence."""
    from scipy.stats import f

    values, n = np.unique(x), x.size
    count = min(values.size, _BINS, max(2, n // _IN_BIN))
    # by rank: each bin has as many, and equal values are in one
    bins = np.minimum(((x - 0.5) * count / n).astype(int), count - 1)
    used = np.unique(bins)
    if used.size < 2 or n <= used.size:
        return 0.0, 1.0
    between = sum(float((bins == k).sum()) * float(y[bins == k].mean() - y.mean()) ** 2 for k in used)
    whole = float(((y - y.mean()) ** 2).sum())
    free, rest = used.size - 1, n - used.size
    least = float(f.ppf(CONFIDENCE, free, rest)) * free
    return _adjusted(between / whole, n, rest), _adjusted(least / (least + rest), n, rest)


def _adjusted(share: float, n: int, rest: int) -> float:
    """Ezekiel's: without influence it is 0 on average, however many bins there are."""
    return max(0.0, 1.0 - (1.0 - share) * (n - 1) / rest)


def _correlation(x: Array, y: Array) -> float:
    return float(np.corrcoef(x, y)[0, 1])


def _partial(ranks: dict[str, Array], name: str, y: Array) -> float:
    """Correlation of what linear regression on all other settings leaves of x and y; 0 where it leaves nothing."""
    others = np.column_stack([np.ones_like(y), *(v for k, v in ranks.items() if k != name)])
    left = []
    for v in (ranks[name], y):
        solution, *_ = np.linalg.lstsq(others, v, rcond=None)
        left.append(v - others @ solution)
    sizes = [float(np.linalg.norm(v)) for v in left]
    if min(sizes) < 1e-9 * float(np.linalg.norm(y)):
        return 0.0
    return float(left[0] @ left[1]) / (sizes[0] * sizes[1])
