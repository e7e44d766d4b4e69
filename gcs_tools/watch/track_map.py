"""A map with north up, in Braille dots: where the vehicle has been, where it is, and where it should be."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from gcs_tools.watch.gauges import nice

Place = tuple[float, float]  # north, east [m]

_LEAST_M = 4.0  # across: a hovering vehicle looks still
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # of a Braille cell: four rows of two dots


class Drawn(NamedTuple):
    lines: list[list[str]]  # one character each, from the north-west corner
    marks: dict[tuple[int, int], str]  # (line, column) → which mark stands there
    metres_a_cell: float  # from column to column


def draw(track: Sequence[Place], marks: Sequence[tuple[str, Place]], width: int, height: int) -> Drawn:
    """The track and marks, as large as they fit into width × height cells; metres are alike in both directions."""
    marks = [(mark, place) for mark, place in marks if math.isfinite(place[0] + place[1])]
    everything = [*track, *(place for _, place in marks)] or [(0.0, 0.0)]
    norths, easts = [p[0] for p in everything], [p[1] for p in everything]
    centre_n, centre_e = 0.5 * (min(norths) + max(norths)), 0.5 * (min(easts) + max(easts))
    tall_m, wide_m = max(norths) - min(norths), max(easts) - min(easts)
    dots_x, dots_y = 2 * width - 4, 4 * height - 8  # a margin for marks
    per_dot = nice(max(wide_m / max(dots_x, 1), tall_m / max(dots_y, 1), _LEAST_M / max(dots_x, dots_y, 1)))

    def dot(place: Place) -> tuple[int, int]:
        return (
            round(2 * height - 0.5 - (place[0] - centre_n) / per_dot),
            round(width - 0.5 + (place[1] - centre_e) / per_dot),
        )

    cells = [[0] * width for _ in range(height)]
    for y, x in _line(list(map(dot, track))):
        if 0 <= y < 4 * height and 0 <= x < 2 * width:
            cells[y // 4][x // 2] |= _BITS[y % 4][x % 2]
    lines = [[chr(0x2800 + bits) if bits else " " for bits in row] for row in cells]
    at: dict[tuple[int, int], str] = {}
    for mark, place in marks:
        y, x = dot(place)
        line, column = min(max(y // 4, 0), height - 1), min(max(x // 2, 0), width - 1)
        lines[line][column] = mark
        at[line, column] = mark
    return Drawn(lines, at, 2.0 * per_dot)


def _line(dots: Sequence[tuple[int, int]]) -> Iterable[tuple[int, int]]:
    """The dots and those between each and the next."""
    yield from dots[:1]
    for (y0, x0), (y1, x1) in pairwise(dots):
        steps = max(abs(y1 - y0), abs(x1 - x0), 1)
        for k in range(1, steps + 1):
            yield round(y0 + (y1 - y0) * k / steps), round(x0 + (x1 - x0) * k / steps)
