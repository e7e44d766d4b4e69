"""The reading register: how each of the paper's equations is read, kept once, beside this file.

`docs/model.md` shows the same table; `python -m sitl.reproduce.register docs/model.md` puts it there after an edit.
"""

import sys
from pathlib import Path
from typing import NamedTuple

_SOURCE = Path(__file__).parent / "register.md"


class Reading(NamedTuple):
    printed: str
    problem: str
    reading: str
    evidence: str


def text() -> str:
    """The table in Markdown."""
    return _SOURCE.read_text(encoding="utf-8").strip() + "\n"


def readings() -> list[Reading]:
    """Its rows, with the Markdown of their cells."""
    rows = [line.strip().strip("|").split("|") for line in text().splitlines()[2:]]
    return [Reading(*(cell.strip() for cell in row)) for row in rows]


def put_into(document: str) -> str:
    """The document with its register, the table with the same heading, replaced by this one."""
    heading = text().splitlines()[0]
    lines = document.splitlines(keepends=True)
    start = next((i for i, line in enumerate(lines) if line.strip() == heading), None)
    if start is None:
        raise ValueError(f"no table that starts with {heading}")
    end = next((i for i in range(start, len(lines)) if not lines[i].startswith("|")), len(lines))
    return "".join([*lines[:start], text(), *lines[end:]])


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.write_text(put_into(target.read_text(encoding="utf-8")), encoding="utf-8")
