"""A .tlog: one MAVLink frame after the other, each behind the wall time at which it passed."""

import struct

STAMP = struct.Struct(">Q")  # µs since 1970


def stamped(frame: bytes, unix_s: float) -> bytes:
    """A frame as it stands in the file."""
    return STAMP.pack(int(unix_s * 1e6)) + frame
