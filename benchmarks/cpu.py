"""The daemon's share of a core while it hovers at 1 × real time, with a ground station and a Zenoh subscriber.

Time in user and system mode of all the process's threads, from /proc. Besides the ground station that writes to it,
the daemon serves the two conventional peers that nobody listens at, so three in all.
"""

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.figure import Figure, at_most, spread, told
from benchmarks.processes import (
    BenchmarkError,
    converse,
    daemon,
    free_instance,
    ground,
    listener,
    running,
    start,
    zenoh_endpoint,
)
from gcs_tools import commands

WINDOW_S = 10.0
WINDOWS = 2


def measure(quick: bool) -> Iterator[Figure]:
    if not sys.platform.startswith("linux"):
        raise BenchmarkError("it is read from /proc, which only Linux has")
    instance = free_instance()
    with daemon(instance) as process:
        converse(ground(instance), instance + 1, lambda client: commands.takeoff(client, height_m=3.0, wait=True))
        alone = [_share(process.pid) for _ in range(WINDOWS)]
        watch = ("watch", "--connect", ground(instance), "--system", str(instance + 1))
        with running(start("gcs_tools", *watch)), listener(zenoh_endpoint(instance), "read"):
            time.sleep(1.0)
            shares = [_share(process.pid) for _ in range(WINDOWS)]
    with daemon(instance, "--record") as process:
        converse(ground(instance), instance + 1, lambda client: commands.takeoff(client, height_m=3.0, wait=True))
        [writer] = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        recording = [_share(process.pid) for _ in range(WINDOWS)]
        writing = [_share(int(writer)) for _ in range(WINDOWS)]
    yield at_most("CPU at 1 ×, a ground station and a Zenoh subscriber", shares, 20.0, "% of a core")
    yield told("  before either was there", spread(alone, "% of a core"))
    yield told("  the same, recording", spread(recording, "% of a core"))
    yield told("  the process that writes the recording", spread(writing, "% of a core"))


def _share(pid: int) -> float:
    """Percent of a core over a window."""
    start_s, before_s = time.perf_counter(), busy_s(pid)
    time.sleep(WINDOW_S)
    return 100.0 * (busy_s(pid) - before_s) / (time.perf_counter() - start_s)


def busy_s(pid: int) -> float:
    """Time in user and system mode that a process has taken so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")  # utime, stime
