"""A whole `sitl fly` process, from the interpreter's start to its end, kernels cached."""

import json
import subprocess
import time
from collections.abc import Iterator

from benchmarks.figure import Figure, at_least, at_most, told
from benchmarks.processes import BenchmarkError, start

RUNS = 5


def measure(quick: bool) -> Iterator[Figure]:
    _fly()
    took, factors = zip(*(_fly() for _ in range(RUNS)), strict=True)
    bare = [_import_only() for _ in range(RUNS)]
    yield at_most("sitl fly missions/rectangle.yaml, whole process", took, 4.0, "s")
    yield at_least("the same, its real_time_factor", factors, 100.0, "× real time")
    yield told("an interpreter that imports numba and ends", f"{min(bare):.2f} s, {min(bare) / min(took):.0%} of it")


def _fly() -> tuple[float, float]:
    """Seconds it took, and the real-time factor that it tells itself."""
    start_s = time.perf_counter()
    process = start("sitl", "fly", "missions/rectangle.yaml", "--json", stdout=subprocess.PIPE)
    output, _ = process.communicate(timeout=120.0)
    took_s = time.perf_counter() - start_s
    if process.returncode:
        raise BenchmarkError(f"sitl fly ended with status {process.returncode}")
    return took_s, json.loads(output)["real_time_factor"]


def _import_only() -> float:
    start_s = time.perf_counter()
    start("benchmarks.only_numba").wait(60.0)
    return time.perf_counter() - start_s
