"""The vehicle's parameters over the link: list, read, write.

Integers travel as their bytes in the message's float (MAVLink's bytewise encoding, PX4's).
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from gcs_tools.client import RETRY_S, TRIES, Client, LinkError, Script
from sitl.mavlink import codec
from sitl.mavlink.codec import mav
from sitl.mavlink.wire import float32, float_of_int, int_of_float

_REAL32 = mav.MAV_PARAM_TYPE_REAL32
_BY_NAME = -1  # param_index of a request by name
_NOT_IN_LIST = 65535  # param_index of a value that isn't part of the list
_ERRORS = ("", "no such parameter", "value out of range", "not allowed", "no such component", "read-only")
_INT32 = range(-(2**31), 2**31)


class Parameter(NamedTuple):
    name: str
    value: float  # an int where is_int
    is_int: bool

    @classmethod
    def of(cls, m: Any) -> "Parameter":
        is_int = m.param_type != _REAL32
        return cls(m.param_id, int_of_float(m.param_value) if is_int else m.param_value, is_int)

    @property
    def text(self) -> str:
        return number_text(self.value)


def number_text(value: float) -> str:
    """The shortest decimal that reads back as the same 32-bit float."""
    if isinstance(value, int):
        return str(value)
    for digits in range(1, 10):
        short = float(f"{value:.{digits}g}")
        if float32(short) == float32(value):
            return repr(short).removesuffix(".0")
    return repr(value)


class _Mailbox:
    """PARAM_VALUE and PARAM_ERROR as they come, while a script wants them."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self.values: dict[str, Parameter] = {}
        self.indices: set[int] = set()
        self.count: int | None = None
        self.errors: dict[str, int] = {}
        self.touched_s = client.wall_s

    def __enter__(self) -> "_Mailbox":
        self._client.on["PARAM_VALUE"] = self._value
        self._client.on["PARAM_ERROR"] = self._error
        return self

    def __exit__(self, *_: object) -> None:
        del self._client.on["PARAM_VALUE"], self._client.on["PARAM_ERROR"]

    def _value(self, m: Any) -> None:
        self.touched_s = self._client.wall_s
        if m.param_index == _NOT_IN_LIST and m.param_id.startswith("_"):
            return  # the hash over all parameters
        self.values[m.param_id] = Parameter.of(m)
        if m.param_index != _NOT_IN_LIST:
            self.indices.add(m.param_index)
            self.count = m.param_count

    def _error(self, m: Any) -> None:
        self.errors[m.param_id] = m.error


def fetch_all(client: Client) -> Script[dict[str, Parameter]]:
    """Every parameter, by name in alphabetical order. What got lost on the way is asked for singly."""
    with _Mailbox(client) as box:
        for _ in range(TRIES):
            client.send(codec.message("PARAM_REQUEST_LIST", **client.address()))
            yield from _quiet(client, box)
            if box.count is not None:
                break
        else:
            raise LinkError("the vehicle doesn't list its parameters")
        fruitless = 0
        while missing := [k for k in range(box.count) if k not in box.indices]:
            if fruitless == TRIES:
                raise LinkError(f"{len(missing)} of {box.count} parameters never came")
            for k in missing:
                client.send(codec.message("PARAM_REQUEST_READ", param_index=k, **client.address()))
            yield from _quiet(client, box)
            fruitless = fruitless + 1 if all(k not in box.indices for k in missing) else 0
        return dict(sorted(box.values.items()))


def _quiet(client: Client, box: _Mailbox) -> Script[None]:
    """Until all is there, or nothing has come for a while."""
    box.touched_s = client.wall_s
    while client.wall_s < box.touched_s + RETRY_S and (box.count is None or len(box.indices) < box.count):
        yield box.touched_s + RETRY_S


def fetch(client: Client, name: str) -> Script[Parameter]:
    """One parameter. Raises LinkError for one that the vehicle doesn't have."""
    _check_name(name)
    request = codec.message("PARAM_REQUEST_READ", param_id=name, param_index=_BY_NAME, **client.address())
    return (yield from _exchange(client, name, request))


def store(client: Client, name: str, value: float) -> Script[Parameter]:
    """Write a parameter and see it in force. Raises LinkError with the vehicle's reason where it is refused."""
    old = yield from fetch(client, name)
    return (yield from _write(client, old, value))


def _write(client: Client, old: Parameter, value: float) -> Script[Parameter]:
    asked_s = client.wall_s
    if old.is_int and (value != int(value) or int(value) not in _INT32):
        raise LinkError(f"{old.name}: {value:g} refused: it takes whole numbers")
    wire = float_of_int(int(value)) if old.is_int else float32(value)
    kind = mav.MAV_PARAM_TYPE_INT32 if old.is_int else _REAL32
    written = int(value) if old.is_int else float32(value)
    request = codec.message("PARAM_SET", param_id=old.name, param_value=wire, param_type=kind, **client.address())
    try:
        new = yield from _exchange(client, old.name, request, written)
    except LinkError as fault:
        yield from client.pause(0.1)  # for the reason, which is told apart
        reason = client.vehicle.reasons_since(asked_s)
        raise LinkError(f"{fault}{': ' + reason if reason else ''}; it stays {old.text}") from None
    if new.value != written:
        raise LinkError(f"{old.name}: {value:g} refused; it stays {new.text}")
    return new


def _exchange(client: Client, name: str, request: Any, written: float | None = None) -> Script[Parameter]:
    """Send until PARAM_VALUE or PARAM_ERROR answers.

    Another value than what was written may have been on its way before; told again after another try it is the answer.
    """
    with _Mailbox(client) as box:
        others = 0
        for _ in range(TRIES):
            box.values.pop(name, None)
            client.send(request)
            end_s = client.wall_s + RETRY_S
            while client.wall_s < end_s:
                yield end_s
                if name in box.errors:
                    code = box.errors[name]
                    raise LinkError(f"{name}: {_ERRORS[code] if 0 < code < len(_ERRORS) else f'error {code}'}")
                if name in box.values and written in (None, box.values[name].value):
                    return box.values[name]
            others += name in box.values
            if others == 2:
                return box.values[name]
    raise LinkError(f"{name}: the vehicle doesn't answer; it may have no such parameter")


def _check_name(name: str) -> None:
    if not name or len(name.encode()) > 16 or not name.isascii():
        raise LinkError(f"'{name}' can't be a parameter: names have 1 to 16 letters, digits and underscores")


def apply(client: Client, wanted: Mapping[str, float]) -> Script[list[tuple[Parameter, Parameter]]]:
    """Write what differs; (old, new) of each. Names and kinds are checked before anything is written."""
    present = yield from fetch_all(client)
    for name, value in wanted.items():
        if name not in present:
            raise LinkError(f"{name}: the vehicle has no such parameter")
        if present[name].is_int and value != int(value):
            raise LinkError(f"{name}: {value:g} refused: it takes whole numbers")
    changed = []
    for name, value in wanted.items():
        old = present[name]
        if old.value != (int(value) if old.is_int else float32(value)):
            changed.append((old, (yield from _write(client, old, value))))
    return changed
