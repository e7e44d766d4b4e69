"""A terminal for the tests in this folder: a program runs in it, and what it has drawn can be read."""

import fcntl
import os
import re
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable

from daemon_process import ROOT

LIMIT_S = 20.0
_PIECES = re.compile(r"\x1b\[([?0-9;]*)([A-Za-z])|([^\x1b])")


class Terminal:
    """`gcs` with these arguments, in a terminal of its own."""

    def __init__(self, *arguments: str, columns: int = 80, lines: int = 24, **environment: str) -> None:
        self._master, self._slave = os.openpty()
        self.resize(columns, lines)
        self._before = termios.tcgetattr(self._slave)
        self.output = b""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "gcs_tools", *arguments],
            stdin=self._slave,
            stdout=self._slave,
            stderr=self._slave,
            cwd=ROOT,
            env=os.environ | {"TERM": "xterm-256color"} | environment,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )

    def resize(self, columns: int, lines: int) -> None:
        self._columns, self._lines = columns, lines
        fcntl.ioctl(self._master, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))

    def press(self, keys: str) -> None:
        os.write(self._master, keys.encode())

    def until(self, fits: Callable[[str], bool]) -> str:
        """The screen as soon as it fits."""
        end_s = time.monotonic() + LIMIT_S
        while not fits(screen := self.screen()):
            assert self._hear(end_s - time.monotonic()), f"it never showed; this did:\n{screen}"
        return screen

    def end(self) -> int:
        """Wait for the program's end; its exit status. The terminal must be as it was before."""
        end_s = time.monotonic() + LIMIT_S
        while self.process.poll() is None:
            self._hear(0.1)
            assert time.monotonic() < end_s, "it never ended"
        while self._hear(0.1):
            pass
        assert termios.tcgetattr(self._slave) == self._before
        assert self.output.count(b"\x1b[?1049h") == self.output.count(b"\x1b[?1049l") == 1
        assert self.output.rindex(b"\x1b[?25h") > self.output.rindex(b"\x1b[?25l")
        return self.process.returncode

    @property
    def said(self) -> str:
        """What it said after giving the screen back."""
        return self.output.partition(b"\x1b[?1049l")[2].decode()

    def _hear(self, seconds: float) -> bool:
        """Whether something was drawn within a time."""
        if not select.select([self._master], [], [], max(0.0, seconds))[0]:
            return False
        self.output += os.read(self._master, 65536)
        return True

    def screen(self) -> str:
        """What stands on the screen now, as far as it was drawn with what the dashboard uses."""
        cells = [[" "] * self._columns for _ in range(self._lines)]
        line = column = 0
        for arguments, kind, character in _PIECES.findall(self.output.decode(errors="ignore")):
            if kind == "J":
                cells = [[" "] * self._columns for _ in range(self._lines)]
            elif kind == "H":
                line, column = (int(x) - 1 for x in arguments.split(";"))
            elif character and line < self._lines and column < self._columns:
                cells[line][column] = character
                column += 1
        return "\n".join("".join(row).rstrip() for row in cells)

    def __enter__(self) -> "Terminal":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait(10)
        os.close(self._master)
        os.close(self._slave)
