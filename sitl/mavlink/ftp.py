"""MAVLink FTP: the vehicle's files for whoever asks with FILE_TRANSFER_PROTOCOL.

A client is a component of a system at an address. Each has sessions (open files) of its own, at most SESSIONS_MAX,
which end when it ends them, when it falls silent, or when its peer is forgotten. A request gets exactly one answer, ACK
or NAK, except a burst: packets with rising sequence numbers, until the end of the file (NAK: EOF) or until
BURST_PACKETS went out; the last says so, and the client asks for the next burst. That holds the rate to what it takes.
Requests that change something, when repeated because the answer was lost, are answered alike without being done again.

| operation                            | answer             | where                         |
|--------------------------------------|--------------------|-------------------------------|
| list a folder, from an index on      | names and sizes    | everywhere                    |
| open to read; read; burst            | size; data         | everywhere                    |
| CRC-32 of a file                     | 4 bytes, when done | everywhere                    |
| create, open to write, write         | size; bytes taken  | what is writable              |
| truncate, remove, rename, folders    | nothing            | what is writable              |
| end a session, end all               | nothing            |                               |
| anything else                        | NAK                |                               |
"""

import errno
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from sitl.mavlink.codec import Frame, by_name
from sitl.mavlink.files import Entry, Files, OpenFile
from sitl.mavlink.ftp_payload import DATA_MAX, HEAD, UINT32, Error, Op, Packet, crc32
from sitl.mavlink.limits import Allowance

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

SESSIONS_MAX = 4  # of one client
CLIENTS_MAX = 32
IDLE_S = 10.0  # wall time; PX4's
REPEATED_S = 5.0  # wall time in which the same request is a repetition
BURST_PACKETS = 147  # 35 kB, as PX4: what a client's socket holds while the client is busy
RATE_HZ = 17_000.0  # packets a second of wall time, of all bursts together: a quarter of the loop's turns goes there
CHECKSUM_BYTES = 1 << 18  # of a file, at one poll: a large log must not hold the vehicle up

_MESSAGE = by_name("FILE_TRANSFER_PROTOCOL")
_ROUTE = 3  # bytes of target network, system and component ahead of the payload proper

_ERRORS = {
    errno.ENOENT: Error.FILE_NOT_FOUND,
    errno.ENOTDIR: Error.FILE_NOT_FOUND,
    errno.EEXIST: Error.FILE_EXISTS,
    errno.EACCES: Error.FILE_PROTECTED,
    errno.EPERM: Error.FILE_PROTECTED,
    errno.EROFS: Error.FILE_PROTECTED,
    errno.EBUSY: Error.FILE_PROTECTED,
}


class _RefusedError(Exception):
    def __init__(self, error: Error) -> None:
        self.error = error


class _Answer(NamedTuple):
    data: bytes = b""
    session: int | None = None  # None: the request's


class _Session:
    """An open file, and the burst that reads it, if one does."""

    def __init__(self, file: OpenFile, writable: bool) -> None:
        self.file = file
        self.writable = writable
        self.burst: Packet | None = None  # the request; its sequence, offset and data go with what has been sent
        self.left = 0  # packets of the burst


class _Checksum:
    """A CRC-32 being worked out for `request`."""

    def __init__(self, request: Packet, file: OpenFile) -> None:
        self.request = request
        self.file = file
        self.offset = 0
        self.crc = 0


class _Client:
    def __init__(self, peer: "Peer", system: int, component: int) -> None:
        self.peer = peer
        self.route = bytes([0, system, component])
        self.sessions: dict[int, _Session] = {}
        self.checksum: _Checksum | None = None
        self.done: dict[int, tuple[bytes, bytes, float]] = {}  # by opcode: request, reply, when
        self.heard_s = 0.0

    def close(self) -> None:
        for number in list(self.sessions):
            self.end(number)
        self.end_checksum()

    def end(self, number: int) -> None:
        self.sessions.pop(number).file.close()

    def end_checksum(self) -> None:
        if self.checksum is not None:
            self.checksum.file.close()
            self.checksum = None


class FtpService:
    """Answers FILE_TRANSFER_PROTOCOL."""

    def __init__(self, link: "Link", files: Files) -> None:
        self._link = link
        self._files = files
        self._clients: dict[tuple[Peer, int, int], _Client] = {}
        self._allowance = Allowance(RATE_HZ, BURST_PACKETS)

    # --- in

    def on_request(self, peer: "Peer", frame: Frame) -> None:
        payload = frame.payload[_ROUTE:]
        client = self._client(peer, frame)
        client.heard_s = self._link.wall_s
        request = Packet.of(payload)
        if request.opcode in (Op.ACK, Op.NAK):
            return  # an answer is never answered
        kept = client.done.get(request.opcode)
        if kept is not None and kept[0] == payload and self._link.wall_s - kept[2] <= REPEATED_S:
            self._send(client, kept[1])
            return
        reply = self._answer(client, request)
        if reply is None:
            return
        self._send(client, reply)
        if request.opcode in _CHANGING:
            if request.opcode in (Op.TERMINATE_SESSION, Op.RESET_SESSIONS):
                client.done.clear()  # who opens the same file with the same number now has begun afresh
            client.done[request.opcode] = (payload, reply, self._link.wall_s)

    def _client(self, peer: "Peer", frame: Frame) -> _Client:
        key = peer, frame.system, frame.component
        client = self._clients.get(key)
        if client is None:
            if len(self._clients) >= CLIENTS_MAX:
                oldest = min(self._clients, key=lambda k: self._clients[k].heard_s)
                self._clients.pop(oldest).close()
            client = self._clients[key] = _Client(*key)
        return client

    def _answer(self, client: _Client, request: Packet) -> bytes | None:
        """The reply, None if it comes later."""
        try:
            if request.size > DATA_MAX:
                raise _RefusedError(Error.INVALID_DATA_SIZE)
            handler = self._HANDLERS.get(request.opcode)
            if handler is None:
                raise _RefusedError(Error.UNKNOWN_COMMAND)
            answer = handler(self, client, request)
        except (_RefusedError, OSError) as refusal:
            return _nak(request, refusal)
        return _ack(request, answer) if answer is not None else None

    def _none(self, client: _Client, request: Packet) -> _Answer:
        return _Answer()

    # --- sessions

    def _open(self, client: _Client, file: OpenFile, writable: bool) -> _Answer:
        number = next((k for k in range(SESSIONS_MAX) if k not in client.sessions), None)
        if number is None:
            file.close()
            raise _RefusedError(Error.NO_SESSIONS_AVAILABLE)
        client.sessions[number] = _Session(file, writable)
        return _Answer(UINT32.pack(min(file.size, 0xFFFFFFFF)), number)

    def _open_to_read(self, client: _Client, request: Packet) -> _Answer:
        return self._open(client, self._files.open(_text(request.data)), False)

    def _open_to_write(self, client: _Client, request: Packet) -> _Answer:
        file = self._files.create(_text(request.data), empty=request.opcode == Op.CREATE_FILE)
        return self._open(client, file, True)

    def _terminate(self, client: _Client, request: Packet) -> _Answer:
        _session(client, request)
        client.end(request.session)
        return _Answer()

    def _reset(self, client: _Client, request: Packet) -> _Answer:
        client.close()
        return _Answer()

    def _read(self, client: _Client, request: Packet) -> _Answer:
        file = _session(client, request).file
        if request.offset >= file.size:
            raise _RefusedError(Error.EOF)
        return _Answer(file.read(request.offset, request.size or DATA_MAX))

    def _burst(self, client: _Client, request: Packet) -> None:
        session = _session(client, request)
        session.burst, session.left = request, BURST_PACKETS

    def _write(self, client: _Client, request: Packet) -> _Answer:
        session = _session(client, request)
        if not session.writable:
            raise _RefusedError(Error.FILE_PROTECTED)
        session.file.write(request.offset, request.data)
        return _Answer(UINT32.pack(len(request.data)))

    # --- by name

    def _list(self, client: _Client, request: Packet) -> _Answer:
        entries = self._files.entries(_text(request.data))[request.offset :]
        if not entries:
            raise _RefusedError(Error.EOF)
        data = b""
        for entry in entries:
            line = _line(entry)
            if len(data) + len(line) > DATA_MAX:
                break
            data += line
        return _Answer(data)

    def _truncate(self, client: _Client, request: Packet) -> _Answer:
        self._files.truncate(_text(request.data), request.offset)
        return _Answer()

    def _change(self, client: _Client, request: Packet) -> _Answer:
        _CHANGES[request.opcode](self._files, _text(request.data))
        return _Answer()

    def _rename(self, client: _Client, request: Packet) -> _Answer:
        old, separator, new = request.data.partition(b"\0")
        if not separator:
            raise OSError(errno.EINVAL, "one name instead of two")
        self._files.rename(_text(old), _text(new))
        return _Answer()

    def _checksum(self, client: _Client, request: Packet) -> None:
        job = client.checksum
        if job is not None and job.request == request:
            return  # under way
        client.end_checksum()
        client.checksum = _Checksum(request, self._files.open(_text(request.data)))

    _HANDLERS: "dict[int, Callable[[FtpService, _Client, Packet], _Answer | None]]" = {  # noqa: RUF012
        Op.NONE: _none,
        Op.TERMINATE_SESSION: _terminate,
        Op.RESET_SESSIONS: _reset,
        Op.LIST_DIRECTORY: _list,
        Op.OPEN_FILE_RO: _open_to_read,
        Op.READ_FILE: _read,
        Op.CREATE_FILE: _open_to_write,
        Op.WRITE_FILE: _write,
        Op.REMOVE_FILE: _change,
        Op.CREATE_DIRECTORY: _change,
        Op.REMOVE_DIRECTORY: _change,
        Op.OPEN_FILE_WO: _open_to_write,
        Op.TRUNCATE_FILE: _truncate,
        Op.RENAME: _rename,
        Op.CALC_FILE_CRC32: _checksum,
        Op.BURST_READ_FILE: _burst,
    }

    # --- time

    @property
    def deadline_s(self) -> float:
        """Wall time at which there is more to send or somebody to forget."""
        wall_s = self._link.wall_s
        if any(c.checksum or any(s.burst for s in c.sessions.values()) for c in self._clients.values()):
            return wall_s + 0.001
        return min((c.heard_s + IDLE_S for c in self._clients.values()), default=float("inf"))

    def advance(self) -> None:
        """Go on with bursts and checksums, forget the silent."""
        wall_s, peers = self._link.wall_s, self._link.peers
        for key, client in list(self._clients.items()):
            if client.peer not in peers or wall_s - client.heard_s >= IDLE_S:
                self._clients.pop(key).close()
            elif client.checksum is not None:
                self._go_on(client, client.checksum)
        bursts = [(c, n, s) for c in self._clients.values() for n, s in c.sessions.items()]
        while bursts := [(c, n, s) for c, n, s in bursts if s.burst is not None]:
            for client, number, session in bursts:
                if not self._allowance.take(wall_s):
                    return
                self._send_next(client, number, session)

    def _send_next(self, client: _Client, number: int, session: _Session) -> None:
        """The next packet of a burst."""
        burst = session.burst
        assert burst is not None
        client.heard_s = self._link.wall_s
        try:
            data = session.file.read(burst.offset, burst.size or DATA_MAX)
            if not data:
                raise _RefusedError(Error.EOF)
        except (_RefusedError, OSError) as refusal:
            session.burst = None
            self._send(client, _nak(burst, refusal))
            return
        session.left -= 1
        sequence = burst.sequence + 1 & 0xFFFF
        head = HEAD.pack(sequence, number, Op.ACK, len(data), Op.BURST_READ_FILE, session.left == 0, 0, burst.offset)
        session.burst = burst._replace(sequence=sequence, offset=burst.offset + len(data)) if session.left else None
        self._send(client, head + data)

    def _go_on(self, client: _Client, job: _Checksum) -> None:
        """A piece more of a checksum; the answer when it is done."""
        try:
            data = job.file.read(job.offset, CHECKSUM_BYTES)
        except OSError as refusal:
            reply = _nak(job.request, refusal)
        else:
            job.crc = crc32(data, job.crc)
            job.offset += len(data)
            client.heard_s = self._link.wall_s
            if data:
                return
            reply = _ack(job.request, _Answer(UINT32.pack(job.crc)))
        client.end_checksum()
        self._send(client, reply)

    # --- out

    def _send(self, client: _Client, packet: bytes) -> None:
        self._link.send_packed(client.peer, _MESSAGE, (client.route + packet).rstrip(b"\0"))


_CHANGES: dict[int, Callable[[Files, str], None]] = {
    Op.REMOVE_FILE: Files.remove,
    Op.CREATE_DIRECTORY: Files.make_folder,
    Op.REMOVE_DIRECTORY: Files.remove_folder,
}
_CHANGING = {
    Op.TERMINATE_SESSION, Op.RESET_SESSIONS, Op.OPEN_FILE_RO, Op.CREATE_FILE, Op.WRITE_FILE, Op.REMOVE_FILE,
    Op.CREATE_DIRECTORY, Op.REMOVE_DIRECTORY, Op.OPEN_FILE_WO, Op.TRUNCATE_FILE, Op.RENAME,
}  # fmt: skip
"""Requests that must not be done twice."""


def _session(client: _Client, request: Packet) -> _Session:
    session = client.sessions.get(request.session)
    if session is None:
        raise _RefusedError(Error.INVALID_SESSION)
    return session


def _text(data: bytes) -> str:
    """A path: up to the first zero byte, if there is one."""
    return data.split(b"\0", 1)[0].decode("utf-8", "surrogateescape")


def _line(entry: Entry) -> bytes:
    """A folder's entry as the list has it; one whose name is too long only keeps its place."""
    name = entry.name.encode("utf-8", "surrogateescape")
    line = b"D%b\0" % name if entry.size is None else b"F%b\t%d\0" % (name, entry.size)
    return line if len(line) <= DATA_MAX else b"S\0"


def _ack(request: Packet, answer: _Answer) -> bytes:
    session = request.session if answer.session is None else answer.session
    return _reply(request, Op.ACK, session, answer.data)


def _nak(request: Packet, refusal: _RefusedError | OSError) -> bytes:
    if isinstance(refusal, _RefusedError):
        data = bytes([refusal.error])
    else:
        number = refusal.errno or 0
        error = _ERRORS.get(number, Error.FAIL_ERRNO)
        data = bytes([error, number & 0xFF]) if error is Error.FAIL_ERRNO else bytes([error])
    return _reply(request, Op.NAK, request.session, data)


def _reply(request: Packet, opcode: int, session: int, data: bytes) -> bytes:
    sequence = request.sequence + 1 & 0xFFFF
    return Packet(sequence, session, opcode, len(data), request.opcode, 0, request.offset, data).pack()
