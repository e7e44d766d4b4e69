"""The pipe to the process that writes flights: what all vehicles record goes through it, each in its own channel.

The loop never touches the disk and never waits: what the pipe has no room for stays here. Light to import: the process
is started before the vehicles are built.
"""

import contextlib
import importlib.util
import logging
import os
import struct
import subprocess
import sys

from sitl.daemon.config import SettingError

log = logging.getLogger(__name__)

HEAD = struct.Struct("<cBI")  # what follows, whose (an instance), and how many bytes of it
BEGIN, FRAME, STEPS, TOPIC, END = b"B", b"F", b"S", b"M", b"E"

BACKLOG_MAX = 1 << 26  # bytes waiting for the pipe
_PIPE_BYTES = 1 << 20
_CLOSE_S = 20.0


class FlightPipe:
    """Raises SettingError where flights can't be written at all."""

    def __init__(self) -> None:
        self.backlog = bytearray()
        self.closing: dict[str, tuple[int, int]] = {}  # flights that are over but not yet on disk: steps kept, seen
        if importlib.util.find_spec("mcap") is None:
            raise SettingError("--record needs the package mcap: pip install 'yawsitter-sitl[record]'")
        command = [sys.executable, "-m", "sitl.daemon.flight_writer"]
        self.process: subprocess.Popen[bytes] | None = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self._pipe, self._done = self.process.stdin.fileno(), self.process.stdout.fileno()
        os.set_blocking(self._pipe, False)
        os.set_blocking(self._done, False)
        with contextlib.suppress(ImportError, AttributeError, OSError):  # Linux alone lets a pipe hold more
            import fcntl

            fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)

    @property
    def works(self) -> bool:
        """Whether there still is somebody who writes."""
        return self.process is not None

    def put(self, kind: bytes, instance: int, data: bytes) -> bool:
        """False: there is no room for it."""
        if self.process is None or len(self.backlog) + len(data) > BACKLOG_MAX:
            return False
        self.backlog += HEAD.pack(kind, instance, len(data))
        self.backlog += data
        return True

    def pump(self) -> None:
        """Hand over what the pipe has room for, without waiting."""
        try:
            while self.backlog:
                del self.backlog[: os.write(self._pipe, self.backlog)]
        except BlockingIOError:
            pass
        except OSError as error:
            self._fail(error.strerror or str(error))
        if self.closing:
            self._hear()

    def _hear(self) -> None:
        """Which flights are on disk."""
        with contextlib.suppress(BlockingIOError):
            for name in os.read(self._done, 1 << 16).decode().split():
                kept, seen = self.closing.pop(name)
                log.info("recorded %s: %d of %d control steps", name, kept, seen)

    def _fail(self, why: str) -> None:
        if self.process is not None:
            log.error("recording stopped: %s", why)
            process, self.process = self.process, None
            self.backlog.clear()
            self.closing.clear()
            process.kill()
            process.wait()

    def close(self) -> None:
        """Wait until all is on disk. The flights under way are to be ended before."""
        if self.process is None:
            return
        os.set_blocking(self._pipe, True)
        self.pump()
        if self.process is None:
            return
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(_CLOSE_S)
            self._hear()
            self.process = None
        except subprocess.TimeoutExpired:
            self._fail("its process doesn't end")
