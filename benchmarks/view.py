"""The viewer: its share of a core, how often it moves the vehicle on the page, and what it costs the daemon's loop.

The loop runs in this process as in `lateness`, hovering at 1 ×, beside a loop that only sleeps; without the viewer and
with it, in turns. The viewer is a process of its own; a third takes all that a browser would be sent, without drawing,
as drawing in software would take both cores. Where there is a Chromium the share is told with it attached, too.
"""

import contextlib
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.cpu import busy_s
from benchmarks.figure import Figure, at_least, at_most, spread, told
from benchmarks.lateness import SETTLE_S, Recorded, assembled, beside, turn
from benchmarks.processes import BenchmarkError, free_instance, running, start, zenoh_endpoint
from sitl.daemon.config import RunConfig
from sitl.daemon.loop import Loop

ROUNDS = 2
WINDOW_S = 8.0
WARM_S = 4.0  # the viewer has connected and drawn the vehicle
CHROMIUM = (
    "chromium", "--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--remote-debugging-port=0", "--window-size=640,480",
)  # fmt: skip


def measure(quick: bool) -> Iterator[Figure]:
    if not sys.platform.startswith("linux"):
        raise BenchmarkError("it is read from /proc, which only Linux has")
    config = RunConfig(instance=free_instance(), settings=(("SIM_GUST", 0.5),))  # so that its pose changes always
    port = _free_port()
    shares: list[float] = []
    rates: list[float] = []
    late: list[Figure] = []
    with assembled(config) as loop:
        for _ in range(1 if quick else ROUNDS):
            late += beside(loop, "viewer off", subscribed=False)
            with _viewer(config.instance, port) as viewer, _listener(port, config.instance) as heard:
                turn(loop, Recorded(), WARM_S)
                heard.clear()
                shares.append(_share(loop, viewer.pid))
                rates += heard
                late += beside(loop, "viewer on, one browser's messages taken")
        if not rates:
            raise BenchmarkError("the page was sent nothing")
        yield at_least(
            "viewer, vehicle hovering in gusts: pose updates on the page", [statistics.median(rates)], 29.0, "per s"
        )
        yield at_most("viewer: share of a core, one vehicle, one browser", shares, 25.0, "% of a core")
        yield from late
        if shutil.which(CHROMIUM[0]):
            drawn = _with_chromium(loop, config.instance, port)
            yield told("  the same share with a Chromium that draws in software", spread(drawn, "% of a core"))


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def _viewer(instance: int, port: int) -> Iterator[subprocess.Popen[str]]:
    """`gcs view` on this instance, from when it serves."""
    arguments = ("view", "--connect", zenoh_endpoint(instance), "--port", str(port))
    process = start("gcs_tools", *arguments, stdout=subprocess.PIPE)
    with running(process):
        assert process.stdout is not None
        if "http" not in process.stdout.readline():
            raise BenchmarkError("the viewer does not serve: pip install 'yawsitter-sitl[view]'")
        yield process


@contextlib.contextmanager
def _listener(port: int, instance: int) -> Iterator[list[float]]:
    """Pose updates a second as somebody who takes all of the page's messages counts them."""
    process = start("benchmarks.page_listener", str(port), str(instance), stdout=subprocess.PIPE)
    heard: list[float] = []
    assert process.stdout is not None
    output = process.stdout
    reader = threading.Thread(target=lambda: heard.extend(float(line) for line in output), daemon=True)
    reader.start()
    with running(process):
        yield heard
    reader.join(2.0)


def _share(loop: Loop, pid: int) -> float:
    """Percent of a core that the process takes while the vehicle flies."""
    begun_s, before_s = time.perf_counter(), busy_s(pid)
    turn(loop, Recorded(), WINDOW_S)
    return 100.0 * (busy_s(pid) - before_s) / (time.perf_counter() - begun_s)


def _with_chromium(loop: Loop, instance: int, port: int) -> list[float]:
    """The viewer's share with a browser that draws what it is sent, as the system lets it."""
    shares = []
    with tempfile.TemporaryDirectory(prefix="yawsitter-benchmark-") as folder, _viewer(instance, port) as viewer:
        command = ["nice", "-n", "19", *CHROMIUM, f"--user-data-dir={Path(folder)}", f"http://127.0.0.1:{port}"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "stdin": subprocess.DEVNULL}
        with running(subprocess.Popen(command, text=True, **quiet)):  # type: ignore[call-overload]
            turn(loop, Recorded(), WARM_S + SETTLE_S)
            shares += [_share(loop, viewer.pid) for _ in range(2)]
    return shares
