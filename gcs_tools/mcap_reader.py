"""The messages in an .mcap of `sitl run --record`, as far as the file is sound."""

import io
import struct
from collections.abc import Iterator
from typing import NamedTuple

ROOT = "yawsitter"  # of every key: yawsitter/<instance>/<topic>


class Message(NamedTuple):
    """`instance` is None where the key is no vehicle's."""

    key: str
    instance: int | None
    topic: str
    log_ns: int
    payload: bytes


def messages(data: bytes, damage: list[str]) -> Iterator[Message]:
    """Each message in the file's order; what keeps from reading on is added to `damage`, one sentence each.

    A file whose writer was killed is read up to there.
    """
    from mcap.exceptions import McapError
    from mcap.records import Channel, DataEnd
    from mcap.records import Message as Record
    from mcap.stream_reader import StreamReader
    from zstandard import ZstdError

    broken = (McapError, ZstdError, EOFError, LookupError, ValueError, RuntimeError, MemoryError, OverflowError)
    stream = io.BytesIO(data)
    channels: dict[int, tuple[str, int | None, str]] = {}
    complete = False
    try:
        for record in StreamReader(stream, validate_crcs=True).records:
            if isinstance(record, Record):
                yield Message(*channels[record.channel_id], int(record.log_time), bytes(record.data))
            elif isinstance(record, Channel):
                channels[record.id] = _parts(record.topic)
            elif isinstance(record, DataEnd):
                complete = True
    except (*broken, struct.error) as e:
        if not complete:
            why = str(e) or type(e).__name__
            damage.append(f"read up to byte {stream.tell()} of {len(data)}, there it is broken or cut off: {why}")
        return
    if not complete:
        damage.append(f"ends at byte {len(data)} without its end: the writer was stopped")


def _parts(key: str) -> tuple[str, int | None, str]:
    root, _, rest = key.partition("/")
    instance, _, topic = rest.partition("/")
    return key, int(instance) if root == ROOT and instance.isdecimal() else None, topic
