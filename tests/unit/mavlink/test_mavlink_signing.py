"""Signatures, against pymavlink's on the other side."""

import hashlib
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from sitl.mavlink import codec, signing
from sitl.mavlink.signing import KeyFileError, Signer, after_restart, read_key

KEY = hashlib.sha256(b"a passphrase").digest()
UNIX_S = 1_750_000_000.0
NOW = int((UNIX_S - 1_420_070_400) * 1e5)


def signer(**settings: Any) -> Signer:
    made = Signer(KEY, **settings)
    made.keep_time(UNIX_S)
    return made


def pymavlink_end(key: bytes = KEY) -> Any:
    end = common.MAVLink(None, 255, 190)
    end.signing.secret_key = key
    end.signing.link_id = 3
    end.signing.timestamp = NOW
    end.signing.sign_outgoing = True
    return end


def heard(end: Signer, data: bytes) -> list[bool]:
    return [end.admits(f.raw, f.id, f.system, f.component) for f in codec.Parser().feed(data)]


def ping(end: Any) -> bytes:
    return bytes(common.MAVLink_ping_message(1, 2, 0, 0).pack(end))


def test_pymavlink_accepts_what_we_sign_and_refuses_another_key() -> None:
    frames = codec.Encoder(1, 1, signer(), 2)
    end = pymavlink_end()
    for _ in range(3):
        (m,) = end.parse_buffer(frames.encode(codec.message("PING", seq=7)))
        assert (m.get_type(), m.seq, m.get_signed(), m.get_link_id()) == ("PING", 7, True, 2)
    with pytest.raises(common.MAVError, match="Invalid signature"):
        pymavlink_end(bytes(32)).parse_buffer(frames.encode(codec.message("PING")))


def test_we_accept_what_pymavlink_signs_and_refuse_another_key() -> None:
    ours = signer()
    assert heard(ours, ping(pymavlink_end())) == [True]
    assert heard(ours, ping(pymavlink_end(bytes(32)))) == [False]


def test_a_frame_heard_before_is_refused_and_so_is_an_earlier_one() -> None:
    ours, end = signer(), pymavlink_end()
    first, second = ping(end), ping(end)
    assert heard(ours, second) == [True]
    assert heard(ours, second) == [False]
    assert heard(ours, first) == [False]
    assert heard(ours, ping(end)) == [True]


def test_one_flipped_bit_anywhere_is_refused() -> None:
    ours, data = signer(), ping(pymavlink_end())
    for place in range(len(data) * 8):
        broken = bytearray(data)
        broken[place // 8] ^= 1 << place % 8
        assert not any(heard(ours, bytes(broken))), place
    assert heard(ours, data) == [True]


def test_an_unknown_stream_may_be_a_minute_late_and_no_more() -> None:
    late, too_late = pymavlink_end(), pymavlink_end()
    late.signing.timestamp, too_late.signing.timestamp = NOW - 5_900_000, NOW - 6_100_000
    assert heard(signer(), ping(late)) == [True]
    assert heard(signer(), ping(too_late)) == [False]


def test_only_heartbeats_and_radio_reports_need_no_signature() -> None:
    bare = codec.Encoder(255, 190)
    names = ("HEARTBEAT", "RADIO_STATUS", "PING", "COMMAND_LONG", "PARAM_SET", "SETUP_SIGNING")
    taken = [heard(signer(), bare.encode(codec.message(name))) for name in names]
    assert taken == [[True], [True], [False], [False], [False], [False]]


def test_our_stamps_follow_the_clock_and_those_heard_and_never_fall() -> None:
    ours, end = signer(), pymavlink_end()
    ours.keep_time(UNIX_S - 100.0)
    assert ours.timestamp == NOW
    end.signing.timestamp = NOW + 500
    heard(ours, ping(end))
    assert ours.timestamp == NOW + 500
    stamps = [int.from_bytes(codec.Encoder(1, 1, ours).encode(codec.message("PING"))[-12:-6], "little") for _ in "abc"]
    assert stamps == [NOW + 501, NOW + 502, NOW + 503]


def test_a_captured_frame_is_refused_after_a_restart_even_with_the_clock_set_back() -> None:
    saved: list[int] = []
    ours, end = signer(save=saved.append), pymavlink_end()
    captured = ping(end)
    assert heard(ours, captured) == [True]
    ours.keep_time(UNIX_S + 61.0)
    assert len(saved) == 2
    again = Signer(KEY, after_restart(saved[-1]))
    again.keep_time(UNIX_S - 3600.0)
    assert heard(again, captured) == [False]


def test_stamps_are_saved_once_a_minute() -> None:
    saved: list[int] = []
    ours = signer(save=saved.append)
    for k in range(600):
        ours.keep_time(UNIX_S + k * 0.5)
    assert len(saved) == pytest.approx(5, abs=1)


def test_the_streams_kept_are_bounded() -> None:
    ours, end = signer(), pymavlink_end()
    for system in range(1, 200):
        end.srcSystem = system
        assert heard(ours, ping(end)) == [True]
    assert len(ours._heard) == signing.STREAMS_MAX


def test_a_key_is_read_as_bytes_or_as_digits(tmp_path: Path) -> None:
    path = tmp_path / "key"
    for content in (KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\n"):
        path.write_bytes(content)
        assert read_key(path) == KEY


@pytest.mark.parametrize("content", [b"", b"short", KEY + b"\n", KEY.hex()[:-1].encode(), b"g" * 64])
def test_a_file_that_holds_no_key_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "key"
    path.write_bytes(content)
    with pytest.raises(KeyFileError, match=r"key: .* 32 bytes or 64 hexadecimal digits"):
        read_key(path)
    with pytest.raises(KeyFileError, match="nowhere"):
        read_key(tmp_path / "nowhere")
