"""A search for gains with CMA-ES, candidates judged in parallel processes.

The same task, start and seed give the same search however many processes judge: candidates are made in generations, and
a generation is told in the order in which it was made. CMA-ES (Hansen and Ostermeier 2001) is the cmaes library's.
"""

import math
import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools.tune import cost
from gcs_tools.tune.cost import Cost, Task

LEAST_SHARE = 1e-4  # of a gain's declared maximum, which counts as 0
START_SHARE = 1e-3  # of it, where a gain that is 0 begins if it is to be sought
SIGMA = 0.4  # of the first generation, in natural logarithms: a factor of 1.5

Array = NDArray[np.float64]


class Space(NamedTuple):
    """The gains that are sought, each on a logarithmic scale from LEAST_SHARE of its declared maximum up to it."""

    names: tuple[str, ...]
    highest: tuple[float, ...]

    def point(self, gains: dict[str, float]) -> Array:
        """ln(gain / least); a gain of 0 begins at START_SHARE of its maximum."""
        shares = [gains[name] / top or START_SHARE for name, top in self._each]
        return np.array([math.log(max(share, LEAST_SHARE) / LEAST_SHARE) for share in shares])

    def gains(self, x: Array) -> dict[str, float]:
        """The reverse, to five digits as files keep it; 0 at the lower end."""
        return {
            name: 0.0 if value <= 0.0 else float(f"{min(top, LEAST_SHARE * top * math.exp(value)):.5g}")
            for (name, top), value in zip(self._each, x, strict=True)
        }

    @property
    def bounds(self) -> Array:
        return np.array([[0.0, -math.log(LEAST_SHARE)]] * len(self.names))

    @property
    def _each(self) -> list[tuple[str, float]]:
        return list(zip(self.names, self.highest, strict=True))


class Candidate(NamedTuple):
    """gains: all 36. costs: by manoeuvre, of its flights."""

    gains: dict[str, float]
    costs: list[list[Cost]]

    @property
    def total(self) -> float:
        return cost.judged(self.costs)


class Standing(NamedTuple):
    """How the search is getting on. judged: candidates so far. newest: the cost of the newest generation's best."""

    judged: int
    start: Candidate
    best: Candidate
    newest: float


def population(dimensions: int) -> int:
    """Hansen's default, even."""
    size = 4 + int(3.0 * math.log(dimensions))
    return size + size % 2


def search(
    task: Task, start: dict[str, float], space: Space, *, budget: int, seed: int, pool: Executor
) -> Iterator[Standing]:
    """Judge the start, then generations until `budget` candidates are judged; yields after each."""
    from cmaes import CMA

    (first,) = judge(task, [start], pool)
    best, judged = first, 1
    yield Standing(judged, first, best, first.total)
    size = population(len(space.names))
    strategy = CMA(mean=space.point(start), sigma=SIGMA, bounds=space.bounds, seed=seed, population_size=size)
    while judged < budget:
        points = [strategy.ask() for _ in range(size)]
        generation = judge(task, [start | space.gains(x) for x in points], pool)
        strategy.tell([(x, candidate.total) for x, candidate in zip(points, generation, strict=True)])
        judged += size
        newest = min(generation, key=lambda candidate: candidate.total)
        best = min((best, newest), key=lambda candidate: candidate.total)
        yield Standing(judged, first, best, newest.total)
        if strategy.should_stop():
            return


def judge(task: Task, gains: Sequence[dict[str, float]], pool: Executor) -> list[Candidate]:
    """All flights of all candidates, spread over the pool."""
    flights = [(m, air, g) for g in gains for m in task.manoeuvres for air in task.airs]
    told = list(pool.map(cost.fly, [task] * len(flights), *zip(*flights, strict=True)))
    each, airs = len(task.manoeuvres) * len(task.airs), len(task.airs)
    rows = [told[k : k + each] for k in range(0, len(told), each)]
    return [Candidate(g, [row[k : k + airs] for k in range(0, each, airs)]) for g, row in zip(gains, rows, strict=True)]


def _deaf() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def processes(count: int) -> Iterator[Executor]:
    """Fresh processes that leave Ctrl-C to this one; flights that wait are given up when it leaves."""
    context = multiprocessing.get_context("spawn")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_deaf)
    try:
        list(pool.map(abs, range(count)))  # all of them start while Ctrl-C is held back
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        yield pool
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        pool.shutdown(wait=False, cancel_futures=True)
