"""The recorded flights over LOG_*: listed, sent in pieces of 90 bytes, erased.

A peer's list numbers the files from 0 by their names, that is by time; the numbers stay as they were told until it asks
for the list again. Data flow until what was asked for is through or the file ends (an empty or a short piece); what got
lost is asked for again by its offset. A new request takes the place of the one under way.
"""

from typing import TYPE_CHECKING

from sitl.mavlink.codec import Frame, by_name, message
from sitl.mavlink.files import Area, Entry, OpenFile
from sitl.mavlink.limits import Allowance
from sitl.onboard.modes import Severity

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

PIECE = 90
RATE_HZ = 6000.0  # pieces and entries a second of wall time, to all peers together: half a megabyte
AT_ONCE = 100

_DATA = by_name("LOG_DATA")


class _Reader:
    """What one peer reads."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self.listing: range = range(0)  # numbers still to be told
        self.file: OpenFile | None = None
        self.number = 0
        self.offset = 0
        self.end = 0

    @property
    def busy(self) -> bool:
        return bool(self.listing) or self.file is not None

    def stop(self) -> None:
        if self.file is not None:
            self.file.close()
            self.file = None


class LogService:
    """Answers LOG_REQUEST_LIST, LOG_REQUEST_DATA, LOG_REQUEST_END and LOG_ERASE."""

    def __init__(self, link: "Link", area: Area) -> None:
        self._link = link
        self._area = area
        self._readers: dict[Peer, _Reader] = {}
        self._allowance = Allowance(RATE_HZ, AT_ONCE)

    def _reader(self, peer: "Peer") -> _Reader:
        return self._readers.setdefault(peer, _Reader())

    def _files(self) -> list[Entry]:
        return [entry for entry in self._area.entries(()) if entry.size is not None]

    def on_list(self, peer: "Peer", frame: Frame) -> None:
        m, reader = frame.message, self._reader(peer)
        reader.entries = self._files()
        count = len(reader.entries)
        if count:
            reader.listing = range(m.start, min(m.end, count - 1) + 1)
        else:
            self._link.send(peer, message("LOG_ENTRY"))

    def on_data(self, peer: "Peer", frame: Frame) -> None:
        m, reader = frame.message, self._reader(peer)
        reader.stop()
        entries = reader.entries or self._files()
        try:
            reader.file = self._area.open((entries[m.id].name,))
        except (IndexError, OSError):
            self._send(peer, m.id, m.ofs, b"")  # there is no such file, or no longer
            return
        reader.number, reader.offset, reader.end = m.id, m.ofs, m.ofs + m.count

    def on_end(self, peer: "Peer", frame: Frame) -> None:
        self._reader(peer).stop()

    def on_erase(self, peer: "Peer", frame: Frame) -> None:
        kept = 0
        for entry in self._files():
            try:
                self._area.remove((entry.name,))
            except OSError:
                kept += 1
        for reader in self._readers.values():
            reader.stop()
            reader.entries, reader.listing = [], range(0)
        if kept:
            self._link.tell(peer, Severity.WARNING, f"{kept} log files kept: in use, or not ours to remove")

    # --- time

    @property
    def deadline_s(self) -> float:
        """Wall time at which there is more to send."""
        busy = any(reader.busy for reader in self._readers.values())
        return self._link.wall_s + 0.001 if busy else float("inf")

    def advance(self) -> None:
        """Send what may go out by now, in turns to all who read."""
        peers = self._link.peers
        for peer in [peer for peer in self._readers if peer not in peers]:
            self._readers.pop(peer).stop()
        readers = list(self._readers.items())
        while readers := [(peer, reader) for peer, reader in readers if reader.busy]:
            for peer, reader in readers:
                if not self._allowance.take(self._link.wall_s):
                    return
                self._go_on(peer, reader)

    def _go_on(self, peer: "Peer", reader: _Reader) -> None:
        """The next entry of the list, or the next piece."""
        if reader.listing:
            number, reader.listing = reader.listing[0], reader.listing[1:]
            self._tell(peer, number, reader.entries)
        elif reader.file is not None:
            wanted = min(PIECE, reader.end - reader.offset)
            try:
                data = reader.file.read(reader.offset, wanted)
            except OSError:
                data = b""
            self._send(peer, reader.number, reader.offset, data)
            reader.offset += len(data)
            if len(data) < PIECE or reader.offset >= reader.end:
                reader.stop()

    def _tell(self, peer: "Peer", number: int, entries: list[Entry]) -> None:
        entry, last = entries[number], len(entries) - 1
        counts = {"id": number, "num_logs": len(entries), "last_log_num": last}
        size, changed_s = min(entry.size or 0, 0xFFFFFFFF), int(entry.changed_s)
        self._link.send(peer, message("LOG_ENTRY", **counts, time_utc=changed_s, size=size))

    def _send(self, peer: "Peer", number: int, offset: int, data: bytes) -> None:
        payload = _DATA.struct.pack(offset, number, len(data), *data.ljust(PIECE, b"\0"))
        self._link.send_packed(peer, _DATA, payload.rstrip(b"\0") or b"\0")
