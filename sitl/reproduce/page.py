"""The report as one HTML file that needs no other: tables, figures and register in it."""

import base64
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path

from sitl.drawing import Drawn
from sitl.reproduce import register
from sitl.reproduce.notes import Notes
from sitl.reproduce.tables import Cell, Row, Table

_CSS = Path(__file__).parent / "page.css"
_TITLE = "YawSitter: the paper's evaluation, measured"
# section title → its tables' and figures' keys, in this order; a key that ends with “-” takes all that begin so
_SECTIONS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("Summary", ("overview", "summary")),
    ("Tracking", ("rectangle-true", "rectangle-reported", "circle-true", "circle-reported", "seeds")),
    ("Ranges and trim", ("ranges", "trim")),
    ("The rectangle in flight", ("rectangle-",)),
    ("The circle in flight", ("circle-",)),
    ("Paths in space", ("paths",)),
    ("Coefficients", ("coefficients",)),
    ("Ablations", ("ablations",)),
    ("Loop analysis", ("readings", "poles", "loops", "limits", "margins-")),
    ("Beyond the paper", ("trials", "steps", "recoveries")),
)


def page(
    tables: Sequence[Table], figures: Sequence[Drawn], notes: Notes, commands: Sequence[str], summary: Sequence[str]
) -> str:
    """The whole page. summary: what is said first; commands: how each flight is flown again."""
    parts = {**{t.key: _table(t, notes.get(t.key, [])) for t in tables}, **{d.plot.key: _figure(d) for d in figures}}
    sections = []
    for title, wanted in _SECTIONS:
        keys = [key for w in wanted for key in parts if key == w or (w.endswith("-") and key.startswith(w))]
        sections.append((title, "\n".join(parts.pop(key) for key in keys)))
    assert not parts, f"in no section: {', '.join(parts)}"
    sections.append(("Reading register", _register()))
    told = "Each flight again, from the folder of this report: one line each, in lockstep and to the bit."
    sections.append(("Commands and seeds", f"{_notes([told])}<pre>{escape(chr(10).join(commands))}</pre>"))
    links = "".join(f'<a href="#{_anchor(title)}">{escape(title)}</a>' for title, _ in sections)
    body = "\n".join(
        f'<section><h2 id="{_anchor(title)}">{escape(title)}</h2>\n{html}</section>' for title, html in sections
    )
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_TITLE}</title>\n<style>\n{_CSS.read_text(encoding='utf-8')}</style>\n"
        f"</head>\n<body>\n<h1>{_TITLE}</h1>\n{_notes(summary)}<nav>{links}</nav>\n{body}\n</body>\n</html>\n"
    )


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _cell(cell: Cell, first: bool) -> str:
    words = ["first"] if first else []
    if cell.better is not None:
        words.append("good" if cell.better else "bad")
    classes = f' class="{" ".join(words)}"' if words else ""
    span = f' colspan="{cell.span}"' if cell.span > 1 else ""
    return f"<td{classes}{span}>{escape(cell.text)}</td>"


def _table(table: Table, notes: Sequence[str]) -> str:
    starts, at = set(), 0
    for group in table.groups:
        starts.add(at)
        at += len(group.columns)
    head = "".join(f'<th class="first" colspan="{len(g.columns)}">{escape(g.title)}</th>' for g in table.groups)
    columns = "".join(
        f'<th class="first">{escape(c)}</th>' if i == 0 else f"<th>{escape(c)}</th>"
        for g in table.groups
        for i, c in enumerate(g.columns)
    )
    top = f"<tr><th></th>{head}</tr>" if any(g.title for g in table.groups) else ""
    return (
        f'<h3 id="{table.key}">{escape(table.title)}</h3>\n<div class="scroll"><table>\n<thead>{top}'
        f"<tr><th></th>{columns}</tr></thead>\n<tbody>\n{''.join(_row(row, starts, at) for row in table.rows)}"
        f"</tbody></table></div>\n{_notes(notes)}"
    )


def _row(row: Row, starts: set[int], width: int) -> str:
    """A row, after its part's heading where it starts one. starts: columns that begin a group."""
    heading = f'<tr class="part"><th colspan="{width + 1}">{escape(row.heading)}</th></tr>\n' if row.heading else ""
    cells, at = [], 0
    for cell in row.cells:
        cells.append(_cell(cell, at in starts))
        at += cell.span
    return f'{heading}<tr><th scope="row">{escape(row.label)}</th>{"".join(cells)}</tr>\n'


def _notes(lines: Sequence[str]) -> str:
    if len(lines) < 2:
        return "".join(f'<p class="note">{escape(line)}</p>\n' for line in lines)
    return f'<ul class="note">{"".join(f"<li>{escape(line)}</li>" for line in lines)}</ul>\n'


def _figure(drawn: Drawn) -> str:
    plot = drawn.plot
    data = base64.b64encode(drawn.svg).decode()
    return (
        f'<figure id="{plot.key}"><img alt="{escape(plot.title)}" src="data:image/svg+xml;base64,{data}">'
        f"<figcaption><b>{escape(plot.title)}</b>{escape(plot.note)}</figcaption></figure>"
    )


def _register() -> str:
    rows = "\n".join(f"<tr>{''.join(f'<td>{_inline(cell)}</td>' for cell in r)}</tr>" for r in register.readings())
    heads = ("paper, as printed", "problem", "reading here", "evidence, or where in the code")
    head = "".join(f"<th>{h}</th>" for h in heads)
    inner = f"<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody>"
    return f'<div class="scroll"><table class="register">{inner}</table></div>'


def _inline(markdown: str) -> str:
    """The few marks that the register uses: code and emphasis."""
    html = escape(markdown)
    html = re.sub(r"`([^`]+)`", r"<code>\1</code>", html)
    return re.sub(r"\*([^*]+)\*", r"<em>\1</em>", html)
