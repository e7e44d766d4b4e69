"""Programs that are told to stop by Ctrl-C, as processes of their own."""

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def program(module: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """`python -m module arguments…` in a group of its own, its outputs to be read; dead after the block."""
    process = subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def interrupted(process: subprocess.Popen[str], *, group: bool = False) -> tuple[str, str]:
    """Stop it (with all of its group, as a terminal does): what it still says, on both outputs, before it ends well."""
    os.killpg(process.pid, signal.SIGINT) if group else process.send_signal(signal.SIGINT)
    told, complained = process.communicate(timeout=30)
    assert process.returncode == 130, complained
    assert "Traceback" not in complained
    return told, complained
