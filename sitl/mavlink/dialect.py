"""What a MAVLink message is made of, and the few messages that pymavlink's dialects lack.

pymavlink's generated dialects follow a fork of the message definitions that leaves out what is marked there as work
in progress or has been retired: no PROTOCOL_VERSION, no plan ids in the mission messages, no addresses in TIMESYNC.
Those are written out below, after the definitions in mavlink/mavlink (common.xml).
"""

import struct
from collections import namedtuple
from collections.abc import Sequence
from typing import Any, NamedTuple

from fastcrc import crc16

CODES = {  # of struct, by type
    "char": "s",
    "uint8_t": "B",
    "int8_t": "b",
    "uint16_t": "H",
    "int16_t": "h",
    "uint32_t": "I",
    "int32_t": "i",
    "uint64_t": "Q",
    "int64_t": "q",
    "float": "f",
    "double": "d",
}


_new_tuple: Any = tuple.__new__
_tuple_type: Any = namedtuple  # its types are made at run time, beyond what a type checker follows


class Field(NamedTuple):
    """One field; `length` is that of an array, 0 for a single value."""

    type: str
    name: str
    length: int = 0


def crc_extra(name: str, base: Sequence[Field]) -> int:
    """The byte that ties a frame's checksum to the layout of its message; extension fields don't count."""
    text = name.encode() + b" "
    for field in base:
        text += f"{field.type} {field.name} ".encode() + (bytes([field.length]) if field.length else b"")
    crc: int = crc16.mcrf4xx(text)
    return (crc & 0xFF) ^ (crc >> 8)


class Definition:
    """One message type: fields in wire order (largest first, extensions last), as a struct and as a named tuple.

    `type` is the named tuple of its fields, with zeros as defaults: text as str, arrays as tuples, as on the wire
    little-endian IEEE floats and integers without conversion of units.
    """

    __slots__ = ("_arrays", "base_length", "crc_extra", "fields", "id", "name", "struct", "type")

    def __init__(self, message_id: int, name: str, base: Sequence[Field], extensions: Sequence[Field] = ()) -> None:
        self.id = message_id
        self.name = name
        self.fields = (*base, *extensions)
        self.struct = struct.Struct("<" + "".join(f"{f.length or ''}{CODES[f.type]}" for f in self.fields))
        self.base_length = struct.calcsize("<" + "".join(f"{f.length or ''}{CODES[f.type]}" for f in base))
        self.crc_extra = bytes([crc_extra(name, base)])
        self._arrays = any(f.length or f.type == "char" for f in self.fields)
        self.type = _tuple_type(name, [f.name for f in self.fields], defaults=[_zero(f) for f in self.fields])
        self.type._definition = self

    def pack(self, *values: Any) -> bytes:
        """Payload of values in wire order, text as bytes, arrays spread out; trailing zeros cut as MAVLink 2 does."""
        return self.struct.pack(*values).rstrip(b"\0") or b"\0"

    def encode(self, message: Any) -> bytes:
        """Payload of one `type`, trailing zeros cut."""
        if not self._arrays:
            return self.pack(*message)
        flat: list[Any] = []
        for field, value in zip(self.fields, message, strict=True):
            if field.type == "char":
                flat.append(value.encode("utf-8", "replace") if isinstance(value, str) else value)
            elif field.length:
                if len(value) > field.length:
                    raise ValueError(f"{self.name}.{field.name}: {len(value)} values, {field.length} fit")
                flat.extend(value)
                flat.extend([0] * (field.length - len(value)))
            else:
                flat.append(value)
        return self.pack(*flat)

    def decode(self, payload: bytes) -> Any:
        """The message in a payload of any length: what was cut is zero, what is beyond the known fields is dropped."""
        size = self.struct.size
        if len(payload) < size:
            payload += bytes(size - len(payload))
        elif len(payload) > size:
            payload = payload[:size]
        values = self.struct.unpack(payload)
        if not self._arrays:
            return _new_tuple(self.type, values)
        fields: list[Any] = []
        k = 0
        for field in self.fields:
            if field.type == "char":
                fields.append(values[k].split(b"\0", 1)[0].decode("utf-8", "replace"))
                k += 1
            elif field.length:
                fields.append(values[k : k + field.length])
                k += field.length
            else:
                fields.append(values[k])
                k += 1
        return _new_tuple(self.type, fields)


def _zero(field: Field) -> Any:
    if field.type == "char":
        return ""
    zero = 0.0 if field.type in ("float", "double") else 0
    return (zero,) * field.length if field.length else zero


def split_extensions(name: str, extra: int, fields: Sequence[Field]) -> tuple[Sequence[Field], Sequence[Field]]:
    """Base and extension fields of a layout of which only `crc_extra` is known: the longest base that yields it."""
    for k in range(len(fields), 0, -1):
        if crc_extra(name, fields[:k]) == extra:
            return fields[:k], fields[k:]
    raise ValueError(f"{name}: no part of its fields has the checksum {extra}")


def _fields(text: str) -> tuple[Field, ...]:
    """'uint8_t a, uint16_t b[3]' as fields."""
    fields = []
    for part in text.split(", ") if text else ():
        type_name, _, name = part.partition(" ")
        name, _, length = name.rstrip("]").partition("[")
        fields.append(Field(type_name, name, int(length or 0)))
    return tuple(fields)


ADDITIONS = {
    definition.id: definition
    for definition in (
        Definition(
            42,
            "MISSION_CURRENT",
            _fields("uint16_t seq"),
            _fields(
                "uint16_t total, uint8_t mission_state, uint8_t mission_mode, "
                "uint32_t mission_id, uint32_t fence_id, uint32_t rally_points_id"
            ),
        ),
        Definition(
            44,
            "MISSION_COUNT",
            _fields("uint16_t count, uint8_t target_system, uint8_t target_component"),
            _fields("uint8_t mission_type, uint32_t opaque_id"),
        ),
        Definition(
            47,
            "MISSION_ACK",
            _fields("uint8_t target_system, uint8_t target_component, uint8_t type"),
            _fields("uint8_t mission_type, uint32_t opaque_id"),
        ),
        Definition(80, "COMMAND_CANCEL", _fields("uint16_t command, uint8_t target_system, uint8_t target_component")),
        Definition(
            111,
            "TIMESYNC",
            _fields("int64_t tc1, int64_t ts1"),
            _fields("uint8_t target_system, uint8_t target_component"),
        ),
        Definition(
            300,
            "PROTOCOL_VERSION",
            _fields(
                "uint16_t version, uint16_t min_version, uint16_t max_version, "
                "uint8_t spec_version_hash[8], uint8_t library_version_hash[8]"
            ),
        ),
        Definition(397, "COMPONENT_METADATA", _fields("uint32_t time_boot_ms, uint32_t file_crc, char uri[100]")),
    )
}
"""By message id; they stand in for pymavlink's definitions of the same id."""
