"""What the dashboard writes to its terminal."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout

import pytest
from rich.text import Text

from gcs_tools.watch.screen import Screen


class Pipe:
    """In place of standard output: what was written since it was asked last."""

    def __init__(self) -> None:
        self._out, end = os.pipe()
        self.file = os.fdopen(end, "w", encoding="utf-8")

    def read(self) -> str:
        self.file.write("|")
        self.file.flush()
        return os.read(self._out, 1 << 16).decode()[:-1]


@contextmanager
def standard_output() -> Iterator[Pipe]:
    pipe = Pipe()
    with pipe.file, redirect_stdout(pipe.file):
        yield pipe


def test_only_what_has_changed_is_written() -> None:
    def picture(speed: str) -> list[Text]:
        return [Text("head"), Text().append("speed ", "dim").append(speed, "bold"), Text("foot")]

    with standard_output() as pipe, Screen() as screen:
        screen.draw(picture("1.25"))
        first = pipe.read()
        assert all(word in first for word in ("head", "speed", "1.25", "foot"))
        screen.draw(picture("1.25"))
        assert pipe.read() == ""
        screen.draw(picture("1.50"))
        assert pipe.read().rstrip() == "\x1b[2;7H1.50"


def test_what_a_shorter_text_leaves_behind_is_wiped() -> None:
    with standard_output() as pipe, Screen() as screen:
        screen.draw([Text("a long line")])
        pipe.read()
        screen.draw([Text("short")])
        assert pipe.read() == "\x1b[1;1H" + "short".ljust(80)


def test_the_terminal_is_given_back_after_a_mistake_too() -> None:
    with standard_output() as pipe:
        with pytest.raises(ZeroDivisionError), Screen():
            raise ZeroDivisionError
        assert pipe.read().endswith("\x1b[?25h\x1b[?1049l")
