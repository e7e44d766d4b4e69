"""What a mission file asks for, without flying it: `gcs plan FILE`."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from rich.console import Console
from rich.markup import escape

from gcs_tools import fence, fence_check
from gcs_tools.convert import local_m
from gcs_tools.plan import Home, Plan, Streamed, Uploaded
from gcs_tools.reference import Vector
from gcs_tools.table import plain
from sitl.mavlink.codec import mav

# The vehicle's own limits as it comes (docs/parameters.md): parameter and value.
LIMITS = {
    "MPC_XY_CRUISE": 3.0,
    "MPC_ACC_HOR": 1.2,
    "MPC_Z_V_AUTO_UP": 2.0,
    "MPC_ACC_UP_MAX": 2.0,
    "MPC_Z_V_AUTO_DN": 1.0,
    "MPC_ACC_DOWN_MAX": 1.0,
    "MPC_LAND_SPEED": 0.5,
    "MPC_JERK_AUTO": 4.0,
}
_LAND_SLOW_M = 1.5
_TOLD = 20  # objections
# measured on missions/rectangle-mission.yaml: motors spun up; slowing down, contact felt and standing
_LIFT_OFF_S, _TOUCH_DOWN_S = 1.4, 4.0
_LANDS, _RETURNS, _DELAYS, _SPEED, _TAKES_OFF, _HOLDS = (21, 85), 20, (93, 112), 178, (22, 84), (16, 82)


class Row(NamedTuple):
    """One step of a flight. way_m: from the one before. end_s: when it is expected to be done. None: not known."""

    name: str
    place_m: Vector | None
    way_m: float | None
    end_s: float | None


def rows(plan: Plan) -> list[Row]:
    return _streamed(plan) if isinstance(plan, Streamed) else _uploaded(plan)


def _streamed(plan: Streamed) -> list[Row]:
    """At the key times and at the end; the way is that of the reference."""
    at = plan.reference.at
    found, begin_s = [Row("start", at(0.0).position_m, 0.0, 0.0)], 0.0
    for t in sorted({*plan.key_times_s, plan.duration_s}):
        steps = max(1, math.ceil((t - begin_s) / 0.02))
        points = [at(begin_s + (t - begin_s) * k / steps).position_m for k in range(steps + 1)]
        way = sum(math.dist(a, b) for a, b in pairwise(points))
        found.append(Row("end" if t == plan.duration_s else "key time", points[-1], way, t))
        begin_s = t
    return found


def _uploaded(plan: Uploaded) -> list[Row]:
    """Each item in order, jumps not followed; from standing at home."""
    home = plan.home or _first_place(plan)
    here: Vector | None = (0.0, 0.0, 0.0)
    t: float | None = 0.0
    speed, found = LIMITS["MPC_XY_CRUISE"], []
    for i, item in enumerate(plan.items):
        place, way = local_m(item, home) if item.flies_to else None, None
        if item.command == _RETURNS:
            place = _return_place(plan, home, here)
        elif item.command in _LANDS and place is not None:
            place = (place[0], place[1], 0.0)
        elif item.command in _TAKES_OFF and place is not None and here is not None:
            place = (here[0], here[1], place[2])
            t = t + _LIFT_OFF_S if t is not None else None
        if item.command == _SPEED and item.param2 > 0.0:
            speed = item.param2
        if item.command in _DELAYS and t is not None:
            t += item.param1
        if place is not None:
            way = math.dist(here, place) if here is not None else None
            if t is not None and here is not None:
                t += _land_s(here, place, speed) if place[2] == 0.0 else leg_s(here, place, speed)
            here = place
        if item.command in _HOLDS and t is not None and item.param1 > 0.0:
            t += item.param1
        found.append(Row(f"{i} {_name(item.command)}", place, way, t))
    return found


def leg_s(a: Vector, b: Vector, speed_m_s: float) -> float:
    """Time [s] from rest to rest: the longer of the level and the vertical part, each within its limits."""
    level = _move_s(math.dist(a[:2], b[:2]), speed_m_s, LIMITS["MPC_ACC_HOR"])
    up = a[2] - b[2]
    way = ("UP", "UP") if up > 0.0 else ("DN", "DOWN")
    return max(level, _move_s(abs(up), LIMITS[f"MPC_Z_V_AUTO_{way[0]}"], LIMITS[f"MPC_ACC_{way[1]}_MAX"]))


def _move_s(way_m: float, speed_m_s: float, acceleration_m_s2: float) -> float:
    """Speed up, cruise, slow down; each change of acceleration takes its jerk's time."""
    if way_m <= 0.0:
        return 0.0
    eased = acceleration_m_s2 / LIMITS["MPC_JERK_AUTO"]
    if way_m < speed_m_s**2 / acceleration_m_s2:
        return 2.0 * math.sqrt(way_m / acceleration_m_s2) + eased
    return way_m / speed_m_s + speed_m_s / acceleration_m_s2 + eased


def _land_s(a: Vector, b: Vector, speed_m_s: float) -> float:
    """Over the place, down, the last metre and a half slowly, and standing."""
    slow = min(_LAND_SLOW_M, -a[2])
    above = (b[0], b[1], a[2])
    return (
        leg_s(a, above, speed_m_s)
        + leg_s(above, (b[0], b[1], -slow), speed_m_s)
        + slow / LIMITS["MPC_LAND_SPEED"]
        + _TOUCH_DOWN_S
    )


def _return_place(plan: Uploaded, home: Home | None, here: Vector | None) -> Vector:
    """The ground at the nearest of home and the rally points within the fence."""
    areas, goals = fence_check.areas_of(plan, home), [(0.0, 0.0)]
    for item in plan.rally or () if here is not None else ():
        place = local_m(item, home)
        if place is not None and fence.first_outside(areas, [place[:2]]) is None:
            goals.append(place[:2])
    north, east = min(goals, key=lambda goal: math.dist(goal, here[:2]) if here is not None else 0.0)
    return north, east, 0.0


def _first_place(plan: Uploaded) -> Home | None:
    """A plan of latitudes without a home is measured from its first one."""
    for item in plan.items:
        if item.frame in (0, 3, 5, 6) and (item.x or item.y):
            return Home(item.x / 1e7, item.y / 1e7, item.z if item.frame in (0, 5) else 0.0)
    return None


def _name(command: int) -> str:
    known = mav.enums["MAV_CMD"].get(command)
    return known.name.removeprefix("MAV_CMD_") if known is not None else f"command {command}"


def objections(plan: Plan) -> list[str]:
    """What speaks against flying it within its own fence; a streamed flight was judged when its file was read."""
    if isinstance(plan, Streamed):
        return []
    places = [(f"item {i}", row.place_m) for i, row in enumerate(rows(plan))]
    way = [("the start", (0.0, 0.0, 0.0)), *((name, place) for name, place in places if place is not None)]
    return fence_check.along_items(plan, plan.home or _first_place(plan), way)


def show(plan: Plan, console: Console | None = None) -> list[str]:
    """Print it; what speaks against flying it."""
    console = console or Console()
    found: Sequence[Row] = rows(plan)
    console.print(f"{plan.name} · {plan.source}", markup=False, highlight=False)
    table = plain("")
    for heading in ("", "north", "east", "down [m]", "way [m]", "t [s]"):
        table.add_column(escape(heading), justify="left" if not heading else "right")
    for row in found:
        place = [f"{round(v, 2) + 0.0:.2f}" for v in row.place_m] if row.place_m else ["", "", ""]
        way = "" if row.way_m is None else f"{row.way_m:.1f}"
        table.add_row(row.name, *place, way, "" if row.end_s is None else f"{row.end_s:.1f}")
    console.print(table)
    length, last = sum(row.way_m or 0.0 for row in found), found[-1].end_s or 0.0
    if isinstance(plan, Streamed):
        console.print(f"{length:.1f} m in {last:.1f} s", highlight=False)
    else:
        _show_limits(plan, length, last, console)
    return _show_fence(plan, console)


def _show_limits(plan: Uploaded, length: float, last: float, console: Console) -> None:
    limits = ", ".join(f"{name} {value:g}" for name, value in LIMITS.items())
    stops = "with a stop at each place and the limits that the vehicle comes with"
    console.print(f"{len(plan.items)} items, {length:.1f} m, about {last:.0f} s, {stops} ({limits})", highlight=False)


def _show_fence(plan: Plan, console: Console) -> list[str]:
    """What the file says of fence and rally points, and whether the flight keeps to them."""

    def say(text: str) -> None:
        console.print(text, markup=False, highlight=False)

    if plan.rally:
        say(f"{len(plan.rally)} rally point{'s' if len(plan.rally) > 1 else ''}")
    if not plan.fence:
        return []
    home = (plan.home or _first_place(plan)) if isinstance(plan, Uploaded) else None
    areas = fence_check.areas_of(plan, home)
    say(f"fence: {fence.summary(areas) or 'its places are not known without a home'}")
    found = objections(plan)
    for text in found[:_TOLD] or ["every place and the whole way lie inside"] if areas else []:
        say(text)
    if len(found) > _TOLD:
        say(f"and {len(found) - _TOLD} more")
    return found
