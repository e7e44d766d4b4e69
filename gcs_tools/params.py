"""The vehicle's parameters over the link: list, read, write."""

from collections.abc import Mapping
from typing import Any

from gcs_tools.client import RETRY_S, TRIES, Client, LinkError, Script
from gcs_tools.parameter import NOT_IN_LIST, Parameter, is_hash
from sitl.mavlink import codec
from sitl.mavlink.codec import mav
from sitl.mavlink.wire import float32, float_of_int

_REAL32 = mav.MAV_PARAM_TYPE_REAL32
_BY_NAME = -1  # param_index of a request by name
_ERRORS = ("", "no such parameter", "value out of range", "not allowed", "no such component", "read-only")
_INT32 = range(-(2**31), 2**31)


class _Mailbox:
    """PARAM_VALUE and PARAM_ERROR as they come, while a script wants them."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self.values: dict[str, Parameter] = {}  # the newest
        self.told: dict[str, set[float]] = {}  # all, since they were asked for
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
        if is_hash(m):
            return
        self.values[m.param_id] = parameter = Parameter.of(m)
        self.told.setdefault(m.param_id, set()).add(parameter.value)
        if m.param_index != NOT_IN_LIST:
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
    return (yield from write(client, old, value))


def write(client: Client, old: Parameter, value: float) -> Script[Parameter]:
    """Write a parameter whose present value is known; as `store` otherwise."""
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
    What was written and told counts, even if the vehicle has changed it since (a step that has been run reads 0).
    """
    with _Mailbox(client) as box:
        others = 0
        for _ in range(TRIES):
            box.values.pop(name, None)
            box.told.pop(name, None)
            client.send(request)
            end_s = client.wall_s + RETRY_S
            while client.wall_s < end_s:
                yield end_s
                if name in box.errors:
                    code = box.errors[name]
                    raise LinkError(f"{name}: {_ERRORS[code] if 0 < code < len(_ERRORS) else f'error {code}'}")
                if name in box.values and (written is None or written in box.told[name]):
                    return box.values[name] if written is None else box.values[name]._replace(value=written)
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
            changed.append((old, (yield from write(client, old, value))))
    return changed
