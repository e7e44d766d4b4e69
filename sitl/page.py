"""A report as one HTML file that needs no other, made of tables, figures and notes. Its look is in page.css."""

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

from sitl.drawing import Drawn

_CSS = Path(__file__).parent / "page.css"


class Cell(NamedTuple):
    text: str
    value: float | None = None
    better: bool | None = None  # as it should be, or not; None: not judged
    span: int = 1  # columns that it fills


class Row(NamedTuple):
    """heading: starts a part of the table."""

    label: str
    cells: list[Cell]
    heading: str = ""


class Group(NamedTuple):
    """Columns under one heading."""

    title: str
    columns: tuple[str, ...]


class Table(NamedTuple):
    key: str
    title: str
    groups: list[Group]
    rows: list[Row]


def told(value: float, digits: int, signed: bool = False) -> str:
    """A number as text, with a true minus sign and without a sign where nothing but zeros is left."""
    text = f"{value:+.{digits}f}" if signed else f"{value:.{digits}f}"
    if not text.strip("+-0."):
        text = text.lstrip("+-")
    return text.replace("-", "−")


def document(title: str, summary: Sequence[str], sections: Sequence[tuple[str, str]]) -> str:
    """The whole page. summary: what is said first; sections: title and HTML."""
    links = "".join(f'<a href="#{_anchor(name)}">{escape(name)}</a>' for name, _ in sections)
    body = "\n".join(
        f'<section><h2 id="{_anchor(name)}">{escape(name)}</h2>\n{html}</section>' for name, html in sections
    )
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{_CSS.read_text(encoding='utf-8')}</style>\n"
        f"</head>\n<body>\n<h1>{escape(title)}</h1>\n{notes(summary)}<nav>{links}</nav>\n{body}\n</body>\n</html>\n"
    )


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def table(t: Table, remarks: Sequence[str] = (), look: str = "") -> str:
    """look: `words` for cells that are text."""
    starts, at = set(), 0
    for group in t.groups:
        starts.add(at)
        at += len(group.columns)
    head = "".join(f'<th class="first" colspan="{len(g.columns)}">{escape(g.title)}</th>' for g in t.groups)
    columns = "".join(
        f'<th class="first">{escape(c)}</th>' if i == 0 else f"<th>{escape(c)}</th>"
        for g in t.groups
        for i, c in enumerate(g.columns)
    )
    top = f"<tr><th></th>{head}</tr>" if any(g.title for g in t.groups) else ""
    kind = f' class="{look}"' if look else ""
    return (
        f'<h3 id="{t.key}">{escape(t.title)}</h3>\n<div class="scroll"><table{kind}>\n<thead>{top}'
        f"<tr><th></th>{columns}</tr></thead>\n<tbody>\n{''.join(_row(row, starts, at) for row in t.rows)}"
        f"</tbody></table></div>\n{notes(remarks)}"
    )


def beside(parts: Sequence[str]) -> str:
    """Beside each other as far as there is room."""
    return f'<div class="beside">{"".join(f"<div>{part}</div>" for part in parts)}</div>'


def _row(row: Row, starts: set[int], width: int) -> str:
    """A row, after its part's heading where it starts one. starts: columns that begin a group."""
    heading = f'<tr class="part"><th colspan="{width + 1}">{escape(row.heading)}</th></tr>\n' if row.heading else ""
    cells, at = [], 0
    for cell in row.cells:
        cells.append(_cell(cell, at in starts))
        at += cell.span
    return f'{heading}<tr><th scope="row">{escape(row.label)}</th>{"".join(cells)}</tr>\n'


def _cell(cell: Cell, first: bool) -> str:
    words = ["first"] if first else []
    if cell.better is not None:
        words.append("good" if cell.better else "bad")
    classes = f' class="{" ".join(words)}"' if words else ""
    span = f' colspan="{cell.span}"' if cell.span > 1 else ""
    return f"<td{classes}{span}>{escape(cell.text)}</td>"


def notes(lines: Sequence[str]) -> str:
    if len(lines) < 2:
        return "".join(f'<p class="note">{escape(line)}</p>\n' for line in lines)
    return f'<ul class="note">{"".join(f"<li>{escape(line)}</li>" for line in lines)}</ul>\n'


def figure(drawn: Drawn) -> str:
    plot = drawn.plot
    data = base64.b64encode(drawn.svg).decode()
    return (
        f'<figure id="{plot.key}"><img alt="{escape(plot.title)}" src="data:image/svg+xml;base64,{data}">'
        f"<figcaption><b>{escape(plot.title)}</b>{escape(plot.note)}</figcaption></figure>"
    )
