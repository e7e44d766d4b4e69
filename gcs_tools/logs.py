"""Recorded flights off the vehicle: over MAVLink FTP, or over LOG_* where the vehicle has no FTP.

A download goes to NAME.part and gets its name when it is whole and its checksum is the vehicle's (LOG_* has none). What
a download that was broken off has left is gone on with.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from gcs_tools.blocks import Blocks
from gcs_tools.client import RETRY_S, TRIES, Client, LinkError, Script
from gcs_tools.ftp import Ftp
from sitl.mavlink import codec
from sitl.mavlink.ftp_payload import crc32

FOLDER = "/logs"
_PIECE = 90  # bytes of a LOG_DATA
_QUIET_S = 0.3
_SPAN = 200 * _PIECE
_CHECKED_AT_ONCE = 1 << 20
_KINDS = {b"\x89MCAP0\r\n": "mcap"}  # by the first bytes; a .tlog begins with a time

Show = Callable[[str, Blocks], None]


class Log(NamedTuple):
    """`name` None: known by number alone, the way of LOG_*."""

    number: int
    name: str | None
    size: int

    @property
    def label(self) -> str:
        return self.name or f"log {self.number}"


def listed(client: Client) -> Script[list[Log]]:
    """The vehicle's logs, by time."""
    try:
        with Ftp(client) as ftp:
            files = yield from ftp.entries(FOLDER)
        return [Log(number, f.name, f.size) for number, f in enumerate(f for f in files if f.size is not None)]
    except LinkError:
        return (yield from _numbered(client))


def chosen(logs: list[Log], wanted: str) -> list[Log]:
    """Those that `wanted` means: a number, the begin of names, 'latest' for the last flight's, 'all'."""
    if wanted == "all":
        return logs
    if wanted == "latest" and logs:
        last = logs[-1]
        stem = (last.name or "").rpartition(".")[0]
        return [log for log in logs if log == last or (stem and (log.name or "").startswith(stem + "."))]
    found = [log for log in logs if wanted == str(log.number) or (log.name or "").startswith(wanted)]
    if not found:
        raise LinkError(f"the vehicle has no log '{wanted}': `gcs log list` shows what there is")
    return found


def fetch(client: Client, log: Log, folder: Path, show: Show) -> Script[Path]:
    """One log into `folder`; its path. Raises LinkError, OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    if log.name is None:
        return (yield from _fetch_numbered(client, log, folder, show))
    final = folder / log.name
    with Ftp(client) as ftp:
        path = f"{FOLDER}/{log.name}"
        if final.exists() and final.stat().st_size == log.size and (yield from ftp.checksum(path)) == _checksum(final):
            return final
        part = folder / f"{log.name}.part"
        resumed = part.exists()
        yield from _into(part, lambda place, start, seen: ftp.read(path, place, start=start, seen=seen), log, show)
        if (yield from ftp.checksum(path)) != _checksum(part) and resumed:  # the rest of another file
            part.unlink()
            yield from _into(part, lambda place, start, seen: ftp.read(path, place, start=start, seen=seen), log, show)
        if (yield from ftp.checksum(path)) != _checksum(part):
            part.unlink()
            sizes = {f.name: f.size for f in (yield from ftp.entries(FOLDER))}
            grows = sizes.get(log.name) != log.size
            raise LinkError(f"{log.name}: " + ("still being written" if grows else "came damaged; try again"))
    return part.replace(final)


def erase(client: Client) -> Script[int]:
    """Erase all logs; how many files there were less than before."""
    before = len((yield from listed(client)))
    left = before
    for _ in range(TRIES):
        client.send(codec.message("LOG_ERASE", **client.address()))
        yield from client.pause(RETRY_S)
        left = len((yield from listed(client)))
        if left == 0 or client.vehicle.reasons_since(client.wall_s - RETRY_S):
            break
    return before - left


_Read = Callable[[Callable[[int, bytes], None], int, Callable[[Blocks], None]], Script[Blocks]]


def _into(part: Path, read: _Read, log: Log, show: Show) -> Script[None]:
    """Read into a file, on from where it ends. What is left of it when that fails has no gaps."""
    start = part.stat().st_size if part.exists() else 0
    known: list[Blocks] = []

    def seen(blocks: Blocks) -> None:
        known[:] = [blocks]
        show(log.label, blocks)

    with part.open("r+b" if start else "w+b") as file:

        def place(offset: int, data: bytes) -> None:
            file.seek(offset)
            file.write(data)

        try:
            yield from read(place, start, seen)
        finally:
            file.truncate(known[0].complete_to if known else start)


def _checksum(path: Path) -> int:
    crc = 0
    with path.open("rb") as file:
        while data := file.read(_CHECKED_AT_ONCE):
            crc = crc32(data, crc)
    return crc


def _numbered(client: Client) -> Script[list[Log]]:
    """LOG_REQUEST_LIST until every entry has come."""
    entries: dict[int, Any] = {}
    client.on["LOG_ENTRY"] = lambda m: entries.__setitem__(m.id, m)
    try:
        for _ in range(TRIES):
            client.send(codec.message("LOG_REQUEST_LIST", start=0, end=0xFFFF, **client.address()))
            quiet_s = client.wall_s + RETRY_S
            while client.wall_s < quiet_s:
                yield quiet_s
                total = next(iter(entries.values())).num_logs if entries else None
                if total is not None and len(entries) >= total:
                    return [Log(k, None, entries[k].size) for k in sorted(entries)] if total else []
    finally:
        del client.on["LOG_ENTRY"]
    raise LinkError("the vehicle doesn't list its logs")


def _fetch_numbered(client: Client, log: Log, folder: Path, show: Show) -> Script[Path]:
    part = folder / f"log-{log.number}.part"
    yield from _into(part, lambda place, start, seen: pieces(client, log, place, start, seen), log, show)
    with part.open("rb") as file:
        kind = _KINDS.get(file.read(8), "tlog")
    return part.replace(folder / f"log-{log.number}.{kind}")


def pieces(
    client: Client,
    log: Log,
    place: Callable[[int, bytes], None],
    start: int = 0,
    seen: Callable[[Blocks], None] = lambda _blocks: None,
) -> Script[Blocks]:
    """LOG_REQUEST_DATA for what is missing, until nothing is."""
    blocks = Blocks(log.size, _PIECE, place, start)
    arrived_s = client.wall_s
    fruitless = 0

    def take(m: Any) -> None:
        nonlocal arrived_s
        if m.id == log.number and blocks.take(m.ofs, bytes(m.data[: m.count])):
            arrived_s = client.wall_s

    client.on["LOG_DATA"] = take
    try:
        while blocks.left:
            before = blocks.left
            offset, size = next(blocks.runs())
            size = max(size, min(_SPAN, log.size - offset))  # one request for many small gaps, though some comes twice
            client.send(codec.message("LOG_REQUEST_DATA", id=log.number, ofs=offset, count=size, **client.address()))
            arrived_s = client.wall_s
            while client.wall_s < arrived_s + _QUIET_S and blocks.complete_to < offset + size:
                yield arrived_s + _QUIET_S
                seen(blocks)
            fruitless = 0 if blocks.left < before else fruitless + 1
            if fruitless == TRIES:
                raise LinkError(f"log {log.number}: the vehicle sends no more of it")
    finally:
        del client.on["LOG_DATA"]
        client.send(codec.message("LOG_REQUEST_END", **client.address()))
    return blocks
