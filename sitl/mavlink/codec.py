"""Bytes to MAVLink messages and back; the one place that knows pymavlink.

pymavlink gives the message layouts, the enumerations and the parser that finds its way through broken input. Frames
that arrive and leave whole, which is all that a UDP link carries as long as nothing goes wrong, take a direct way
over `struct` and named tuples: encoding LOCAL_POSITION_NED takes an eighth of the time, decoding a position target a
seventh, and at a hundred times real time that is what the link costs.

    codec.message("COMMAND_LONG", target_system=1, command=mav.MAV_CMD_NAV_LAND)   # fields left out are zero
    Encoder(245, 190).encode(message)                                              # one per link: it counts frames
    for frame in Parser().feed(data): frame.name, frame.message.lat                # one per peer
"""

import struct
from typing import Any, NamedTuple

from fastcrc import crc16
from pymavlink.dialects.v20 import development as mav

from sitl.mavlink.dialect import ADDITIONS, Definition, Field, split_extensions
from sitl.mavlink.signing import SIGNATURE_BYTES, Signer

__all__ = [
    "Definition",
    "Encoder",
    "Frame",
    "Parser",
    "by_id",
    "by_name",
    "frame_length",
    "mav",
    "message",
    "open_frame",
]

_V1, _V2 = 0xFE, 0xFD
_SIGNED = 0x01  # incompatibility flag: a signature follows the checksum
_PENDING = 600  # bytes of an unfinished frame worth keeping (the longest frame has 280)

_HEAD_V1 = struct.Struct("<BBBBB")  # length, sequence, system, component, id
_HEAD_V2 = struct.Struct("<BBBBBBHB")  # length, incompatible, compatible, sequence, system, component, id low, high
_CRC = struct.Struct("<H")
_crc = crc16.mcrf4xx

_definitions: dict[int, Definition] = dict(ADDITIONS)


class Frame(NamedTuple):
    """A message as it came in: from whom, and the bytes that carried it."""

    id: int
    system: int
    component: int
    sequence: int
    version: int  # of the MAVLink framing: 1 or 2
    message: Any  # named tuple of the message's fields, see Definition.type
    raw: bytes

    @property
    def name(self) -> str:
        return type(self.message).__name__

    @property
    def payload(self) -> bytes:
        """The payload with the zeros that the sender may have cut."""
        start, length = (10, self.raw[1]) if self.version == 2 else (6, self.raw[1])
        return self.raw[start : start + length].ljust(by_id(self.id).struct.size, b"\0")


def by_id(message_id: int) -> Definition:
    """The layout of a message. Raises KeyError for an unknown id."""
    definition = _definitions.get(message_id)
    if definition is None:
        definition = _definitions[message_id] = _from_pymavlink(mav.mavlink_map[message_id])
    return definition


def by_name(name: str) -> Definition:
    """The layout of a message. Raises KeyError for an unknown name."""
    for definition in ADDITIONS.values():
        if definition.name == name:
            return definition
    try:
        return by_id(getattr(mav, f"MAVLINK_MSG_ID_{name}"))
    except AttributeError:
        raise KeyError(name) from None


def message(name: str, /, **fields: Any) -> Any:
    """A message by its name and fields; those left out are zero. Raises KeyError, TypeError for unknown ones."""
    return by_name(name).type(**fields)


def _from_pymavlink(layout: Any) -> Definition:
    types = dict(zip(layout.fieldnames, layout.fieldtypes, strict=True))
    fields = [
        Field(types[name], name, length)
        for name, length in zip(layout.ordered_fieldnames, layout.array_lengths, strict=True)
    ]
    return Definition(layout.id, layout.msgname, *split_extensions(layout.msgname, layout.crc_extra, fields))


class Encoder:
    """Frames for one peer: it numbers them, signs them, and knows which framing the peer understands."""

    __slots__ = ("_link_number", "component", "sequence", "signer", "system", "version")

    def __init__(self, system: int, component: int, signer: Signer | None = None, link_number: int = 0) -> None:
        self.system = system
        self.component = component
        self.signer = signer
        self.sequence = 0
        self.version = 2
        self._link_number = link_number

    def carries(self, definition: Definition) -> bool:
        """Whether the framing has room for this message's id: version 1 ends at 255."""
        return self.version == 2 or definition.id <= 0xFF

    def encode(self, message: Any) -> bytes:
        """One frame of a message made by `message` (or taken from a Frame)."""
        definition: Definition = message._definition
        return self.frame(definition, definition.encode(message))

    def frame(self, definition: Definition, payload: bytes) -> bytes:
        """One frame around a payload made by Definition.pack or encode, of a message that it `carries`."""
        number = self.sequence
        self.sequence = (number + 1) & 0xFF
        if self.version == 1:
            payload = payload.ljust(definition.base_length, b"\0")[: definition.base_length]
            body = _HEAD_V1.pack(len(payload), number, self.system, self.component, definition.id) + payload
            return b"\xfe" + body + _CRC.pack(_crc(body + definition.crc_extra))
        identity, signer = definition.id, self.signer
        flags = 0 if signer is None else _SIGNED
        low, high = identity & 0xFFFF, identity >> 16
        body = _HEAD_V2.pack(len(payload), flags, 0, number, self.system, self.component, low, high) + payload
        frame = b"\xfd" + body + _CRC.pack(_crc(body + definition.crc_extra))
        return frame if signer is None else frame + signer.signature(frame, self._link_number)


class Parser:
    """The frames in one peer's bytes. Never raises; whatever is not a sound frame of a known message is left out."""

    __slots__ = ("_parser", "errors")

    def __init__(self) -> None:
        self._parser: Any = None  # pymavlink's, made when something arrives that isn't a row of whole frames
        self.errors = 0

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that `data`, after what was left unfinished before, completes."""
        frames: list[Frame] = []
        position, end = 0, len(data)
        while position < end:
            total = frame_length(data, position)
            if not total or position + total > end:
                break
            raw = data if total == end else data[position : position + total]
            frame = open_frame(raw)
            if frame is None:
                break
            if frame.message is not None:
                frames.append(frame)
            position += total
        if position == end:
            self._parser = None  # a row of whole frames: what was left unfinished before will not go on
            return frames
        return frames + self._search(data[position:])

    def _search(self, data: bytes) -> list[Frame]:
        """The way through broken input and frames in pieces."""
        if self._parser is None:
            self._parser = mav.MAVLink(None)
            self._parser.robust_parsing = True
        parser = self._parser
        try:
            found = parser.parse_buffer(data) or []
        except Exception:
            self._parser, found = None, []
            self.errors += 1
        if parser.buf_len() > _PENDING:
            self._parser = None
        elif parser.buf_index:
            parser.buf = parser.buf[parser.buf_index :]
            parser.buf_index = 0
        frames = []
        for item in found:
            if item.get_type() == "BAD_DATA":
                self.errors += 1
                continue
            frame = open_frame(bytes(item.get_msgbuf()))
            if frame is not None and frame.message is not None:
                frames.append(frame)
        return frames


def frame_length(data: bytes, position: int) -> int:
    """Bytes of the frame that starts at `position`, 0 where none does."""
    magic = data[position]
    if magic == _V2 and position + 3 <= len(data):
        flags = data[position + 2]
        return data[position + 1] + 12 + (SIGNATURE_BYTES if flags & _SIGNED else 0) if not flags & ~_SIGNED else 0
    if magic == _V1 and position + 2 <= len(data):
        return data[position + 1] + 8
    return 0


def open_frame(raw: bytes) -> Frame | None:
    """The frame in exactly these bytes: None if the checksum is wrong, without message if its id is unknown."""
    if raw[0] == _V2:
        length, _, _, number, system, component, low, high = _HEAD_V2.unpack_from(raw, 1)
        identity, version, start = low | high << 16, 2, 10
    else:
        length, number, system, component, identity = _HEAD_V1.unpack_from(raw, 1)
        version, start = 1, 6
    definition = _definitions.get(identity)
    if definition is None:
        try:
            definition = by_id(identity)
        except KeyError:
            return Frame(identity, system, component, number, version, None, raw)
    end = start + length
    if _crc(raw[1:end] + definition.crc_extra) != _CRC.unpack_from(raw, end)[0]:
        return None
    return Frame(identity, system, component, number, version, definition.decode(raw[start:end]), raw)
