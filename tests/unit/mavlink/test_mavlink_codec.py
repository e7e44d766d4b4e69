"""The codec against pymavlink's own encoder and decoder, and what it makes of broken input."""

import math
import struct
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import development as mav

from sitl.mavlink import codec
from sitl.mavlink.dialect import ADDITIONS, Definition, Field
from sitl.mavlink.streams import STREAMS

SENT = sorted(
    {stream.definition.name for stream in STREAMS}
    | {"HEARTBEAT", "COMMAND_ACK", "PARAM_VALUE", "PARAM_ERROR", "MISSION_ITEM_INT", "MISSION_REQUEST_INT"}
    | {"STATUSTEXT", "AUTOPILOT_VERSION", "AVAILABLE_MODES", "MISSION_ITEM_REACHED", "MESSAGE_INTERVAL", "PING"}
)
RECEIVED = ["COMMAND_LONG", "COMMAND_INT", "SET_POSITION_TARGET_LOCAL_NED", "PARAM_SET", "MANUAL_CONTROL", "SET_MODE"]
SHARED = [name for name in {*SENT, *RECEIVED} if codec.by_name(name).id not in ADDITIONS]

_RANGES = {"B": (0, 255), "b": (-128, 127), "H": (0, 65535), "h": (-32768, 32767)}
_RANGES |= {"I": (0, 2**32 - 1), "i": (-(2**31), 2**31 - 1), "Q": (0, 2**64 - 1), "q": (-(2**63), 2**63 - 1)}
_CODES = {"uint8_t": "B", "int8_t": "b", "uint16_t": "H", "int16_t": "h", "uint32_t": "I", "int32_t": "i"}
_CODES |= {"uint64_t": "Q", "int64_t": "q"}


def value_of(field: Field) -> st.SearchStrategy[object]:
    if field.type == "char":
        return st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=field.length)
    if field.type == "float":
        one: st.SearchStrategy[object] = st.floats(width=32, allow_nan=False)
    else:
        one = st.integers(*_RANGES[_CODES[field.type]])
    return st.tuples(*[one] * field.length) if field.length else one


def messages(name: str) -> st.SearchStrategy[object]:
    definition = codec.by_name(name)
    return st.tuples(*map(value_of, definition.fields)).map(definition.type._make)


def as_pymavlink(message: object) -> object:
    layout = mav.mavlink_map[message._definition.id]  # type: ignore[attr-defined]
    values = message._asdict()  # type: ignore[attr-defined]
    return layout(*[v.encode() if isinstance(v := values[name], str) else v for name in layout.fieldnames])


@pytest.mark.parametrize("name", sorted(SHARED))
@settings(max_examples=25)
@given(data=st.data())
def test_frames_are_those_of_pymavlink_byte_for_byte(name: str, data: st.DataObject) -> None:
    message = data.draw(messages(name))
    theirs = mav.MAVLink(None, srcSystem=7, srcComponent=1)
    theirs.seq = 250
    ours = codec.Encoder(7, 1)
    ours.sequence = 250
    assert ours.encode(message) == as_pymavlink(message).pack(theirs)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", sorted({*SENT, *RECEIVED, "TIMESYNC", "MISSION_ACK", "PROTOCOL_VERSION"}))
@settings(max_examples=25)
@given(data=st.data())
def test_what_was_encoded_is_decoded_again(name: str, data: st.DataObject) -> None:
    message = data.draw(messages(name))
    [frame] = codec.Parser().feed(codec.Encoder(3, 4).encode(message))
    assert frame.message == message
    assert (frame.name, frame.system, frame.component, frame.sequence, frame.version) == (name, 3, 4, 0, 2)


def test_pymavlink_reads_the_mission_messages_with_their_added_plan_ids() -> None:
    frame = codec.Encoder(1, 1).encode(
        codec.message("MISSION_COUNT", count=500, target_system=255, opaque_id=0x1234567)
    )
    [theirs] = mav.MAVLink(None).parse_buffer(frame)
    assert (theirs.count, theirs.target_system, theirs.mission_type) == (500, 255, 0)


@pytest.mark.parametrize(("name", "extra"), [("PROTOCOL_VERSION", 217), ("TIMESYNC", 34), ("MISSION_ACK", 153)])
def test_added_definitions_carry_the_published_checksum_byte(name: str, extra: int) -> None:
    assert codec.by_name(name).crc_extra == bytes([extra])


def test_extension_fields_are_found_as_the_xml_marks_them() -> None:
    files = [Path(mav.__file__).with_name(f"{name}.xml") for name in ("minimal", "standard", "common", "development")]
    checked = 0
    for file in files:
        for element in ElementTree.parse(file).getroot().iter("message"):
            message_id = int(element.attrib["id"])
            if message_id not in mav.mavlink_map or message_id in ADDITIONS:
                continue
            base = 0
            for child in element:
                if child.tag == "extensions":
                    break
                if child.tag == "field":
                    kind, _, length = child.attrib["type"].rstrip("]").partition("[")
                    size = struct.calcsize(_CODES.get(kind, {"float": "f", "double": "d"}.get(kind, "B")))
                    base += size * int(length or 1)
            assert codec.by_id(message_id).base_length == base, element.attrib["name"]
            checked += 1
    assert checked > 150


def test_version_1_frames_carry_the_base_fields_whole_and_no_others() -> None:
    encoder = codec.Encoder(1, 1)
    encoder.version = 1
    frame = encoder.encode(codec.message("COMMAND_ACK", command=400, result=0, target_system=255))
    assert frame[0] == 0xFE
    assert frame[1] == 3
    [theirs] = mav.MAVLink(None).parse_buffer(frame)
    assert theirs.command == 400
    [ours] = codec.Parser().feed(frame)
    assert ours.version == 1
    assert ours.message.target_system == 0


def test_fields_left_out_are_zero_and_unknown_ones_are_refused() -> None:
    assert codec.message("MISSION_ITEM_INT", seq=3).param1 == 0.0
    with pytest.raises(TypeError):
        codec.message("MISSION_ITEM_INT", sequence=3)
    with pytest.raises(KeyError):
        codec.message("NO_SUCH_MESSAGE")


def test_text_is_cut_to_its_field_and_too_many_array_values_are_refused() -> None:
    text = codec.message("STATUSTEXT", text="x" * 80)
    assert codec.Parser().feed(codec.Encoder(1, 1).encode(text))[0].message.text == "x" * 50
    with pytest.raises(ValueError, match="uid2"):
        codec.Encoder(1, 1).encode(codec.message("AUTOPILOT_VERSION", uid2=(1,) * 19))


def test_several_frames_in_one_datagram_all_come_out() -> None:
    encoder = codec.Encoder(1, 1)
    data = b"".join(encoder.encode(codec.message("HEARTBEAT", custom_mode=k)) for k in range(5))
    frames = codec.Parser().feed(data)
    assert [frame.message.custom_mode for frame in frames] == [0, 1, 2, 3, 4]
    assert b"".join(frame.raw for frame in frames) == data


def test_a_frame_in_two_halves_is_put_together() -> None:
    data = codec.Encoder(1, 1).encode(codec.message("HEARTBEAT", custom_mode=9))
    parser = codec.Parser()
    assert parser.feed(data[:7]) == []
    [frame] = parser.feed(data[7:])
    assert frame.message.custom_mode == 9


def test_half_a_frame_does_not_eat_the_whole_one_after_it() -> None:
    encoder = codec.Encoder(1, 1)
    first = encoder.encode(codec.message("ATTITUDE", roll=1.0, yawspeed=2.0))
    second = encoder.encode(codec.message("HEARTBEAT", custom_mode=9))
    parser = codec.Parser()
    assert parser.feed(first[:20]) == []
    assert [frame.name for frame in parser.feed(second)] == ["HEARTBEAT"]
    assert parser.feed(second[:9]) == []  # and the half is not waited for any more
    assert [frame.name for frame in parser.feed(second[9:])] == ["HEARTBEAT"]


def test_garbage_before_and_after_a_frame_is_skipped() -> None:
    data = codec.Encoder(1, 1).encode(codec.message("HEARTBEAT", custom_mode=9))
    parser = codec.Parser()
    frames = parser.feed(b"hello" + data + b"\x00\x01")
    assert [frame.message.custom_mode for frame in frames] == [9]
    assert parser.errors > 0


def test_a_message_of_unknown_id_is_skipped_and_the_next_one_read() -> None:
    unknown = Definition(0xABCDEF, "UNHEARD_OF", [Field("uint8_t", "x")])
    encoder = codec.Encoder(1, 1)
    data = encoder.frame(unknown, b"\x05") + encoder.encode(codec.message("HEARTBEAT"))
    assert [frame.name for frame in codec.Parser().feed(data)] == ["HEARTBEAT"]


def test_a_signed_frame_is_read_without_its_signature() -> None:
    theirs = mav.MAVLink(None, srcSystem=7, srcComponent=1)
    theirs.signing.secret_key = bytes(32)
    theirs.signing.sign_outgoing = True
    data = mav.MAVLink_heartbeat_message(1, 2, 3, 4, 5, 3).pack(theirs)
    [frame] = codec.Parser().feed(data)
    assert frame.message.custom_mode == 4
    assert frame.raw == data


@given(st.lists(st.binary(max_size=400), max_size=8))
def test_whatever_bytes_arrive_the_parser_neither_raises_nor_grows(chunks: list[bytes]) -> None:
    parser = codec.Parser()
    for chunk in chunks * 3:
        parser.feed(chunk)
    assert parser._parser is None or len(parser._parser.buf) <= 600


@given(st.integers(0, 37 * 8 - 1))
def test_a_flipped_bit_is_never_taken_for_a_message(bit: int) -> None:
    data = bytearray(codec.Encoder(1, 1).encode(codec.message("ATTITUDE", roll=1.0, yawspeed=2.0)))
    data[bit // 8] ^= 1 << bit % 8
    # a changed id or length may find no checksum to fail, but never a message
    assert codec.Parser().feed(bytes(data)) == []


def test_the_payload_of_a_frame_has_its_trailing_zeros_back() -> None:
    [frame] = codec.Parser().feed(codec.Encoder(1, 1).encode(codec.message("PARAM_SET", param_value=1.0)))
    assert len(frame.payload) == 23
    assert struct.unpack_from("<f", frame.payload)[0] == 1.0


def test_not_a_number_travels() -> None:
    [frame] = codec.Parser().feed(codec.Encoder(1, 1).encode(codec.message("COMMAND_LONG", param5=math.nan)))
    assert math.isnan(frame.message.param5)
