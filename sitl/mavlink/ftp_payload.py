"""What stands in the payload of FILE_TRANSFER_PROTOCOL: MAVLink FTP's header, operations and error codes.

https://mavlink.io/en/services/ftp.html
"""

import struct
import zlib
from enum import IntEnum
from typing import NamedTuple

HEAD = struct.Struct("<HBBBBBBI")  # sequence, session, opcode, size, request's opcode, burst complete, padding, offset
DATA_MAX = 239
UINT32 = struct.Struct("<I")


class Op(IntEnum):
    NONE = 0
    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CREATE_FILE = 6
    WRITE_FILE = 7
    REMOVE_FILE = 8
    CREATE_DIRECTORY = 9
    REMOVE_DIRECTORY = 10
    OPEN_FILE_WO = 11
    TRUNCATE_FILE = 12
    RENAME = 13
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    ACK = 128
    NAK = 129


class Error(IntEnum):
    FAIL = 1
    FAIL_ERRNO = 2  # a second byte has the errno
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS_AVAILABLE = 5
    EOF = 6
    UNKNOWN_COMMAND = 7
    FILE_EXISTS = 8
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


class Packet(NamedTuple):
    """One request or reply. `size` is that of the data, in requests to read how much is wanted."""

    sequence: int
    session: int
    opcode: int
    size: int
    request: int  # in a reply: the opcode that it answers
    burst_complete: int
    offset: int
    data: bytes

    def pack(self) -> bytes:
        head = HEAD.pack(
            self.sequence, self.session, self.opcode, self.size, self.request, self.burst_complete, 0, self.offset
        )
        return head + self.data

    @classmethod
    def of(cls, payload: bytes) -> "Packet":
        """From at least HEAD.size bytes. The data are those that are there, whatever `size` says."""
        sequence, session, opcode, size, request, complete, _, offset = HEAD.unpack_from(payload)
        data = payload[HEAD.size :]
        return cls(sequence, session, opcode, size, request, complete, offset, data[:size])


def crc32(data: bytes, crc: int = 0) -> int:
    """MAVLink's CRC-32: the usual polynomial without inversions, from 0. Goes on from `crc`."""
    return zlib.crc32(data, crc ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
