"""Whether a flight keeps within its own file's fence: what the vehicle would refuse, and where it would breach it."""

import math
from collections.abc import Sequence
from itertools import pairwise

from gcs_tools import fence
from gcs_tools.convert import local_m
from gcs_tools.plan import LOCAL_FRAMES, Home, Item, Streamed, Uploaded
from gcs_tools.reference import Vector

SAMPLE_S = 0.02  # the client's targets
_TURNS, _TURN_SAMPLES = 18, 16  # NAV_LOITER_TURNS, and the points of it that the vehicle looks at


def areas_of(plan: Streamed | Uploaded, home: Home | None) -> list[fence.Area]:
    return fence.areas(plan.fence or (), lambda item: local_m(item, home))


def along_reference(plan: Streamed) -> str:
    """The first target that the vehicle would refuse and why, or nothing."""
    areas = areas_of(plan, None)
    if not areas:
        return ""
    times = [k * SAMPLE_S for k in range(math.ceil(plan.duration_s / SAMPLE_S))] + [plan.duration_s]
    places = [plan.reference.at(t).position_m[:2] for t in times]
    found = fence.first_outside(areas, places)
    if found is None:
        return ""
    k, area = found
    return f"the flight is {area.reason} at t = {times[k]:.2f} s, {_named(places[k])}"


def along_items(plan: Uploaded, home: Home | None, way: Sequence[tuple[str, Vector]]) -> list[str]:
    """What speaks against a mission: home, items, and the straight ways between places.

    home: what places are measured from. way: the places in order and their names, from the start on.
    """
    areas = areas_of(plan, home)
    has_home = plan.home is not None or any(item.frame in LOCAL_FRAMES for item in plan.fence or ())
    found = fence.first_outside(areas, [(0.0, 0.0)]) if has_home else None
    told = [f"home is {found[1].reason}: the vehicle refuses such a fence"] if found else []
    return told + _items_outside(areas, plan, home) + _ways_outside(areas, way) + _rally_outside(areas, plan, home)


def _items_outside(areas: list[fence.Area], plan: Uploaded, home: Home | None) -> list[str]:
    looked_at = [(i, place) for i, item in enumerate(plan.items) for place in _looked_at(item, home)]
    outside: dict[int, fence.Area] = {}  # by item: what its first such point violates
    for (i, _), area in zip(looked_at, fence.verdicts(areas, [place for _, place in looked_at]), strict=True):
        if area is not None:
            outside.setdefault(i, area)
    return [
        f"item {i} lies outside the fence: {area.reason}: the vehicle doesn't start it" for i, area in outside.items()
    ]


def _ways_outside(areas: list[fence.Area], way: Sequence[tuple[str, Vector]]) -> list[str]:
    """Of the ways whose both ends lie within."""
    at_places = fence.verdicts(areas, [place[:2] for _, place in way])
    within = [(a, b) for (a, p), (b, q) in pairwise(zip(way, at_places, strict=True)) if p is q is None]
    told = []
    for (a, b), left in zip(within, fence.leaves(areas, [(a[1][:2], b[1][:2]) for a, b in within]), strict=True):
        if left is not None:
            share, area = left
            at = [u + share * (v - u) for u, v in zip(a[1][:2], b[1][:2], strict=True)]
            told.append(f"the way from {a[0]} to {b[0]} is {area.reason} from {_named(at)} on: a breach in flight")
    return told


def _rally_outside(areas: list[fence.Area], plan: Uploaded, home: Home | None) -> list[str]:
    places = [(i, place[:2]) for i, item in enumerate(plan.rally or ()) if (place := local_m(item, home)) is not None]
    return [
        f"rally point {i} is {area.reason}: Return doesn't lead there"
        for (i, _), area in zip(places, fence.verdicts(areas, [place for _, place in places]), strict=True)
        if area is not None
    ]


def _looked_at(item: Item, home: Home | None) -> list[fence.Level]:
    """The points of an item that the vehicle judges."""
    place = local_m(item, home) if item.flies_to else None
    if place is None:
        return []
    if item.command != _TURNS or not item.param3:
        return [place[:2]]
    around = (2.0 * math.pi * k / _TURN_SAMPLES for k in range(_TURN_SAMPLES))
    radius = abs(item.param3)
    return [(place[0] + radius * math.cos(a), place[1] + radius * math.sin(a)) for a in around]


def _named(place: Sequence[float]) -> str:
    return f"north {place[0]:.2f} m, east {place[1]:.2f} m"
