"""A stored plan: items exactly as they came, checked before they replace the old ones, kept across restarts."""

import math
import struct
import zlib
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import ClassVar, NamedTuple

import msgspec

from sitl.onboard.events import EventLog
from sitl.onboard.modes import EventKind, Severity
from sitl.onboard.store import Store, put_aside, reason

CAPACITY = 10_000
_FAR_M = 10_000.0
_FLOAT_MAX = 3.4028234663852886e38
_PACKED = struct.Struct("<BHBB4fiifB")

Finding = tuple[str, str] | None
"""An item's field at fault and why; None: nothing is wrong."""
Rule = Callable[["MissionItem"], Finding]


class Frame(IntEnum):
    """MAV_FRAME, those in which an item may come."""

    GLOBAL = 0
    LOCAL_NED = 1
    MISSION = 2
    GLOBAL_RELATIVE_ALT = 3
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_ALT_INT = 6


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
    """What is wrong with a plan: the item, its field (frame, command, param1 … param7, place, or total), and why."""

    index: int  # type: ignore[assignment]
    field: str
    reason: str


ABOVE_HOME = (Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT)


def storable(item: MissionItem) -> Finding:
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


def coordinates(item: MissionItem, altitude: bool = True) -> Finding:
    """Whether x, y and, with `altitude`, z name a place in the item's frame."""
    if item.frame == Frame.MISSION:
        return "frame", "an item with a position needs a frame with coordinates"
    if altitude and not math.isfinite(item.z):
        return "param7", "altitude is not finite"
    if altitude and abs(item.z) > _FAR_M:
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


def in_range(name: str, low: float, high: float, nan_ok: bool = True) -> Rule:
    def check(item: MissionItem) -> Finding:
        value = getattr(item, name)
        if math.isnan(value):
            return None if nan_ok else (name, "is not a number")
        return None if low <= value <= high else (name, f"{value:g} is outside {low:g} … {high:g}")

    return check


def reserved(item: MissionItem, used: str) -> Finding:
    """A parameter of 1 to 4 that is set without meaning anything; `used` names the others."""
    for name in ("param1", "param2", "param3", "param4"):
        value = getattr(item, name)
        if value and not math.isnan(value) and name[-1] not in used:
            return name, f"is reserved for command {item.command} and must not be set"
    return None


def plain(item: MissionItem, commands: type[IntEnum], what: str) -> Finding:
    """What holds for every kind of plan: fields that fit, a frame and a command that are known, nothing infinite."""
    misfit = storable(item)
    if misfit is not None:
        return misfit
    if item.frame not in Frame._value2member_map_:
        return "frame", f"frame {item.frame} is not supported"
    if item.command not in commands._value2member_map_:
        return "command", f"command {item.command} is not supported in a {what}"
    for name in ("param1", "param2", "param3", "param4"):
        if math.isinf(getattr(item, name)):
            return name, "is infinite"
    return None


class Plan:
    """The plan in force. What may stand in it, each kind says for itself in `_fault`."""

    name: ClassVar[str]
    _file: ClassVar[str]

    def __init__(self, store: Store, events: EventLog) -> None:
        self._store, self._events = store, events
        self.items: tuple[MissionItem, ...] = ()
        self.plan_id = 0
        self.revision = 0  # counts replacements, for whoever makes something of the items
        self._load()

    def _fault(self, items: Sequence[MissionItem], index: int) -> Finding:
        """What is wrong with one item of a plan, wherever and whenever that is."""
        raise NotImplementedError

    def _objection(self, items: Sequence[MissionItem]) -> Fault | None:
        """Why a plan that is sound can't be taken now."""
        return None

    def check(self, items: Sequence[MissionItem]) -> Fault | None:
        """The first thing wrong with a plan, or None."""
        if len(items) > CAPACITY:
            return Fault(CAPACITY, "total", f"more than {CAPACITY} items")
        for index in range(len(items)):
            fault = self._fault(items, index)
            if fault is not None:
                return Fault(index, *fault)
        return None

    def replace(self, items: Sequence[MissionItem]) -> Fault | None:
        """Take a new plan as a whole, persisted first; on a fault the old one stays whole."""
        fault = self.check(items) or self._objection(items)
        if fault is not None:
            return fault
        try:
            self._store.write(self._file, msgspec.json.encode([list(_finite_or_none(item)) for item in items]))
        except OSError as error:
            return Fault(0, "total", f"not saved: {reason(error)}")
        self._adopt(tuple(items))
        self._events.add(EventKind.PLAN, Severity.INFO, f"{self.name} of {len(items)} items", len(items))
        return None

    def clear(self) -> Fault | None:
        """Keep no plan; a fault where that can't be saved: then the old plan stays."""
        return self.replace(())

    def _adopt(self, items: tuple[MissionItem, ...]) -> None:
        self.items = items
        self.revision += 1
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
            data = self._store.read(self._file)
            if data is None:
                return
            rows = msgspec.json.decode(data, type=list[tuple[int | float | None, ...]])
            items = tuple(MissionItem(*_nan_for_none(row)) for row in rows)  # type: ignore[arg-type]
            fault = self.check(items)
            if fault is not None:
                raise ValueError(f"item {fault.index}: {fault.reason}")
        except OSError as error:
            self._events.tell(Severity.WARNING, f"stored {self.name} {put_aside(self._store, self._file, error)}")
        except (ValueError, TypeError, ArithmeticError) as error:
            why = "" if isinstance(error, msgspec.DecodeError) else f" ({error})"
            self._events.tell(Severity.WARNING, f"stored {self.name} {put_aside(self._store, self._file, error)}{why}")
        else:
            self._adopt(items)


def _finite_or_none(item: MissionItem) -> tuple[int | float | None, ...]:
    """JSON has no NaN; an unset parameter is null there."""
    return tuple(None if isinstance(x, float) and math.isnan(x) else x for x in item)


def _nan_for_none(row: Sequence[int | float | None]) -> list[int | float]:
    values = [math.nan if x is None else x for x in row]
    return [float(x) if 4 <= k <= 7 or k == 10 else int(x) for k, x in enumerate(values)]
