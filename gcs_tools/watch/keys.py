"""Keys as they are pressed, where standard input is a terminal; elsewhere none are."""

import contextlib
import os
import select
import sys
from typing import Any

_NAMES = {
    "\x1b[A": "previous",
    "\x1b[D": "previous",
    "\x1bOA": "previous",
    "\x1bOD": "previous",
    "\x1b[B": "next",
    "\x1b[C": "next",
    "\x1bOB": "next",
    "\x1bOC": "next",
    "\t": "next",
    " ": "pause",
    "q": "quit",
    "Q": "quit",
    "\x04": "quit",
}


class Keys:
    """From entering to leaving, keys come without Enter and aren't echoed; Ctrl-C does what it always does."""

    def __init__(self) -> None:
        self._before: Any = None
        self._stdin = -1

    @property
    def are_read(self) -> bool:
        return self._before is not None

    def __enter__(self) -> "Keys":
        if sys.stdin is not None and sys.stdin.isatty():
            import termios
            import tty

            self._stdin = sys.stdin.fileno()
            self._before = termios.tcgetattr(self._stdin)
            tty.setcbreak(self._stdin)
            # Ctrl-Z would leave the shell in the dashboard's screen
            now = termios.tcgetattr(self._stdin)
            now[6][termios.VSUSP] = os.fpathconf(self._stdin, "PC_VDISABLE").to_bytes(1, "little")
            termios.tcsetattr(self._stdin, termios.TCSANOW, now)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            import termios

            with contextlib.suppress(termios.error):  # the terminal may have gone
                termios.tcsetattr(self._stdin, termios.TCSADRAIN, self._before)
            self._before = None

    def read(self) -> list[str]:
        """What was pressed since: "quit", "pause", "previous", "next", "1" to "9"."""
        if self._before is None or not select.select([self._stdin], [], [], 0.0)[0]:
            return []
        data = os.read(self._stdin, 1024)
        if not data:  # the terminal has gone
            self._before = None
        return decode(data.decode("ascii", errors="ignore"))


def decode(text: str) -> list[str]:
    """The keys in what a terminal sent, without those that mean nothing here."""
    found, at = [], 0
    while at < len(text):
        length = 3 if text[at : at + 2] in ("\x1b[", "\x1bO") else 1
        key = text[at : at + length]
        at += length
        if key in _NAMES:
            found.append(_NAMES[key])
        elif key.isdecimal() and key != "0":
            found.append(key)
    return found
