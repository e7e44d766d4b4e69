"""The parameter registry: declared once, checked on every write, kept across restarts."""

import math
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import msgspec
import numpy as np

from sitl.onboard.events import EventLog
from sitl.onboard.modes import EventKind, Severity
from sitl.onboard.store import Store, put_aside, reason

_FILE = "parameters.json"


class Declaration(NamedTuple):
    """All there is to know of a parameter. The name has at most 16 characters (MAVLink)."""

    name: str
    is_int: bool
    default: float
    minimum: float
    maximum: float
    unit: str
    group: str
    short: str
    long: str = ""
    values: tuple[tuple[int, str], ...] = ()
    read_only: bool = False
    persistent: bool = True
    volatile: bool = False  # the vehicle changes it by itself


class ParameterRefusal(Enum):
    UNKNOWN = "unknown name"
    NOT_FINITE = "not a finite number"
    OUT_OF_RANGE = "out of range"
    READ_ONLY = "read-only"
    WRONG_TYPE = "wrong type"
    NOT_SAVED = "could not be saved"


def _representable(value: float) -> float:
    """The value as a MAVLink REAL32 carries it, so that what is read back is what is in force."""
    return float(np.float32(value))


class Parameters:
    """Values by name. Floats are exact in single precision; ints are whole numbers.

    `namespace` keeps different kinds of vehicle apart in one store. Values that are stored but no longer fit their
    declaration are left out with a warning; an unreadable file is set aside.
    """

    def __init__(self, declared: Sequence[Declaration], store: Store, namespace: str, events: EventLog) -> None:
        self._declarations = {d.name: d for d in declared}
        self._defaults = {d.name: d.default if d.is_int else _representable(d.default) for d in declared}
        self._values = dict(self._defaults)
        self._presets: dict[str, float] = {}  # in force for this run only
        self._store, self._namespace, self._events = store, namespace, events
        self.names = tuple(sorted(self._declarations))
        self.generation = 0
        self._load()

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def declaration(self, name: str) -> Declaration:
        return self._declarations[name]

    def check(self, name: str, value: float, is_int: bool | None = None) -> ParameterRefusal | None:
        """Why `value` may not be set, or None. `is_int`: the type that the sender claims, if it claims one."""
        d = self._declarations.get(name)
        if d is None:
            return ParameterRefusal.UNKNOWN
        if is_int is not None and is_int != d.is_int:
            return ParameterRefusal.WRONG_TYPE
        if not math.isfinite(value):
            return ParameterRefusal.NOT_FINITE
        if d.read_only:
            return ParameterRefusal.READ_ONLY
        if d.is_int and value != int(value):
            return ParameterRefusal.WRONG_TYPE
        # a limit itself may have been rounded to single precision on its way here
        low, high = (d.minimum, d.maximum) if d.is_int else (_representable(d.minimum), _representable(d.maximum))
        if not low <= value <= high or (d.values and int(value) not in dict(d.values)):
            return ParameterRefusal.OUT_OF_RANGE
        return None

    def set(self, name: str, value: float, is_int: bool | None = None) -> ParameterRefusal | None:
        """Set and persist a value, or say why not and keep the old one."""
        refusal = self.check(name, value, is_int)
        if refusal is not None:
            return refusal
        return self._put({name: float(value) if self._declarations[name].is_int else _representable(value)})

    def put_back(self, name: str, value: float) -> None:
        """Set a value that the vehicle itself changes (a counter that runs down), read-only or not."""
        self._put({name: value})

    def preset(self, name: str, value: float) -> ParameterRefusal | None:
        """Set a value for this run only: in force, but not kept unless it is set again."""
        refusal = self.check(name, value)
        if refusal is None:
            value = float(value) if self._declarations[name].is_int else _representable(value)
            self._presets[name] = value
            if self._values[name] != value:
                self._values[name] = value
                self.generation += 1
        return refusal

    def reset(self, group: str | None = None) -> ParameterRefusal | None:
        """Defaults for all kept parameters, or those of one group; all of them or, if they can't be saved, none."""
        return self._put(
            {
                name: self._defaults[name]
                for name, d in self._declarations.items()
                if d.persistent and (group is None or d.group == group)
            }
        )

    def _put(self, values: dict[str, float]) -> ParameterRefusal | None:
        """Persist, then put in force."""
        changed = {n: v for n, v in values.items() if self._values[n] != v or n in self._presets}
        presets = {name: value for name, value in self._presets.items() if name not in changed}
        if any(self._declarations[name].persistent for name in changed):
            try:
                self._save({**self._values, **changed}, presets)
            except OSError as error:
                self._events.tell(Severity.ERROR, f"parameter {next(iter(changed))} not saved: {reason(error)}")
                return ParameterRefusal.NOT_SAVED
        self._presets = presets
        for name, value in changed.items():
            self._values[name] = value
            self.generation += 1
            self._events.add(EventKind.PARAMETER, Severity.INFO, name)
        return None

    def _stored(self) -> dict[str, dict[str, float]]:
        data = self._store.read(_FILE)
        return msgspec.json.decode(data, type=dict[str, dict[str, float]]) if data else {}

    def _save(self, values: dict[str, float], presets: dict[str, float]) -> None:
        """Store what differs from the defaults; of what is preset for this run, what was stored before."""
        try:
            stored = self._stored()
        except ValueError:
            self._store.set_aside(_FILE)
            stored = {}
        kept = stored.get(self._namespace, {})
        stored[self._namespace] = {
            name: value
            for name, value in {**values, **{n: kept.get(n, self._defaults[n]) for n in presets}}.items()
            if value != self._defaults[name] and self._declarations[name].persistent
        }
        self._store.write(_FILE, msgspec.json.format(msgspec.json.encode(stored)))

    def _load(self) -> None:
        try:
            stored = self._stored().get(self._namespace, {})
        except (OSError, ValueError) as error:
            outcome = put_aside(self._store, _FILE, error)
            self._events.tell(Severity.WARNING, f"stored parameters {outcome}: defaults in force")
            return
        for name, value in stored.items():
            refusal = self.check(name, value)
            if refusal is None and self._declarations[name].persistent:
                self._values[name] = value if self._declarations[name].is_int else _representable(value)
            else:
                why = refusal.value if refusal else "not kept across restarts"
                self._events.tell(Severity.WARNING, f"stored parameter {name} ignored: {why}")
