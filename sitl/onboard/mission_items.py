"""What may stand in a mission: the commands, and what each item's parameters must be."""

import math
from collections.abc import Sequence
from enum import IntEnum

from sitl.onboard.plan import ABOVE_HOME, Finding, Frame, MissionItem, Rule, coordinates, in_range, plain, reserved

_ROI_LOCATION = 3.0  # MAV_ROI
_VTOL_STATE_HOVER = 3.0  # MAV_VTOL_STATE_MC
LEAST_HEIGHT_M = 0.2  # of a take-off, and of a point to fly to


class ItemCommand(IntEnum):
    """MAV_CMD, those that a mission may hold."""

    WAYPOINT = 16
    LOITER_UNLIMITED = 17
    LOITER_TURNS = 18
    LOITER_TIME = 19
    RETURN_TO_LAUNCH = 20
    LAND = 21
    TAKEOFF = 22
    LOITER_TO_ALT = 31
    SPLINE_WAYPOINT = 82
    VTOL_TAKEOFF = 84
    VTOL_LAND = 85
    DELAY = 93
    CONDITION_DELAY = 112
    CONDITION_DISTANCE = 114
    CONDITION_YAW = 115
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_LAND_START = 189
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_NONE = 197
    DO_SET_ROI = 201
    DO_VTOL_TRANSITION = 3000


_WITH_PLACE = {
    ItemCommand.WAYPOINT,
    ItemCommand.LOITER_UNLIMITED,
    ItemCommand.LOITER_TURNS,
    ItemCommand.LOITER_TIME,
    ItemCommand.LOITER_TO_ALT,
    ItemCommand.TAKEOFF,
    ItemCommand.LAND,
    ItemCommand.SPLINE_WAYPOINT,
    ItemCommand.VTOL_TAKEOFF,
    ItemCommand.VTOL_LAND,
}
TAKEOFFS = (ItemCommand.TAKEOFF, ItemCommand.VTOL_TAKEOFF)
LANDINGS = (ItemCommand.LAND, ItemCommand.VTOL_LAND)
INSTANT = {
    ItemCommand.DO_CHANGE_SPEED,
    ItemCommand.DO_SET_HOME,
    ItemCommand.DO_LAND_START,
    ItemCommand.DO_SET_ROI_LOCATION,
    ItemCommand.DO_SET_ROI_NONE,
    ItemCommand.DO_SET_ROI,
    ItemCommand.DO_VTOL_TRANSITION,
}
"""Items that take no time; jumps, which take none either, are a matter of their own."""


def has_place(item: MissionItem) -> bool:
    """Whether the item's x, y, z name a point to fly to."""
    return item.command in _WITH_PLACE and item.frame != Frame.MISSION


def roi_point(item: MissionItem) -> bool:
    """Whether the item names a place to face."""
    old = item.command == ItemCommand.DO_SET_ROI and item.param1 == _ROI_LOCATION
    return item.command == ItemCommand.DO_SET_ROI_LOCATION or old


def _place(item: MissionItem) -> Finding:
    elsewhere = item.command == ItemCommand.DO_SET_HOME and item.param1 != 1.0
    return coordinates(item) if item.command in _WITH_PLACE or elsewhere or roi_point(item) else None


def _roi(item: MissionItem) -> Finding:
    return None if item.param1 in (0.0, _ROI_LOCATION) else ("param1", "only 0 (none) and 3 (a location) can be faced")


def _transition(item: MissionItem) -> Finding:
    hover = item.param1 == _VTOL_STATE_HOVER
    return None if hover else ("param1", "there is no forward flight yet: only 3, hover, is possible")


def _climbs(item: MissionItem) -> Finding:
    """A take-off whose height is told from home or from the start point must lead off the ground."""
    if item.frame == Frame.LOCAL_NED:
        height = -item.z
    elif item.frame in ABOVE_HOME:
        height = item.z
    else:
        return None  # above sea level: known only where it is flown
    return None if height >= LEAST_HEIGHT_M else ("param7", f"take-off to less than {LEAST_HEIGHT_M:g} m")


# what each command's parameters must be, beside its place
_RULES: dict[int, tuple[Rule, ...]] = {
    ItemCommand.WAYPOINT: (in_range("param1", 0, 65535), in_range("param2", 0, 1000), in_range("param3", -1000, 1000)),
    ItemCommand.SPLINE_WAYPOINT: (in_range("param1", 0, 65535),),
    ItemCommand.LOITER_TIME: (in_range("param1", 0, 65535, nan_ok=False), in_range("param3", -1000, 1000)),
    ItemCommand.LOITER_TURNS: (in_range("param1", 0, 100, nan_ok=False), in_range("param3", -1000, 1000)),
    ItemCommand.LOITER_UNLIMITED: (in_range("param3", -1000, 1000),),
    ItemCommand.TAKEOFF: (_climbs,),
    ItemCommand.VTOL_TAKEOFF: (_climbs,),
    ItemCommand.DELAY: (in_range("param1", 0, 86400, nan_ok=False),),
    ItemCommand.CONDITION_DELAY: (in_range("param1", 0, 86400, nan_ok=False),),
    ItemCommand.CONDITION_DISTANCE: (in_range("param1", 0, 1e6, nan_ok=False),),
    ItemCommand.CONDITION_YAW: (in_range("param1", -360, 360, nan_ok=False), in_range("param2", 0, 360)),
    ItemCommand.DO_CHANGE_SPEED: (in_range("param1", 0, 1), in_range("param2", -2, 50)),
    ItemCommand.DO_JUMP: (in_range("param2", -1, 32767, nan_ok=False),),
    ItemCommand.DO_SET_ROI: (_roi,),
    ItemCommand.DO_VTOL_TRANSITION: (_transition,),
}


# which of param1 to param4 mean something (MAVLink's definitions); the others are reserved: 0 or NaN
_USED: dict[int, str] = {
    ItemCommand.WAYPOINT: "1234",
    ItemCommand.LOITER_UNLIMITED: "34",
    ItemCommand.LOITER_TURNS: "1234",
    ItemCommand.LOITER_TIME: "1234",
    ItemCommand.RETURN_TO_LAUNCH: "",
    ItemCommand.LAND: "124",
    ItemCommand.TAKEOFF: "134",
    ItemCommand.LOITER_TO_ALT: "124",
    ItemCommand.SPLINE_WAYPOINT: "1",
    ItemCommand.VTOL_TAKEOFF: "24",
    ItemCommand.VTOL_LAND: "134",
    ItemCommand.DELAY: "1234",
    ItemCommand.CONDITION_DELAY: "1",
    ItemCommand.CONDITION_DISTANCE: "1",
    ItemCommand.CONDITION_YAW: "1234",
    ItemCommand.DO_JUMP: "12",
    ItemCommand.DO_CHANGE_SPEED: "1234",
    ItemCommand.DO_SET_HOME: "1234",
    ItemCommand.DO_LAND_START: "",
    ItemCommand.DO_SET_ROI_LOCATION: "1",
    ItemCommand.DO_SET_ROI_NONE: "1",
    ItemCommand.DO_SET_ROI: "1234",
    ItemCommand.DO_VTOL_TRANSITION: "12",
}


def check_item(item: MissionItem, total: int) -> Finding:
    """The field at fault and why, or None. `total`: how many items the plan has."""
    fault = plain(item, ItemCommand, "mission")
    if fault is not None:
        return fault
    fault = _place(item) or reserved(item, _USED[item.command])
    for rule in _RULES.get(item.command, ()):
        fault = fault or rule(item)
    if fault is None and item.command == ItemCommand.DO_JUMP:
        target = item.param1
        if not (math.isfinite(target) and 0 <= target < total and target == int(target)):
            return "param1", f"no item {target:g} to jump to"
    return fault


def circular(items: Sequence[MissionItem], index: int) -> Finding:
    """A jump back over nothing that takes time would be taken for ever within one instant."""
    item = items[index]
    if item.command != ItemCommand.DO_JUMP or item.param1 > index or item.param2 >= 0.0:
        return None
    if all(between.command in INSTANT for between in items[int(item.param1) : index]):
        return "param1", "jumps in a circle without anything to fly"
    return None
