"""Small pictures of numbers, as text of a given width."""

import math
from collections.abc import Sequence

_EIGHTHS = " ▏▎▍▌▋▊▉█"
_LEVELS = " ▁▂▃▄▅▆▇█"


def bar(share: float, width: int) -> str:
    """Filled from the left, to an eighth of a cell. share: 0 to 1."""
    eighths = round(8 * width * _within(share, 0.0, 1.0))
    full, rest = divmod(eighths, 8)
    return ("█" * full + (_EIGHTHS[rest] if rest else "")).ljust(width)


def balance(share: float, width: int) -> str:
    """Filled from a zero mark in the middle, to half a cell. share: −1 to 1, positive to the right."""
    side = (width - 1) // 2
    halves = round(2 * side * abs(_within(share, -1.0, 1.0)))
    full, rest = divmod(halves, 2)
    if share >= 0.0:
        return (" " * side + "┃" + "█" * full + "▌" * rest).ljust(width)
    return ("▐" * rest + "█" * full).rjust(side) + "┃" + " " * (width - side - 1)


def sparkline(values: Sequence[float | None], height: int, low: float, high: float) -> list[str]:
    """One column a value, `height` lines from the top; nothing where there is no value."""
    span = high - low
    steps = [
        None if value is None else max(1, round(8 * height * _within((value - low) / span, 0.0, 1.0)))
        for value in values
    ]
    lines = []
    for line in reversed(range(height)):
        cells = (" " if step is None else _LEVELS[min(8, max(0, step - 8 * line))] for step in steps)
        lines.append("".join(cells))
    return lines


def nice(x: float) -> float:
    """The end of a scale for values up to x: a round number that isn't below it."""
    if x <= 0.0 or not math.isfinite(x):
        return 1.0
    ten = 10.0 ** math.floor(math.log10(x))
    return next(
        step * ten
        for step in (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
        if step * ten >= x * (1.0 - 1e-9)
    )


def fixed(x: float, digits: int, signed: bool = False) -> str:
    """A number with so many digits behind the point; what rounds to nothing has no sign, what is huge an exponent."""
    if abs(x) >= 1e6:
        return f"{x:.1e}"
    return f"{round(x, digits) + 0.0:{'+' if signed else ''}.{digits}f}"


def duration(seconds: float) -> str:
    """Minutes and seconds, hours where there are any."""
    minutes, s = divmod(int(max(0.0, seconds)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{s:02}" if hours else f"{minutes}:{s:02}"


def compass(heading_deg: float) -> str:
    """The arrow on a map with north up."""
    return "↑↗→↘↓↙←↖"[round(heading_deg / 45.0) % 8]


def printable(text: str) -> str:
    """A text of somebody else's, without what would act on the terminal."""
    return "".join(c if c.isprintable() else "·" for c in text)


def _within(x: float, low: float, high: float) -> float:
    return min(max(0.0 if math.isnan(x) else x, low), high)
