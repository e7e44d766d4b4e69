"""What a setting may be drawn from, and where in the unit cube each flight draws.

A distribution maps a number of [0, 1) to a value, so that plain random numbers, Latin hypercubes and Sobol's sequence
all serve every kind. A grid is not drawn: every flight is flown at each of its values.
"""

import warnings
from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

Value = float | str
SAMPLINGS = ("random", "latin-hypercube", "sobol")


class Fixed(NamedTuple):
    value: Value

    def extremes(self) -> tuple[Value, ...]:
        return (self.value,)


class Uniform(NamedTuple):
    low: float
    high: float

    def at(self, u: float) -> float:
        return self.low + u * (self.high - self.low)

    def extremes(self) -> tuple[Value, ...]:
        return self.low, self.high


class Normal(NamedTuple):
    """Cut off outside low … high: drawn from the part of the bell that lies within."""

    mean: float
    std: float
    low: float
    high: float

    def at(self, u: float) -> float:
        bell = NormalDist(self.mean, self.std)
        below, above = bell.cdf(self.low), bell.cdf(self.high)
        p = min(max(below + u * (above - below), 1e-300), 1.0 - 2.0**-53)
        return min(max(bell.inv_cdf(p), self.low), self.high)

    def extremes(self) -> tuple[Value, ...]:
        return tuple(v for v in (self.low, self.mean, self.high) if np.isfinite(v))


class Choice(NamedTuple):
    values: tuple[Value, ...]

    def at(self, u: float) -> Value:
        return self.values[min(int(u * len(self.values)), len(self.values) - 1)]

    def extremes(self) -> tuple[Value, ...]:
        return self.values


class Grid(NamedTuple):
    values: tuple[Value, ...]

    def extremes(self) -> tuple[Value, ...]:
        return self.values


Distribution = Fixed | Uniform | Normal | Choice | Grid
Drawn = Uniform | Normal | Choice


def unit_cube(names: Sequence[str], count: int, sampling: str, seed: int) -> NDArray[np.float64]:
    """(count, len(names)) numbers of [0, 1): row k is draw k.

    random: each name has its own stream, so that neither another name nor more draws change it. The other two spread
    all draws together (scipy.stats.qmc), over the names in alphabetical order.
    """
    if not names:
        return np.zeros((count, 0))
    if sampling == "random":
        streams = (np.random.SeedSequence((seed, crc32(name.encode()))) for name in names)
        return np.column_stack([np.random.Generator(np.random.PCG64(s)).random(count) for s in streams])
    from scipy.stats import qmc

    kind = {"latin-hypercube": qmc.LatinHypercube, "sobol": qmc.Sobol}[sampling]
    order = sorted(range(len(names)), key=lambda k: names[k])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of counts that are no power of two: docs/campaigns.md says it
        points = kind(len(names), seed=np.random.Generator(np.random.PCG64(seed))).random(count)
    cube = np.empty((count, len(names)))
    cube[:, order] = points
    return cube
