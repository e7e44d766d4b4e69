"""The stored mission: items exactly as they came, checked before they replace the old ones, kept across restarts."""

import math
import struct
import zlib
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import NamedTuple

import msgspec

from sitl.onboard.events import EventLog
from sitl.onboard.modes import ACCEPTED, EventKind, Outcome, Severity, Verdict
from sitl.onboard.store import Store, put_aside, reason

CAPACITY = 10_000
_FILE = "mission.json"
_PACKED = struct.Struct("<BHBB4fiifB")


class Frame(IntEnum):
    """MAV_FRAME, those in which an item may come."""

    GLOBAL = 0
    LOCAL_NED = 1
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6


class ItemCommand(IntEnum):
    """MAV_CMD, those that a mission may hold."""

    WAYPOINT = 16
    LOITER_UNLIMITED = 17
    LOITER_TURNS = 18
    LOITER_TIME = 19
    RETURN_TO_LAUNCH = 20
    LAND = 21
    TAKEOFF = 22
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


class MissionState(IntEnum):
    """MISSION_STATE."""

    UNKNOWN = 0
    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


class MissionItem(NamedTuple):
    """MISSION_ITEM_INT's fields, verbatim. x, y: degE7, or 1e-4 m in LOCAL_NED; z: metres."""

    frame: int
    command: int
    current: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float
    mission_type: int = 0


class Fault(NamedTuple):
    """What is wrong with a plan: the item, its field (frame, command, param1 … param7, or total), and why."""

    index: int  # type: ignore[assignment]
    field: str
    reason: str


_WITH_PLACE = {
    ItemCommand.WAYPOINT,
    ItemCommand.LOITER_UNLIMITED,
    ItemCommand.LOITER_TURNS,
    ItemCommand.LOITER_TIME,
    ItemCommand.TAKEOFF,
    ItemCommand.LAND,
    ItemCommand.SPLINE_WAYPOINT,
    ItemCommand.VTOL_TAKEOFF,
    ItemCommand.VTOL_LAND,
}
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
_ABOVE_HOME = (Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT)
LEAST_HEIGHT_M = 0.2  # of a take-off, and of a point to fly to
_FAR_M = 10_000.0
_FLOAT_MAX = 3.4028234663852886e38


def has_place(item: MissionItem) -> bool:
    """Whether the item's x, y, z name a point to fly to."""
    return item.command in _WITH_PLACE and item.frame != Frame.MISSION


def _place(item: MissionItem) -> tuple[str, str] | None:
    elsewhere = item.command == ItemCommand.DO_SET_HOME and item.param1 != 1.0
    if item.command not in _WITH_PLACE and not elsewhere:
        return None
    if item.frame == Frame.MISSION:
        return "frame", "an item with a position needs a frame with coordinates"
    if not math.isfinite(item.z):
        return "param7", "altitude is not finite"
    if abs(item.z) > _FAR_M:
        return "param7", "altitude is beyond 10 km"
    if item.frame == Frame.LOCAL_NED:
        for field, value in (("param5", item.x), ("param6", item.y)):
            if abs(value) > _FAR_M * 1e4:
                return field, "further than 10 km"
    else:
        if abs(item.x) > 900_000_000:
            return "param5", "latitude beyond ±90°"
        if abs(item.y) > 1_800_000_000:
            return "param6", "longitude beyond ±180°"
    return None


def _climbs(item: MissionItem) -> tuple[str, str] | None:
    """A take-off whose height is told from home or from the start point must lead off the ground."""
    if item.frame == Frame.LOCAL_NED:
        height = -item.z
    elif item.frame in _ABOVE_HOME:
        height = item.z
    else:
        return None  # above sea level: known only where it is flown
    return None if height >= LEAST_HEIGHT_M else ("param7", f"take-off to less than {LEAST_HEIGHT_M:g} m")


def _storable(item: MissionItem) -> tuple[str, str] | None:
    """Whether every field fits the form in which it is kept and sent."""
    for name, field, low, high in (
        ("frame", "frame", 0, 0xFF),
        ("command", "command", 0, 0xFFFF),
        ("current", "total", 0, 0xFF),
        ("autocontinue", "total", 0, 0xFF),
        ("mission_type", "total", 0, 0xFF),
        ("x", "param5", -(2**31), 2**31 - 1),
        ("y", "param6", -(2**31), 2**31 - 1),
    ):
        value = getattr(item, name)
        if not low <= value <= high or value != int(value):
            return field, f"{name} {value} is not a whole number in {low} … {high}"
    for name, field in (*((f"param{k}", f"param{k}") for k in range(1, 5)), ("z", "param7")):
        value = getattr(item, name)
        if math.isfinite(value) and abs(value) > _FLOAT_MAX:
            return field, f"{value:g} is too large"
    return None


def _range(name: str, low: float, high: float, nan_ok: bool = True) -> Callable[[MissionItem], tuple[str, str] | None]:
    def check(item: MissionItem) -> tuple[str, str] | None:
        value = getattr(item, name)
        if math.isnan(value):
            return None if nan_ok else (name, "is not a number")
        return None if low <= value <= high else (name, f"{value:g} is outside {low:g} … {high:g}")

    return check


# what each command's parameters must be, beside its place
_RULES: dict[int, tuple[Callable[[MissionItem], tuple[str, str] | None], ...]] = {
    ItemCommand.WAYPOINT: (_range("param1", 0, 65535), _range("param2", 0, 1000), _range("param3", -1000, 1000)),
    ItemCommand.SPLINE_WAYPOINT: (_range("param1", 0, 65535),),
    ItemCommand.LOITER_TIME: (_range("param1", 0, 65535, nan_ok=False), _range("param3", -1000, 1000)),
    ItemCommand.LOITER_TURNS: (_range("param1", 0, 100, nan_ok=False), _range("param3", -1000, 1000)),
    ItemCommand.LOITER_UNLIMITED: (_range("param3", -1000, 1000),),
    ItemCommand.TAKEOFF: (_climbs,),
    ItemCommand.VTOL_TAKEOFF: (_climbs,),
    ItemCommand.DELAY: (_range("param1", 0, 86400, nan_ok=False),),
    ItemCommand.CONDITION_DELAY: (_range("param1", 0, 86400, nan_ok=False),),
    ItemCommand.CONDITION_DISTANCE: (_range("param1", 0, 1e6, nan_ok=False),),
    ItemCommand.CONDITION_YAW: (_range("param1", -360, 360, nan_ok=False),),
    ItemCommand.DO_CHANGE_SPEED: (_range("param1", 0, 1), _range("param2", -2, 50)),
    ItemCommand.DO_JUMP: (_range("param2", -1, 32767, nan_ok=False),),
    ItemCommand.DO_VTOL_TRANSITION: (_range("param1", 3, 3, nan_ok=False),),
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


def _reserved(item: MissionItem) -> tuple[str, str] | None:
    for name in ("param1", "param2", "param3", "param4"):
        value = getattr(item, name)
        if value and not math.isnan(value) and name[-1] not in _USED[item.command]:
            return name, f"is reserved for command {item.command} and must not be set"
    return None


def check_item(item: MissionItem, total: int) -> tuple[str, str] | None:
    """The field at fault and why, or None. `total`: how many items the plan has."""
    misfit = _storable(item)
    if misfit is not None:
        return misfit
    if item.frame not in Frame._value2member_map_:
        return "frame", f"frame {item.frame} is not supported"
    if item.command not in ItemCommand._value2member_map_:
        return "command", f"command {item.command} is not supported in a mission"
    for name in ("param1", "param2", "param3", "param4"):
        if math.isinf(getattr(item, name)):
            return name, "is infinite"
    fault = _place(item)
    for rule in (_reserved, *_RULES.get(item.command, ())):
        fault = fault or rule(item)
    if fault is None and item.command == ItemCommand.DO_JUMP:
        target = item.param1
        if not (math.isfinite(target) and 0 <= target < total and target == int(target)):
            return "param1", f"no item {target:g} to jump to"
    return fault


def _circular(items: Sequence[MissionItem], index: int) -> tuple[str, str] | None:
    """A jump back over nothing that takes time would be taken for ever within one instant."""
    item = items[index]
    if item.command != ItemCommand.DO_JUMP or item.param1 > index or item.param2 >= 0.0:
        return None
    if all(between.command in INSTANT for between in items[int(item.param1) : index]):
        return "param1", "jumps in a circle without anything to fly"
    return None


class Mission:
    """The plan in force and how far it has come. `current` is the item being flown, or flown next."""

    def __init__(self, store: Store, events: EventLog) -> None:
        self._store, self._events = store, events
        self.items: tuple[MissionItem, ...] = ()
        self.plan_id = 0
        self.current = 0
        self.state = MissionState.NO_MISSION
        self.revision = 0  # counts replacements and jumps from outside, for whoever is flying it
        self._load()

    def check(self, items: Sequence[MissionItem]) -> Fault | None:
        """The first thing wrong with a plan, or None."""
        if len(items) > CAPACITY:
            return Fault(CAPACITY, "total", f"more than {CAPACITY} items")
        for index, item in enumerate(items):
            fault = check_item(item, len(items)) or _circular(items, index)
            if fault is not None:
                return Fault(index, *fault)
        return None

    def replace(self, items: Sequence[MissionItem]) -> Fault | None:
        """Take a new plan as a whole, persisted first; on a fault the old one stays whole."""
        fault = self.check(items)
        if fault is not None:
            return fault
        try:
            self._store.write(_FILE, msgspec.json.encode([list(_finite_or_none(item)) for item in items]))
        except OSError as error:
            return Fault(0, "total", f"not saved: {reason(error)}")
        self._adopt(tuple(items))
        self._events.add(EventKind.MISSION, Severity.INFO, f"mission of {len(items)} items", len(items))
        return None

    def clear(self) -> Fault | None:
        """Keep no plan; a fault where that can't be saved: then the old plan stays."""
        return self.replace(())

    def set_current(self, index: int, reset: bool = False) -> Outcome:
        """Go on from item `index`; with `reset` a completed mission counts as not started."""
        if not 0 <= index < len(self.items):
            return Outcome(Verdict.DENIED, f"no mission item {index}: there are {len(self.items)}")
        self.current = index
        self.revision += 1
        if reset or self.state is MissionState.COMPLETE:
            self.state = MissionState.NOT_STARTED
        self._events.add(EventKind.ITEM_CURRENT, Severity.INFO, f"mission item {index}", index)
        return ACCEPTED

    def _adopt(self, items: tuple[MissionItem, ...]) -> None:
        self.items = items
        self.current = 0
        self.revision += 1
        self.state = MissionState.NOT_STARTED if items else MissionState.NO_MISSION
        crc = 0
        for seq, i in enumerate(items):
            crc = zlib.crc32(
                _PACKED.pack(
                    i.frame, i.command, 0, i.autocontinue, i.param1, i.param2, i.param3, i.param4, i.x, i.y, i.z,
                    i.mission_type,
                )
                + seq.to_bytes(2, "little"),
                crc,
            )  # fmt: skip
        self.plan_id = crc

    def _load(self) -> None:
        try:
            data = self._store.read(_FILE)
            if data is None:
                return
            rows = msgspec.json.decode(data, type=list[tuple[int | float | None, ...]])
            items = tuple(MissionItem(*_nan_for_none(row)) for row in rows)  # type: ignore[arg-type]
            fault = self.check(items)
            if fault is not None:
                raise ValueError(f"item {fault.index}: {fault.reason}")
        except OSError as error:
            self._events.tell(Severity.WARNING, f"stored mission {put_aside(self._store, _FILE, error)}")
        except (ValueError, TypeError, ArithmeticError) as error:
            why = "" if isinstance(error, msgspec.DecodeError) else f" ({error})"
            self._events.tell(Severity.WARNING, f"stored mission {put_aside(self._store, _FILE, error)}{why}")
        else:
            self._adopt(items)


def _finite_or_none(item: MissionItem) -> tuple[int | float | None, ...]:
    """JSON has no NaN; an unset parameter is null there."""
    return tuple(None if isinstance(x, float) and math.isnan(x) else x for x in item)


def _nan_for_none(row: Sequence[int | float | None]) -> list[int | float]:
    values = [math.nan if x is None else x for x in row]
    return [float(x) if 4 <= k <= 7 or k == 10 else int(x) for k, x in enumerate(values)]
