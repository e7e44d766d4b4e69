"""The terminal that is drawn on: lines are put in place, and only what has changed of them is written."""

import contextlib
import os
import signal
import sys
from collections.abc import Sequence
from typing import Any

from rich.color import ColorSystem
from rich.console import Console
from rich.segment import Segment
from rich.text import Text

_ENTER = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[2J"  # a screen of its own, no cursor, no wrapping
_LEAVE = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"
_COLORS = {
    "standard": ColorSystem.STANDARD,
    "256": ColorSystem.EIGHT_BIT,
    "truecolor": ColorSystem.TRUECOLOR,
    "windows": ColorSystem.WINDOWS,
}
_ENDING = ("SIGTERM", "SIGHUP")


class Screen:
    """From entering to leaving, whatever the reason, the terminal is ours; then it is as it was before.

    A signal that would end the program leaves through SystemExit, with 128 and its number as every shell has it.
    """

    def __init__(self) -> None:
        self._console = Console(file=sys.stdout)
        self._shown: list[list[Segment]] = []
        self._size = (0, 0)
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> "Screen":
        for name in _ENDING:
            number = getattr(signal, name, None)
            if number is not None:
                self._handlers[number] = signal.signal(number, _end)
        self._write(_ENTER)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        with contextlib.suppress(OSError):  # the terminal may have gone
            self._write(_LEAVE)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and lines, now."""
        try:
            columns, lines = os.get_terminal_size(sys.stdout.fileno())
        except OSError:
            return 80, 24
        return columns or 80, lines or 24

    def is_resized(self) -> bool:
        """Since it was drawn on."""
        return self.size != self._size

    def draw(self, lines: Sequence[Text]) -> None:
        """The whole picture, from the top line down."""
        out = ""
        if self.is_resized():
            self._size, self._shown, out = self.size, [], "\x1b[0m\x1b[2J"
        width, height = self._size
        self._shown += [[] for _ in range(height - len(self._shown))]
        for row, text in enumerate(lines[:height]):
            new = self._segments(text, width)
            out += self._change(row, self._shown[row], new)
            self._shown[row] = new
        self._write(out)

    def _segments(self, text: Text, width: int) -> list[Segment]:
        """Of a line as wide as the screen."""
        text = text.copy()
        text.truncate(width, pad=True)
        segments = list(text.render(self._console))
        return list(Segment.remove_color(segments)) if self._console.no_color else segments

    def _change(self, row: int, old: list[Segment], new: list[Segment]) -> str:
        """What makes one line of the other: without what both begin with."""
        if old == new:
            return ""
        same = 0
        while same < min(len(old), len(new)) and old[same] == new[same]:
            same += 1
        column = Segment.get_line_length(new[:same])
        colors = _COLORS.get(self._console.color_system or "")
        drawn = (s.style.render(s.text, color_system=colors) if s.style else s.text for s in new[same:])
        return f"\x1b[{row + 1};{column + 1}H{''.join(drawn)}"

    def _write(self, text: str) -> None:
        if not text:
            return
        data = text.encode(sys.stdout.encoding or "utf-8", errors="replace")
        sys.stdout.flush()
        while data:
            data = data[os.write(sys.stdout.fileno(), data) :]


def _end(number: int, _frame: object) -> None:
    raise SystemExit(128 + number)
