"""Robustness: the trials beyond the paper that `sitl reproduce` flies, the worst of seeds 1 to 5 (`--quick`: seed 1).

The real vehicle flies them twice: knowing its state, and on its filter's estimate.
"""

from collections.abc import Iterator

from benchmarks.figure import Figure, all_at_most
from sitl.reproduce.cases import BEYOND, SEEDS
from sitl.reproduce.trials import TRIALS, erring

_SHORT = {"exact": "state known", "tuned": "filter"}


def measure(quick: bool) -> Iterator[Figure]:
    for trial in TRIALS:
        for setup in BEYOND:
            if setup.key not in _SHORT:
                continue
            repeated = not quick and (trial.gusty or erring(setup.craft))
            by_seed = [trial.fly(setup.craft, seed) for seed in (SEEDS if repeated else SEEDS[:1])]
            for told, values in zip(trial.measures, zip(*by_seed, strict=True), strict=True):
                what = f"{trial.group}, {trial.title}: {told.title}, {_SHORT[setup.key]}"
                yield all_at_most(what, values, told.limit, told.unit)
