"""The reproduction's page: its tables, figures and register, in their sections."""

import re
from collections.abc import Sequence
from html import escape

from sitl import page as html
from sitl.drawing import Drawn
from sitl.page import Table
from sitl.reproduce import register
from sitl.reproduce.notes import Notes

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
    parts = {t.key: html.table(t, notes.get(t.key, [])) for t in tables}
    parts |= {d.plot.key: html.figure(d) for d in figures}
    sections = []
    for title, wanted in _SECTIONS:
        keys = [key for w in wanted for key in parts if key == w or (w.endswith("-") and key.startswith(w))]
        sections.append((title, "\n".join(parts.pop(key) for key in keys)))
    assert not parts, f"in no section: {', '.join(parts)}"
    sections.append(("Reading register", _register()))
    told = "Each flight again, from the folder of this report: one line each, in lockstep and to the bit."
    sections.append(("Commands and seeds", f"{html.notes([told])}<pre>{escape(chr(10).join(commands))}</pre>"))
    return html.document(_TITLE, summary, sections)


def _register() -> str:
    rows = "\n".join(f"<tr>{''.join(f'<td>{_inline(cell)}</td>' for cell in r)}</tr>" for r in register.readings())
    heads = ("paper, as printed", "problem", "reading here", "evidence, or where in the code")
    head = "".join(f"<th>{h}</th>" for h in heads)
    inner = f"<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody>"
    return f'<div class="scroll"><table class="register">{inner}</table></div>'


def _inline(markdown: str) -> str:
    """The few marks that the register uses: code and emphasis."""
    marked = re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(markdown))
    return re.sub(r"\*([^*]+)\*", r"<em>\1</em>", marked)
