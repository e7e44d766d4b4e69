"""What all parts of the dashboard are made of: styles, and lines of text."""

from rich.text import Text

DIM, TITLE, NUMBER, GOOD, WARN, BAD = "dim", "bold cyan", "bold", "green", "yellow", "bold red"


def label(text: str, width: int) -> Text:
    """The begin of a line, to append to."""
    return Text().append(text.ljust(width), DIM)


def rule(title: str, width: int) -> Text:
    """A line that begins a block."""
    text = Text().append("─ ", DIM).append(title, TITLE).append(" ")
    return text.append("─" * max(0, width - text.cell_len), DIM)


def beside(left: Text, right: Text, width: int) -> Text:
    """Both on one line, the right one at its end; where there isn't room the left one gives way."""
    room = max(0, width - right.cell_len - 1)
    left = left.copy()
    left.truncate(room, overflow="ellipsis", pad=True)
    return left.append(" ").append_text(right)


def join(left: list[Text], right: list[Text], column: int, gap: int) -> list[Text]:
    """Both blocks side by side, the right one from this column on."""
    made = []
    for k in range(max(len(left), len(right))):
        line = left[k].copy() if k < len(left) else Text()
        line.truncate(column - gap, pad=True)
        made.append(line.append(" " * gap).append_text(right[k] if k < len(right) else Text()))
    return made
