"""MAVLink FTP from the client's side: folders listed, files read in bursts with gaps filled in, checksums, writing."""

from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Any, NamedTuple

from gcs_tools.blocks import Blocks
from gcs_tools.client import Client, LinkError, Script
from sitl.mavlink import codec
from sitl.mavlink.ftp_payload import DATA_MAX, UINT32, Error, Op, Packet

RETRY_S = 0.4
TRIES = 12
QUIET_S = 0.25  # of a burst that has stopped
WINDOW = 32  # gaps asked for at a time
CHECKSUM_S = 30.0  # a large file's takes the vehicle a while

_MESSAGE = codec.by_name("FILE_TRANSFER_PROTOCOL")
_REASONS: dict[int, str] = {
    Error.INVALID_DATA_SIZE: "bad size",
    Error.INVALID_SESSION: "the session has ended",
    Error.NO_SESSIONS_AVAILABLE: "too many files open",
    Error.EOF: "beyond its end",
    Error.UNKNOWN_COMMAND: "not supported",
    Error.FILE_EXISTS: "exists already",
    Error.FILE_PROTECTED: "not allowed",
    Error.FILE_NOT_FOUND: "not found",
}


class FtpError(LinkError):
    """The vehicle's NAK."""

    def __init__(self, what: str, error: int) -> None:
        super().__init__(f"{what}: {_REASONS.get(error, 'failed')}")
        self.error = error


class Listed(NamedTuple):
    name: str
    size: int | None  # None: a folder


class Ftp:
    """One conversation; use as a context, which ends what it left open."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._sequence = round(client.wall_s * 1e3) & 0xFFFF  # not that of another conversation, which may still echo
        self._inbox: deque[Packet] = deque()
        self._session: int | None = None

    def __enter__(self) -> "Ftp":
        self._client.on["FILE_TRANSFER_PROTOCOL"] = self._take
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._session is not None:
            self._send(self._request(Op.TERMINATE_SESSION, session=self._session))
        del self._client.on["FILE_TRANSFER_PROTOCOL"]

    def _take(self, m: Any) -> None:
        self._inbox.append(Packet.of(bytes(m.payload)))

    def _request(self, op: Op, *, session: int = 0, offset: int = 0, size: int = 0, data: bytes = b"") -> Packet:
        self._sequence = self._sequence + 1 & 0xFFFF
        return Packet(self._sequence, session, op, size or len(data), 0, 0, offset, data)

    def _send(self, request: Packet) -> int:
        """Returns the sequence number of the answer."""
        address = self._client.address()
        route = bytes([0, address["target_system"], address["target_component"]])
        self._client.send_packed(_MESSAGE, (route + request.pack()).rstrip(b"\0"))
        return request.sequence + 1 & 0xFFFF

    def _ask(self, what: str, request: Packet, patience_s: float = RETRY_S * TRIES) -> Script[Packet]:
        """Send until answered. Raises FtpError for a NAK, LinkError without an answer."""
        client = self._client
        end_s = client.wall_s + patience_s
        while client.wall_s < end_s:
            wanted = self._send(request)
            again_s = min(end_s, client.wall_s + RETRY_S)
            while client.wall_s < again_s:
                yield again_s
                while self._inbox:
                    packet = self._inbox.popleft()
                    if packet.sequence == wanted and packet.request == request.opcode:
                        if packet.opcode == Op.NAK:
                            raise _refusal(what, packet)
                        return packet
        raise LinkError(f"{what}: the vehicle doesn't answer")

    def _open(self, op: Op, path: str) -> Script[Packet]:
        """Open a file, in place of whatever else was left open here if there is no room."""
        for last in (False, True):
            try:
                opened = yield from self._ask(path, self._request(op, data=path.encode()))
            except FtpError as refusal:
                if last or refusal.error != Error.NO_SESSIONS_AVAILABLE:
                    raise
                yield from self._ask(path, self._request(Op.RESET_SESSIONS))
            else:
                self._session = opened.session
                return opened
        raise AssertionError

    def _close(self, path: str, session: int) -> Script[None]:
        yield from self._ask(path, self._request(Op.TERMINATE_SESSION, session=session))
        self._session = None

    def entries(self, path: str) -> Script[list[Listed]]:
        """What a folder holds."""
        found: list[Listed] = []
        offset = 0
        while True:
            try:
                answer = yield from self._ask(path, self._request(Op.LIST_DIRECTORY, offset=offset, data=path.encode()))
            except FtpError as refusal:
                if refusal.error == Error.EOF:
                    return found
                raise
            lines = answer.data.rstrip(b"\0").split(b"\0")
            offset += len(lines)
            for line in lines:
                name, _, size = line[1:].decode("utf-8", "replace").partition("\t")
                if line[:1] in (b"F", b"D"):
                    found.append(Listed(name, int(size) if line[:1] == b"F" else None))

    def checksum(self, path: str) -> Script[int]:
        answer = yield from self._ask(
            path, self._request(Op.CALC_FILE_CRC32, data=path.encode()), patience_s=CHECKSUM_S
        )
        return int(UINT32.unpack_from(answer.data)[0])

    def remove(self, path: str) -> Script[None]:
        yield from self._ask(path, self._request(Op.REMOVE_FILE, data=path.encode()))

    def write(self, path: str, data: bytes) -> Script[None]:
        """A file with this content, in place of an old one."""
        opened = yield from self._open(Op.CREATE_FILE, path)
        for offset in range(0, len(data), DATA_MAX):
            piece = data[offset : offset + DATA_MAX]
            yield from self._ask(path, self._request(Op.WRITE_FILE, session=opened.session, offset=offset, data=piece))
        yield from self._close(path, opened.session)

    def read(
        self,
        path: str,
        place: Callable[[int, bytes], None],
        *,
        start: int = 0,
        seen: Callable[[Blocks], None] = lambda _blocks: None,
    ) -> Script[Blocks]:
        """A file from byte `start` on, its pieces to `place`. `seen` is shown what has come, each time some has."""
        opened = yield from self._open(Op.OPEN_FILE_RO, path)
        blocks = Blocks(UINT32.unpack_from(opened.data)[0], DATA_MAX, place, start)
        seen(blocks)
        yield from self._bursts(path, opened.session, blocks, seen)
        yield from self._fill(path, opened.session, blocks, seen)
        yield from self._close(path, opened.session)
        return blocks

    def _bursts(self, path: str, session: int, blocks: Blocks, seen: Callable[[Blocks], None]) -> Script[None]:
        """Bursts one after the other to the file's end, whatever gets lost on the way."""
        client = self._client
        position, fruitless = blocks.start, 0
        while position < blocks.size:
            self._send(self._request(Op.BURST_READ_FILE, session=session, offset=position, size=DATA_MAX))
            before, over = position, False
            quiet_s = client.wall_s + QUIET_S
            while not over and client.wall_s < quiet_s:
                yield quiet_s
                while self._inbox:
                    packet = self._inbox.popleft()
                    if packet.request != Op.BURST_READ_FILE or packet.session != session:
                        continue
                    if packet.opcode == Op.NAK:
                        if packet.data[:1] != bytes([Error.EOF]):
                            raise _refusal(path, packet)
                        continue  # the end, which is known
                    blocks.take(packet.offset, packet.data)
                    quiet_s = client.wall_s + QUIET_S
                    position = max(position, packet.offset + len(packet.data))
                    over = over or bool(packet.burst_complete and packet.offset >= before) or position >= blocks.size
                seen(blocks)
            fruitless = 0 if position > before else fruitless + 1
            if fruitless == TRIES:
                raise LinkError(f"{path}: the vehicle sends no more of it")

    def _fill(self, path: str, session: int, blocks: Blocks, seen: Callable[[Blocks], None]) -> Script[None]:
        """Ask for what is missing, piece by piece."""
        client = self._client
        fruitless = 0
        while blocks.left:
            before = blocks.left
            waiting = set()
            for (offset, size), _ in zip(blocks.gaps(), range(WINDOW), strict=False):
                waiting.add(self._send(self._request(Op.READ_FILE, session=session, offset=offset, size=size)))
            quiet_s = client.wall_s + QUIET_S
            while waiting and client.wall_s < quiet_s:
                yield quiet_s
                while self._inbox:
                    packet = self._inbox.popleft()
                    if packet.opcode == Op.NAK and packet.sequence in waiting:
                        raise _refusal(path, packet)
                    waiting.discard(packet.sequence)
                    if packet.opcode == Op.ACK and packet.request in (Op.READ_FILE, Op.BURST_READ_FILE):
                        blocks.take(packet.offset, packet.data)
                seen(blocks)
            fruitless = 0 if blocks.left < before else fruitless + 1
            if fruitless == TRIES:
                raise LinkError(f"{path}: {blocks.left} pieces never came")


def _refusal(what: str, packet: Packet) -> FtpError:
    return FtpError(what, packet.data[0] if packet.data else Error.FAIL)
