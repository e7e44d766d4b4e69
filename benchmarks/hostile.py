"""Datagrams that mean harm: rubbish, broken frames, and every known message with every value at its limits.

What a vehicle must obey is left out, since a claim that it holds its place would make no sense with it. See `obeyed`.
"""

import math
import random
import struct
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from sitl.mavlink import codec
from sitl.mavlink.actions import TABLE
from sitl.mavlink.codec import Definition, mav
from sitl.mavlink.dialect import CODES
from sitl.mavlink.wire import int_of_float
from sitl.onboard.parameters import Parameters

IDS = sorted(mav.mavlink_map)
_FLOATS = (math.nan, math.inf, -math.inf, 3.4028235e38, -3.4028235e38, 1e-45, 0.0, -0.0, 1.0, -1.0, 1e10)
_SYSTEMATIC = ((math.nan, 0), (math.inf, 1), (-math.inf, 0), (3.4028235e38, 1), (-3.4028235e38, 0), (0.0, 1))
_FORMATS = {**CODES, "char": "B"}
# commands that act are obeyed; those that only ask are not among them
ACTING = frozenset(number for number, entry in TABLE.items() if not entry.query)
# messages that act by themselves: a mode, a home, a plan that is cleared or takes the old one's place
OBEYED = frozenset(("SET_MODE", "SET_HOME_POSITION", "SET_GPS_GLOBAL_ORIGIN", "MISSION_COUNT", "MISSION_CLEAR_ALL"))


class Target(NamedTuple):
    """Whom the datagrams are meant to harm."""

    system: int
    component: int
    parameters: Parameters


def obeyed(message: object, target: Target) -> bool:
    """Whether a sound message legitimately changes what the vehicle does, its parameters or its plan.

    Only what is addressed to it (or to all) can be: SET_MODE, SET_HOME_POSITION, SET_GPS_GLOBAL_ORIGIN;
    MISSION_COUNT and MISSION_CLEAR_ALL, which begin or do away with a plan; COMMAND_LONG and COMMAND_INT of a command
    that acts, unless a parameter of it is infinite, which must be refused; PARAM_SET of a known name to a value
    within its range.
    """
    fields = message._asdict()  # type: ignore[attr-defined]
    system = fields.get("target_system", fields.get("target", 0))
    if system not in (0, target.system) or fields.get("target_component", 0) not in (0, target.component):
        return False
    name = type(message).__name__
    if name in ("COMMAND_LONG", "COMMAND_INT"):
        floats = [value for key, value in fields.items() if isinstance(value, float)]
        return fields["command"] in ACTING and not any(map(math.isinf, floats))
    if name == "PARAM_SET":
        return _fits(target.parameters, fields["param_id"], fields["param_value"])
    return name in OBEYED


def _fits(parameters: Parameters, name: str, value: float) -> bool:
    """Whether a parameter may have this value, as a number or in the bytes of one."""
    if name not in parameters.names:
        return False
    d = parameters.declaration(name)
    return any(d.minimum <= each <= d.maximum for each in ((int_of_float(value), value) if d.is_int else (value,)))


class Hostile:
    """A row of datagrams, the same for the same seed. tame: leave out what is `obeyed`."""

    def __init__(self, seed: int, target: Target, *, tame: bool = True) -> None:
        self._random = random.Random(seed)
        self._target, self._tame = target, tame
        self._names = [name.encode() for name in target.parameters.names]
        self._commands = sorted(TABLE)
        self._encoder = codec.Encoder(255, 190)
        self._systematic = self._every_message_at_its_limits()
        self.left_out = 0

    def __iter__(self) -> Iterator[bytes]:
        yield from self._systematic
        kinds: Sequence[tuple[Callable[[], bytes], float]] = (
            (self._rubbish, 0.1),
            (self._broken, 0.2),
            (self._any_message, 0.7),
        )
        makers, weights = [kind for kind, _ in kinds], [weight for _, weight in kinds]
        while True:
            for make in self._random.choices(makers, weights, k=1000):
                yield make()

    def _every_message_at_its_limits(self) -> Iterator[bytes]:
        """Every known message with all floats NaN, infinite and huge, all integers at one limit or the other."""
        for message_id in IDS:
            definition = codec.by_id(message_id)
            for real, high in _SYSTEMATIC:
                for system in (self._target.system, 0, 77):
                    data = self._frame(definition, lambda kind: _limit(kind, high, real), system)  # noqa: B023
                    if data:
                        yield data

    def _rubbish(self) -> bytes:
        r = self._random
        data = r.randbytes(r.choice((0, 1, 5, 12, 30, 100, 300)))
        return r.choice((b"", b"\xfd", b"\xfe", b"\xfd\x00\x00")) + data

    def _broken(self) -> bytes:
        """A frame cut short, or with flipped bits: one in 65,536 of these has a sound checksum and is left out."""
        r, data = self._random, bytearray(self._any_message())
        if r.random() < 0.5:
            del data[r.randrange(len(data)) :]
        else:
            for _ in range(r.randint(1, 5)):
                bit = r.randrange(len(data) * 8)
                data[bit // 8] ^= 1 << bit % 8
        if self._tame and any(obeyed(frame.message, self._target) for frame in codec.Parser().feed(bytes(data))):
            self.left_out += 1
            return b""
        return bytes(data)

    def _any_message(self) -> bytes:
        r = self._random
        while True:
            definition = codec.by_id(r.choice(IDS if r.random() < 0.5 else _HANDLED))
            system = r.choice((self._target.system, self._target.system, 0, r.randrange(256)))
            data = self._frame(definition, self._value, system)
            if data:
                return data

    def _value(self, kind: str) -> float:
        r = self._random
        if kind in ("float", "double"):
            return r.choice(_FLOATS) if r.random() < 0.7 else r.uniform(-1000.0, 1000.0)
        if r.random() < 0.5:
            return _limit(kind, r.randrange(2), 0.0)
        bits = struct.calcsize(_FORMATS[kind]) * 8
        return r.randrange(2**bits) - (2 ** (bits - 1) if kind[0] == "i" else 0)

    def _frame(self, definition: Definition, value: Callable[[str], float], system: int) -> bytes:
        """One frame from a made-up sender; empty where it is to be left out."""
        r, payload = self._random, bytearray()
        for field in definition.fields:
            if field.name in ("target_system", "target"):
                payload.append(system)
            elif field.name == "target_component":
                payload.append(r.choice((self._target.component, 0, self._target.component, r.randrange(256))))
            elif field.name == "param_id" and r.random() < 0.8:
                payload += r.choice(self._names).ljust(16, b"\0")
            elif field.name == "command" and field.type == "uint16_t" and r.random() < 0.8:
                payload += struct.pack("<H", r.choice(self._commands))
            elif field.length > 8 and r.random() < 0.5:
                payload += r.randbytes(field.length * struct.calcsize(_FORMATS[field.type]))
            else:
                code = "<" + _FORMATS[field.type]
                payload += b"".join(struct.pack(code, value(field.type)) for _ in range(field.length or 1))
        if self._tame and obeyed(definition.decode(bytes(payload)), self._target):
            self.left_out += 1
            return b""
        self._encoder.system, self._encoder.component = r.choice(((255, 190), (1, 1), (1, 100), (2, 1), (0, 0)))
        self._encoder.version = 1 if definition.id <= 0xFF and r.random() < 0.1 else 2
        return self._encoder.frame(definition, bytes(payload).rstrip(b"\0") or b"\0")


def _limit(kind: str, high: int, real: float) -> float:
    """The least or greatest value of an integer kind; `real` for a float."""
    if kind in ("float", "double"):
        return real
    bits = struct.calcsize(_FORMATS[kind]) * 8
    if kind[0] == "i":
        return 2 ** (bits - 1) - 1 if high else -(2 ** (bits - 1))
    return 2**bits - 1 if high else 0


_HANDLED = [
    codec.by_name(name).id
    for name in (
        *("HEARTBEAT", "PING", "TIMESYNC", "COMMAND_LONG", "COMMAND_INT", "SET_MODE"),
        *("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET", "REQUEST_DATA_STREAM", "SETUP_SIGNING"),
        *("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ITEM", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT"),
        *("MISSION_REQUEST", "MISSION_ACK", "MISSION_CLEAR_ALL", "MISSION_SET_CURRENT"),
        *("MISSION_REQUEST_PARTIAL_LIST", "MISSION_WRITE_PARTIAL_LIST", "FILE_TRANSFER_PROTOCOL"),
        *("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET", "MANUAL_CONTROL"),
        *("LOG_REQUEST_LIST", "LOG_REQUEST_DATA", "LOG_ERASE", "LOG_REQUEST_END"),
    )
]
