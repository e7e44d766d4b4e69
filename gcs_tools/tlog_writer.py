"""What passes over a link, kept as a .tlog."""

from collections.abc import Iterator
from typing import BinaryIO

from sitl.mavlink.codec import frame_length
from sitl.mavlink.tlog import stamped


class TlogWriter:
    """Takes datagrams; every ground station and `gcs report` read the file."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def take(self, datagram: bytes, unix_s: float) -> None:
        for frame in whole_frames(datagram):
            self._file.write(stamped(frame, unix_s))


def whole_frames(datagram: bytes) -> Iterator[bytes]:
    """The frames in a datagram, as far as it is a row of them."""
    at = 0
    while at < len(datagram):
        length = frame_length(datagram, at)
        if not length or at + length > len(datagram):
            return
        yield datagram[at : at + length]
        at += length
