"""What passes over a link as a .tlog: each MAVLink frame behind its wall time (8 bytes, µs since 1970, big-endian)."""

import struct
from collections.abc import Iterator
from typing import BinaryIO

from sitl.mavlink.codec import frame_length

STAMP = struct.Struct(">Q")


class TlogWriter:
    """Takes datagrams; every ground station and `gcs report` read the file."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def take(self, datagram: bytes, unix_s: float) -> None:
        stamp = STAMP.pack(int(unix_s * 1e6))
        for frame in whole_frames(datagram):
            self._file.write(stamp + frame)


def whole_frames(datagram: bytes) -> Iterator[bytes]:
    """The frames in a datagram, as far as it is a row of them."""
    at = 0
    while at < len(datagram):
        length = frame_length(datagram, at)
        if not length or at + length > len(datagram):
            return
        yield datagram[at : at + length]
        at += length
