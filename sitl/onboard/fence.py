"""The stored fence: areas to stay within, areas to stay out of, and a point to return to.

MAVLink's fence items. A polygon is a run of vertices that all tell how many they are; a circle is one item. Inclusion
areas belong to a group (param2): the vehicle must be inside all areas of at least one group, and outside every
exclusion. Areas have no height.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.onboard.events import EventLog
from sitl.onboard.places import Places
from sitl.onboard.plan import Fault, Finding, MissionItem, Plan, coordinates, in_range, plain, reserved
from sitl.onboard.store import Store
from sitl.quaternion import Vec3

_RADIUS_MAX_M = 1e5
_LEAST_CORNERS = 3


class FenceCommand(IntEnum):
    """MAV_CMD, those that a fence may hold."""

    RETURN_POINT = 5000
    POLYGON_INCLUSION = 5001
    POLYGON_EXCLUSION = 5002
    CIRCLE_INCLUSION = 5003
    CIRCLE_EXCLUSION = 5004


_POLYGONS = (FenceCommand.POLYGON_INCLUSION, FenceCommand.POLYGON_EXCLUSION)
_CIRCLES = (FenceCommand.CIRCLE_INCLUSION, FenceCommand.CIRCLE_EXCLUSION)
_INCLUSIONS = (FenceCommand.POLYGON_INCLUSION, FenceCommand.CIRCLE_INCLUSION)


class Sides(NamedTuple):
    """A polygon's sides as lines north = n + slope (east − e), each between its own east and that of its end."""

    north_m: NDArray[np.float64]
    east_m: NDArray[np.float64]
    end_east_m: NDArray[np.float64]
    slope: NDArray[np.float64]

    @classmethod
    def of(cls, corners: Sequence[tuple[float, float]]) -> "Sides":
        n, e = np.array(corners).T
        n2, e2 = np.roll(n, 1), np.roll(e, 1)
        across = e2 != e  # a side along the ray to the north is never crossed by it
        return cls(n, e, e2, np.where(across, (n2 - n) / np.where(across, e2 - e, 1.0), 0.0))

    def around(self, north_m: float, east_m: float) -> bool:
        """Whether a place lies inside, by how often a ray from it to the north crosses the sides."""
        reached = (self.east_m > east_m) != (self.end_east_m > east_m)
        beyond = self.north_m + self.slope * (east_m - self.east_m) > north_m
        return bool(np.count_nonzero(reached & beyond) % 2)


class Area(NamedTuple):
    """A polygon (its sides) or a circle (centre and radius), level, in N [m]; `item` is the index of its first."""

    item: int
    inclusion: bool
    group: int
    sides: Sides | None
    centre_N: tuple[float, float] = (0.0, 0.0)
    radius_m: float = 0.0

    def contains(self, north_m: float, east_m: float) -> bool:
        if self.sides is not None:
            return self.sides.around(north_m, east_m)
        return math.dist((north_m, east_m), self.centre_N) < self.radius_m

    def violated(self, north_m: float, east_m: float) -> bool:
        return self.contains(north_m, east_m) is not self.inclusion

    @property
    def reason(self) -> str:
        what = "circle" if self.sides is None else "polygon"
        where = f"outside the {what}" if self.inclusion else f"inside the forbidden {what}"
        return f"{where} of fence item {self.item}"


class Fence(Plan):
    """The fence in force. `must_contain` tells which places (by name) a new one may not shut out."""

    name, _file = "fence", "fence.json"

    def __init__(self, store: Store, events: EventLog, places: Places) -> None:
        self._places = places
        self.areas: tuple[Area, ...] = ()
        self.must_contain: Callable[[], Iterable[tuple[str, Vec3]]] = tuple
        super().__init__(store, events)

    def check(self, items: Sequence[MissionItem]) -> Fault | None:
        return super().check(items) or _uneven(items)

    def _fault(self, items: Sequence[MissionItem], index: int) -> Finding:
        item = items[index]
        fault = plain(item, FenceCommand, "fence") or coordinates(item, altitude=False)
        if fault is not None:
            return fault
        if item.command == FenceCommand.RETURN_POINT:
            another = any(other.command == item.command for other in items[:index])
            return (
                ("command", "there can be one return point only")
                if another
                else reserved(item, "") or (coordinates(item))
            )
        return reserved(item, "12") or _size(item) or in_range("param2", 0, 255)(item)

    def _objection(self, items: Sequence[MissionItem]) -> Fault | None:
        areas = self._areas(items)
        for name, (north, east, _) in self.must_contain():
            area = shut_out(areas, north, east)
            if area is not None:
                return Fault(area.item, "place", f"{name} would be {area.reason}")
        return None

    def _adopt(self, items: tuple[MissionItem, ...]) -> None:
        super()._adopt(items)
        self.areas = tuple(self._areas(items))

    @property
    def return_point_N(self) -> Vec3 | None:
        points = [item for item in self.items if item.command == FenceCommand.RETURN_POINT]
        return self._places.of(points[0], (0.0, 0.0, 0.0)) if points else None

    def _areas(self, items: Sequence[MissionItem]) -> list[Area]:
        areas, k = [], 0
        while k < len(items):
            item = items[k]
            count = int(item.param1) if item.command in _POLYGONS else 1
            if item.command != FenceCommand.RETURN_POINT:
                group = 0 if math.isnan(item.param2) else int(item.param2)
                corners = [self._places.of(i, (0.0, 0.0, 0.0))[:2] for i in items[k : k + count]]
                sides = Sides.of(corners) if item.command in _POLYGONS else None
                areas.append(Area(k, item.command in _INCLUSIONS, group, sides, corners[0], item.param1))
            k += count
        return areas


def shut_out(areas: Sequence[Area], north_m: float, east_m: float) -> Area | None:
    """The first area that a place violates; None: it lies within the fence."""
    refusing: dict[int, Area | None] = {}  # by group: its first area that doesn't contain the place
    for area in areas:
        violated = area.violated(north_m, east_m)
        if area.inclusion:
            refusing[area.group] = refusing.get(area.group) or (area if violated else None)
        elif violated:
            return area
    return None if None in refusing.values() else next(iter(refusing.values()), None)


def _size(item: MissionItem) -> Finding:
    """A circle's radius, or how many vertices a polygon has."""
    if item.command in _CIRCLES:
        return None if 0.0 < item.param1 <= _RADIUS_MAX_M else ("param1", "the radius must be above 0 m, up to 100 km")
    whole = item.param1 >= _LEAST_CORNERS and item.param1 == int(item.param1)  # false for NaN too
    return None if whole else ("param1", f"a polygon has {_LEAST_CORNERS} vertices or more, not {item.param1:g}")


def _uneven(items: Sequence[MissionItem]) -> Fault | None:
    """The first vertex that doesn't fit the polygon it stands in."""
    k = 0
    while k < len(items):
        first = items[k]
        count = int(first.param1) if first.command in _POLYGONS else 1
        for index in range(k + 1, k + count):
            if index >= len(items):
                return Fault(k, "param1", f"the polygon has only {len(items) - k} of its {count} vertices")
            if items[index].command != first.command:
                return Fault(index, "command", f"the polygon of item {k} ends before its {count} vertices")
            if items[index].param1 != first.param1:
                return Fault(
                    index, "param1", f"the polygon of item {k} has {count} vertices, not {items[index].param1:g}"
                )
        k += count
    return None
