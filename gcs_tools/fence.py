"""A fence's geometry as a client sees it: its areas, and which places and ways they shut out.

A fence is kept as the items that MAVLink has for it: a polygon is a run of vertices that all tell how many they are, a
circle is one item, and there may be a point to return to. A place must be inside all inclusion areas of at least one
group, and outside every exclusion. The vehicle judges likewise (sitl/onboard/fence.py); a test holds the two together.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools.plan import Item
from gcs_tools.reference import Vector

RETURN_POINT, RALLY_POINT = 5000, 5100  # MAV_CMD
POLYGON = {True: 5001, False: 5002}  # by inclusion
CIRCLE = {True: 5003, False: 5004}

_TOLD = 8  # areas, one by one

Level = tuple[float, float]  # north, east [m]
Levels = NDArray[np.float64]  # (n, 2)


class Area(NamedTuple):
    """A polygon (its corners) or a circle (its centre and radius), north and east [m]; `item` is its first's index."""

    item: int
    inclusion: bool
    group: int
    corners_m: tuple[Level, ...]
    radius_m: float = 0.0

    @property
    def is_circle(self) -> bool:
        return len(self.corners_m) == 1

    @property
    def size_m2(self) -> float:
        if self.is_circle:
            return math.pi * self.radius_m**2
        return abs(sum(a[0] * b[1] - a[1] * b[0] for a, b in self._sides())) / 2.0

    @property
    def reason(self) -> str:
        """What a place violates, in the vehicle's words."""
        what = "circle" if self.is_circle else "polygon"
        where = f"outside the {what}" if self.inclusion else f"inside the forbidden {what}"
        return f"{where} of fence item {self.item}"

    def _sides(self) -> list[tuple[Level, Level]]:
        return list(zip((self.corners_m[-1], *self.corners_m), self.corners_m, strict=False))

    def violated(self, places: Levels) -> NDArray[np.bool_]:
        """(n,) whether each place is on the wrong side."""
        north, east = places[:, 0], places[:, 1]
        if self.is_circle:
            inside = np.hypot(north - self.corners_m[0][0], east - self.corners_m[0][1]) < self.radius_m
        else:
            inside = np.zeros(len(places), dtype=bool)
            for (n2, e2), (n1, e1) in self._sides():  # how often a ray to the north crosses them
                if e1 != e2:
                    inside ^= ((e1 > east) != (e2 > east)) & (n1 + (n2 - n1) / (e2 - e1) * (east - e1) > north)
        wrong: NDArray[np.bool_] = inside != self.inclusion
        return wrong

    def crossings(self, a: Level, b: Level) -> list[float]:
        """Shares of the straight way from a to b, 0 to 1, at which it meets the border."""
        way = b[0] - a[0], b[1] - a[1]
        if self.is_circle:
            from_centre = a[0] - self.corners_m[0][0], a[1] - self.corners_m[0][1]
            square = way[0] ** 2 + way[1] ** 2
            along = way[0] * from_centre[0] + way[1] * from_centre[1]
            root = along**2 - square * (from_centre[0] ** 2 + from_centre[1] ** 2 - self.radius_m**2)
            met = root >= 0.0 and square > 0.0
            found = [(-along + sign * math.sqrt(root)) / square for sign in (-1.0, 1.0)] if met else []
        else:
            corners = np.array(self.corners_m)
            side, to = corners - np.roll(corners, 1, axis=0), np.roll(corners, 1, axis=0) - a
            across = way[0] * side[:, 1] - way[1] * side[:, 0]
            side, to, across = side[across != 0.0], to[across != 0.0], across[across != 0.0]
            of_side = (to[:, 0] * way[1] - to[:, 1] * way[0]) / across
            found = ((to[:, 0] * side[:, 1] - to[:, 1] * side[:, 0]) / across)[
                (of_side >= 0.0) & (of_side <= 1.0)
            ].tolist()
        return [share for share in found if 0.0 < share < 1.0]


def areas(items: Sequence[Item], place: Callable[[Item], Vector | None]) -> list[Area]:
    """The areas of a fence's items; place: where an item is. Empty where one's place isn't known."""
    found, k = [], 0
    while k < len(items):
        item = items[k]
        count = max(1, int(item.param1)) if item.command in POLYGON.values() else 1
        corners = [p[:2] for p in map(place, items[k : k + count]) if p is not None]
        if len(corners) != len(items[k : k + count]):
            return []
        if item.command != RETURN_POINT:
            inclusion = item.command in (POLYGON[True], CIRCLE[True])
            radius = item.param1 if item.command in CIRCLE.values() else 0.0
            found.append(Area(k, inclusion, int(item.param2), tuple(corners), radius))
        k += count
    return found


def verdicts(fence: Sequence[Area], places: Sequence[Level]) -> list[Area | None]:
    """Of each place the area that it violates, None where it lies within the fence."""
    found: list[Area | None] = [None] * len(places)
    if not fence or not places:
        return found
    violated = np.array([area.violated(np.array(places, dtype=float)) for area in fence])
    for k in np.flatnonzero(violated.any(axis=0)).tolist():
        found[k] = _shut_out(fence, violated[:, k].tolist())
    return found


def first_outside(fence: Sequence[Area], places: Sequence[Level]) -> tuple[int, Area] | None:
    """The first of the places that the fence shuts out, by index, and the area that it violates."""
    return next(((k, area) for k, area in enumerate(verdicts(fence, places)) if area is not None), None)


def _shut_out(fence: Sequence[Area], violated: Sequence[bool]) -> Area | None:
    refusing: dict[int, Area | None] = {}  # by group: its first area that doesn't contain the place
    for area, wrong in zip(fence, violated, strict=True):
        if area.inclusion:
            refusing[area.group] = refusing.get(area.group) or (area if wrong else None)
        elif wrong:
            return area
    return None if None in refusing.values() else next(iter(refusing.values()), None)


def leaves(fence: Sequence[Area], ways: Sequence[tuple[Level, Level]]) -> list[tuple[float, Area] | None]:
    """Where each straight way first lies outside, the share of it gone there, 0 to 1, and the area violated."""
    pieces: list[tuple[int, float]] = []  # of which way, and where it begins
    middles: list[Level] = []
    for k, (a, b) in enumerate(ways):
        for begin, end in pairwise(sorted({0.0, 1.0, *(share for area in fence for share in area.crossings(a, b))})):
            share = (begin + end) / 2.0
            pieces.append((k, begin))
            middles.append((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
    found: list[tuple[float, Area] | None] = [None] * len(ways)
    for (k, begin), area in zip(pieces, verdicts(fence, middles), strict=True):
        if area is not None and found[k] is None:
            found[k] = begin, area
    return found


def summary(fence: Sequence[Area]) -> str:
    """The areas in words: "within a polygon of 4 corners (320 m²), outside a circle of radius 2 m (13 m²)"."""
    more = f", and {len(fence) - _TOLD} more" if len(fence) > _TOLD else ""
    told = ", ".join(
        f"{'within' if a.inclusion else 'outside'} a "
        + (f"circle of radius {a.radius_m:g} m" if a.is_circle else f"polygon of {len(a.corners_m)} corners")
        + f" ({a.size_m2:.0f} m²{f', group {a.group}' if a.group else ''})"
        for a in fence[:_TOLD]
    )
    return told + more
