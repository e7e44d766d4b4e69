"""A daemon whose link is recorded, so that what a client said and was answered can be held against docs/link.md."""

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path

from daemon_process import BOOT_LIMIT_S, INSTANCES, Daemon

from conformance import clients
from conformance.observation import frames, observe


@contextlib.contextmanager
def recorded(client: str | None, folder: Path, *arguments: str) -> Iterator[Daemon]:
    """A daemon that afterwards has met no fault, and left nothing unanswered that it answered `client` before."""
    with _running(folder, "--record", str(folder / "recording"), *arguments) as daemon:
        yield daemon
        assert daemon.stop() == 0, daemon.log
    assert ", 0 faults" in daemon.log
    if client is not None:
        tlog = max((folder / "recording").glob("*.tlog"), key=lambda path: path.stat().st_size)
        clients.note(client, observe(frames(tlog), daemon.instance + 1))


def _running(folder: Path, *arguments: str) -> Daemon:
    """A daemon that is up; another run of these tests may take an instance's ports between the look and the start."""
    for _ in INSTANCES:
        daemon = Daemon(folder, *arguments)
        end_s = time.monotonic() + BOOT_LIMIT_S
        while daemon.process.poll() is None and time.monotonic() < end_s:
            if "system id" in daemon.log:  # its banner
                return daemon
            time.sleep(0.05)
        with daemon:  # end it
            assert daemon.process.poll() is not None, f"not up within {BOOT_LIMIT_S:g} s"
        assert "--instance" in daemon.log, daemon.log
    raise AssertionError("all instances for tests are taken")
