"""MAVLink 2 signing: who has the key may speak, and nothing that was said can be said again.

A signature is the link's number, a time stamp in units of 10 µs since 2015 and the first six bytes of
SHA-256(key, frame, number, stamp). Stamps of one stream (system, component, link number) only rise; a stream heard
for the first time may not be more than a minute behind. See mavlink.io/en/guide/message_signing.html.
"""

import hashlib
import hmac
import re
from collections.abc import Callable
from pathlib import Path

KEY_BYTES = 32
SIGNATURE_BYTES = 13
STREAMS_MAX = 64  # whose latest stamps are kept; the one longest unheard makes way

_UNITS_S = 1e5
_EPOCH_S = 1_420_070_400.0  # 2015-01-01 in Unix time
_MINUTE = 6_000_000
_STAMP_MAX = (1 << 48) - 1
_UNSIGNED_TOO = (0, 109)  # HEARTBEAT, so that everybody may see who is there; RADIO_STATUS, which radios add


class KeyFileError(ValueError):
    """A key file that can't be used; the message says why in one line."""


def read_key(path: Path) -> bytes:
    """The key in a file: 32 bytes, or 64 hexadecimal digits. Raises KeyFileError."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise KeyFileError(f"{path}: {error.strerror}") from None
    if len(data) == KEY_BYTES:
        return data
    text = data.strip()
    if not re.fullmatch(rb"[0-9a-fA-F]{64}", text):
        raise KeyFileError(f"{path}: a signing key is 32 bytes or 64 hexadecimal digits; this holds {len(data)} bytes")
    return bytes.fromhex(text.decode())


class Signer:
    """One end's key, its own latest stamp, and the latest stamps that it has heard.

    timestamp: no earlier one is used any more. save: called with a stamp once a minute at most, to be handed in as
    `timestamp` (a minute later) by the next one to use the key. unix_s: Unix time where the caller's clock reads zero.
    """

    def __init__(
        self, key: bytes, timestamp: int = 0, save: Callable[[int], None] | None = None, unix_s: float = 0.0
    ) -> None:
        self.timestamp = timestamp
        self._key = key
        self._save, self._save_at = save, 0
        self._offset_s = unix_s - _EPOCH_S
        self._heard: dict[tuple[int, int, int], int] = {}

    def keep_time(self, wall_s: float) -> None:
        """Go with the clock, never back."""
        self.timestamp = min(max(self.timestamp, int((wall_s + self._offset_s) * _UNITS_S)), _STAMP_MAX)
        if self._save is not None and self.timestamp >= self._save_at:
            self._save_at = self.timestamp + _MINUTE
            self._save(self.timestamp)

    def signature(self, frame: bytes, link: int) -> bytes:
        """What makes a frame, whose flags say that it is signed, complete."""
        self.timestamp += 1
        tail = bytes([link]) + self.timestamp.to_bytes(6, "little")
        return tail + self._digest(frame, tail)

    def admits(self, frame: bytes, message_id: int, system: int, component: int) -> bool:
        """Whether a whole frame may be believed. Its stamp is then used up."""
        if not is_signed(frame):
            return message_id in _UNSIGNED_TOO
        tail = frame[-SIGNATURE_BYTES:-6]
        if not hmac.compare_digest(self._digest(frame[:-SIGNATURE_BYTES], tail), frame[-6:]):
            return False
        stream, stamp = (system, component, tail[0]), int.from_bytes(tail[1:], "little")
        latest = self._heard.pop(stream, None)
        if stamp <= (self.timestamp - _MINUTE if latest is None else latest):
            if latest is not None:
                self._heard[stream] = latest
            return False
        if len(self._heard) >= STREAMS_MAX:
            del self._heard[next(iter(self._heard))]
        self._heard[stream] = stamp
        self.timestamp = max(self.timestamp, stamp)
        return True

    def _digest(self, frame: bytes, tail: bytes) -> bytes:
        return hashlib.sha256(self._key + frame + tail).digest()[:6]


def after_restart(saved: int) -> int:
    """The stamp to go on from after the one saved last: later than all that were used since."""
    return saved + _MINUTE


def is_signed(frame: bytes) -> bool:
    return frame[0] == 0xFD and bool(frame[2] & 1)
