"""The frames in a .tlog, however broken, each with the wall time at which it passed."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from sitl.mavlink import codec
from sitl.mavlink.codec import Frame
from sitl.mavlink.tlog import STAMP
from sitl.strict_yaml import ConfigError

_YEARS_US = range(946_684_800_000_000, 4_102_444_800_000_000)  # 2000 to 2100: what a stamp can be
_FOREIGN_BYTES = 1 << 20  # without a single frame, after which a file is none of ours


class Stamped(NamedTuple):
    unix_s: float
    frame: Frame


def frames(data: bytes, path: Path, damage: list[str]) -> Iterator[Stamped]:
    """The frames in a file's bytes, going on behind what is broken; what that was is added to `damage`.

    Raises ConfigError where there are none to begin with.
    """
    at, found = 0, False
    while at < len(data):
        entry = _entry(data, at)
        if entry is None:
            where, at = at, _resume(data, at + 1, None if found else _FOREIGN_BYTES)
            if at < 0:
                if not found:
                    raise ConfigError(f"{path}: is not a log: no MAVLink frames in it; allowed: .tlog, .mcap")
                damage.append(f"the last {len(data) - where} of {len(data)} bytes are no whole frame: cut off")
                return
            damage.append(f"{at - where} bytes from byte {where} on are no frames: left out")
            continue
        stamped, at = entry
        found = True
        if stamped.frame.message is not None:
            yield stamped


def _entry(data: bytes, at: int) -> tuple[Stamped, int] | None:
    """The frame whose stamp is there and where the next one starts; None if nothing sound is."""
    start = at + STAMP.size
    if start + 3 > len(data):
        return None
    length = codec.frame_length(data, start)
    if not length or start + length > len(data):
        return None
    (unix_us,) = STAMP.unpack_from(data, at)
    frame = codec.open_frame(data[start : start + length]) if unix_us in _YEARS_US else None
    return None if frame is None else (Stamped(unix_us * 1e-6, frame), start + length)


def _resume(data: bytes, at: int, within: int | None) -> int:
    """Where the next sound frame of a known message has its stamp; -1: nowhere."""
    end = len(data) if within is None else min(len(data), at + within)
    for magic in re.compile(rb"[\xfd\xfe]").finditer(data, at + STAMP.size, end):
        entry = _entry(data, magic.start() - STAMP.size)
        if entry is not None and entry[0].frame.message is not None:
            return magic.start() - STAMP.size
    return -1
