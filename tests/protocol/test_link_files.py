"""MAVLink FTP over good and bad links: what a client may read, what it may change, and what it may not."""

import json
import lzma
import random
from collections.abc import Callable
from typing import Any

import pytest
from mavlink_pair import Station, Wire, World

from gcs_tools.client import Client, LinkError, Script
from gcs_tools.ftp import Ftp, FtpError
from sitl.mavlink.codec import mav
from sitl.mavlink.files import MemoryArea
from sitl.mavlink.ftp import CLIENTS_MAX, IDLE_S, SESSIONS_MAX
from sitl.mavlink.ftp_payload import DATA_MAX, UINT32, Error, Op, Packet, crc32

BAD = {"drop": 0.2, "duplicate": 0.05, "jitter_s": 0.1}
LOG = random.Random(5).randbytes(200_000)


@pytest.fixture
def world(make_world: Callable[..., World]) -> World:
    """The simulation stands: files are served at wall time. One recorded flight."""
    return make_world(speed=0.0, logs=MemoryArea({("flight.tlog",): LOG, ("empty.tlog",): b""}))


class Asker:
    """A station that sends raw FTP packets and collects the raw answers."""

    def __init__(self, world: World, **settings: Any) -> None:
        self.world, self.station = world, world.station(**settings)
        self.sequence = 0

    def send(self, op: int, data: bytes = b"", *, sequence: int | None = None, **fields: int) -> None:
        self.sequence = self.sequence + 1 if sequence is None else sequence
        packet = Packet(self.sequence & 0xFFFF, 0, op, len(data), 0, 0, 0, data)._replace(**fields)
        self.station.send("FILE_TRANSFER_PROTOCOL", target_system=1, target_component=1, payload=packet.pack())

    def answers(self) -> list[Packet]:
        return [Packet.of(bytes(m.payload)) for m in self.station.all("FILE_TRANSFER_PROTOCOL")]

    def ask(self, op: int, data: bytes = b"", **fields: int) -> Packet:
        """Exactly one answer, and it fits the request."""
        self.station.forget()
        self.send(op, data, **fields)
        self.world.run(0.05)
        [answer] = self.answers()
        assert answer.sequence == (self.sequence + 1) & 0xFFFF
        assert answer.request == op
        return answer

    def refused(self, op: int, data: bytes = b"", **fields: int) -> int:
        answer = self.ask(op, data, **fields)
        assert answer.opcode == Op.NAK
        return answer.data[0]

    def accepted(self, op: int, data: bytes = b"", **fields: int) -> Packet:
        answer = self.ask(op, data, **fields)
        assert answer.opcode == Op.ACK, answer
        return answer


@pytest.fixture
def asker(world: World) -> Asker:
    return Asker(world)


def fetch(path: str) -> Callable[[Client], Script[bytes]]:
    """A script that reads a file and checks it against the vehicle's checksum."""

    def script(client: Client) -> Script[bytes]:
        parts: dict[int, bytes] = {}
        with Ftp(client) as ftp:
            yield from ftp.read(path, parts.__setitem__)
            data = b"".join(parts[offset] for offset in sorted(parts))
            assert (yield from ftp.checksum(path)) == crc32(data)
        return data

    return script


def with_ftp(talk: Callable[[Ftp], Script[Any]]) -> Callable[[Client], Script[Any]]:
    def script(client: Client) -> Script[Any]:
        with Ftp(client) as ftp:
            return (yield from talk(ftp))

    return script


# --- reading


def test_the_capability_is_claimed(world: World) -> None:
    station = world.station()
    station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 148)
    assert station.all("AUTOPILOT_VERSION")[0].capabilities & mav.MAV_PROTOCOL_CAPABILITY_FTP


def test_a_file_is_read_whole_and_its_checksum_fits(world: World) -> None:
    assert world.converse(world.station(), fetch("/logs/flight.tlog"), 2.0) == LOG
    assert world.converse(world.station(), fetch("/logs/empty.tlog"), 2.0) == b""


def test_a_file_comes_whole_over_a_link_that_loses_repeats_delays_and_reorders(world: World) -> None:
    station = world.station(greeting=False, up=Wire(seed=1, **BAD), down=Wire(seed=2, **BAD))
    assert world.converse(station, fetch("/logs/flight.tlog"), 120.0) == LOG


def test_files_are_written_over_such_a_link_too(world: World) -> None:
    station = world.station(greeting=False, up=Wire(seed=3, **BAD), down=Wire(seed=4, **BAD))
    data = LOG[:20_000]

    def talk(ftp: Ftp) -> Script[int]:
        yield from ftp.write("/scratch/plan.bin", data)
        return (yield from ftp.checksum("/scratch/plan.bin"))

    assert world.converse(station, with_ftp(talk), 120.0) == crc32(data)


def test_bursts_are_paced_not_flung(world: World, asker: Asker) -> None:
    asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog")
    asker.station.forget()
    asker.send(Op.BURST_READ_FILE, size=DATA_MAX)
    world.run(0.2)
    first = asker.answers()
    assert sum(len(p.data) for p in first) < 40_000  # then it waits to be asked for more
    assert [p.burst_complete for p in first] == [0] * (len(first) - 1) + [1]
    assert [p.sequence for p in first] == list(range(asker.sequence + 1, asker.sequence + 1 + len(first)))
    assert b"".join(p.data for p in first) == LOG[: len(first) * DATA_MAX]


def test_a_burst_to_the_end_closes_with_eof(world: World, asker: Asker) -> None:
    asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog")
    asker.station.forget()
    asker.send(Op.BURST_READ_FILE, size=80, offset=len(LOG) - 200)
    world.run(0.1)
    *data, end = asker.answers()
    assert [len(p.data) for p in data] == [80, 80, 40]
    assert (end.opcode, end.data, end.offset) == (Op.NAK, bytes([Error.EOF]), len(LOG))


def test_a_folder_is_listed_piece_by_piece(make_world: Callable[..., World]) -> None:
    names = [f"flight-number-{k:03}.tlog" for k in range(100)]
    world = make_world(speed=0.0, logs=MemoryArea({(name,): bytes(k) for k, name in enumerate(names)}))
    found = world.converse(world.station(), with_ftp(lambda ftp: ftp.entries("/logs")), 5.0)
    assert found == [(name, k) for k, name in enumerate(names)]
    root = world.converse(world.station(), with_ftp(lambda ftp: ftp.entries("/")), 5.0)
    assert root == [("logs", None), ("metadata", None), ("scratch", None)]
    assert world.converse(world.station(), with_ftp(lambda ftp: ftp.entries("scratch/")), 5.0) == []


def test_several_clients_read_at_once_each_with_sessions_of_its_own(world: World) -> None:
    one, two = Asker(world), Asker(world)
    for asker in (one, two):
        assert asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog").session == 0
    assert one.accepted(Op.RESET_SESSIONS).opcode == Op.ACK
    assert two.accepted(Op.READ_FILE, size=10).data == LOG[:10]
    behind = Asker(world, system=77)
    assert behind.refused(Op.READ_FILE, size=10) == Error.INVALID_SESSION


def test_two_components_at_one_address_do_not_mix(world: World, asker: Asker) -> None:
    asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog")
    asker.station.encoder.component = 7
    assert asker.refused(Op.READ_FILE, size=10) == Error.INVALID_SESSION


# --- changing


def test_the_scratch_area_is_the_clients_to_change(asker: Asker) -> None:
    asker.accepted(Op.CREATE_DIRECTORY, b"/scratch/a")
    session = asker.accepted(Op.CREATE_FILE, b"/scratch/a/x").session
    asker.accepted(Op.WRITE_FILE, b"hello world", session=session)
    asker.accepted(Op.WRITE_FILE, b"W", session=session, offset=6)
    asker.accepted(Op.TERMINATE_SESSION, session=session)
    asker.accepted(Op.RENAME, b"/scratch/a/x\0/scratch/a/y")
    asker.accepted(Op.TRUNCATE_FILE, b"/scratch/a/y", offset=7)
    assert UINT32.unpack(asker.accepted(Op.CALC_FILE_CRC32, b"/scratch/a/y").data)[0] == crc32(b"hello W")
    assert asker.accepted(Op.LIST_DIRECTORY, b"/scratch/a").data == b"Fy\t7\0"
    session = asker.accepted(Op.OPEN_FILE_WO, b"/scratch/a/y").session
    asker.accepted(Op.WRITE_FILE, b"H", session=session)
    asker.accepted(Op.RESET_SESSIONS)
    session = asker.accepted(Op.OPEN_FILE_RO, b"/scratch/a/y").session
    assert asker.accepted(Op.READ_FILE, session=session, size=DATA_MAX).data == b"Hello W"
    assert asker.refused(Op.REMOVE_DIRECTORY, b"/scratch/a") == Error.FAIL_ERRNO  # not empty
    asker.accepted(Op.REMOVE_FILE, b"/scratch/a/y")
    asker.accepted(Op.REMOVE_DIRECTORY, b"/scratch/a")
    assert asker.refused(Op.LIST_DIRECTORY, b"/scratch/a") == Error.FILE_NOT_FOUND


@pytest.mark.parametrize("path", ["/logs/flight.tlog", "/metadata/general.json.xz", "/logs", "/", "/scratch", "/new"])
def test_all_else_is_only_to_be_read(world: World, asker: Asker, path: str) -> None:
    name = path.encode()
    for op in (Op.CREATE_FILE, Op.OPEN_FILE_WO, Op.REMOVE_FILE, Op.CREATE_DIRECTORY, Op.REMOVE_DIRECTORY):
        assert asker.refused(op, name) == Error.FILE_PROTECTED, op
    assert asker.refused(Op.TRUNCATE_FILE, name) == Error.FILE_PROTECTED
    assert asker.refused(Op.RENAME, name + b"\0/scratch/mine") == Error.FILE_PROTECTED
    assert asker.refused(Op.RENAME, b"/scratch/mine\0" + name) == Error.FILE_PROTECTED
    assert world.converse(world.station(), fetch("/logs/flight.tlog"), 2.0) == LOG


def test_what_was_opened_to_read_is_not_written_to(asker: Asker) -> None:
    session = asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog").session
    assert asker.refused(Op.WRITE_FILE, b"x", session=session) == Error.FILE_PROTECTED


@pytest.mark.parametrize("path", ["/../etc/passwd", "/logs/../../x", "..", "/scratch/a/../../../x"])
@pytest.mark.parametrize("op", [Op.OPEN_FILE_RO, Op.LIST_DIRECTORY, Op.CREATE_FILE, Op.REMOVE_FILE, Op.CALC_FILE_CRC32])
def test_no_path_leads_out(asker: Asker, path: str, op: Op) -> None:
    assert asker.refused(op, path.encode()) == Error.FILE_PROTECTED


REFUSED = [
    (Op.OPEN_FILE_RO, b"/logs/none", {}, Error.FILE_NOT_FOUND),
    (Op.OPEN_FILE_RO, b"/nowhere/none", {}, Error.FILE_NOT_FOUND),
    (Op.OPEN_FILE_RO, b"/logs/flight.tlog/x", {}, Error.FILE_NOT_FOUND),
    (Op.OPEN_FILE_RO, b"", {}, Error.FAIL_ERRNO),
    (Op.CREATE_FILE, b"/scratch/none/x", {}, Error.FILE_NOT_FOUND),
    (Op.LIST_DIRECTORY, b"/none", {}, Error.FILE_NOT_FOUND),
    (Op.LIST_DIRECTORY, b"/logs", {"offset": 2}, Error.EOF),
    (Op.REMOVE_FILE, b"/scratch/none", {}, Error.FILE_NOT_FOUND),
    (Op.RENAME, b"/scratch/none", {}, Error.FAIL_ERRNO),
    (Op.CALC_FILE_CRC32, b"/logs/none", {}, Error.FILE_NOT_FOUND),
    (Op.READ_FILE, b"", {"session": 3}, Error.INVALID_SESSION),
    (Op.BURST_READ_FILE, b"", {"session": 255}, Error.INVALID_SESSION),
    (Op.WRITE_FILE, b"x", {"session": 3}, Error.INVALID_SESSION),
    (Op.TERMINATE_SESSION, b"", {"session": 3}, Error.INVALID_SESSION),
    (Op.READ_FILE, b"", {"size": 240}, Error.INVALID_DATA_SIZE),
    (16, b"", {}, Error.UNKNOWN_COMMAND),
    (127, b"", {}, Error.UNKNOWN_COMMAND),
    (255, b"", {}, Error.UNKNOWN_COMMAND),
]


@pytest.mark.parametrize(("op", "data", "fields", "error"), REFUSED)
def test_what_can_t_be_done_is_a_nak_that_says_why(
    asker: Asker, op: int, data: bytes, fields: dict[str, int], error: Error
) -> None:
    assert asker.refused(op, data, **fields) == error
    assert asker.accepted(Op.NONE).data == b""


def test_making_a_folder_twice_is_told_apart(asker: Asker) -> None:
    asker.accepted(Op.CREATE_DIRECTORY, b"/scratch/a")
    assert asker.refused(Op.CREATE_DIRECTORY, b"/scratch/a") == Error.FILE_EXISTS


def test_an_answer_is_never_answered(world: World, asker: Asker) -> None:
    asker.station.forget()
    asker.send(Op.ACK)
    asker.send(Op.NAK, b"\x01")
    world.run(0.1)
    assert asker.answers() == []


def test_another_vehicles_files_are_not_ours_to_serve(world: World, asker: Asker) -> None:
    asker.station.forget()
    packet = Packet(1, 0, Op.LIST_DIRECTORY, 1, 0, 0, 0, b"/")
    asker.station.send("FILE_TRANSFER_PROTOCOL", target_system=9, target_component=1, payload=packet.pack())
    world.run(0.1)
    assert asker.answers() == []


# --- repetitions, sessions and their end


def test_a_repeated_request_is_answered_alike_and_done_once(world: World, asker: Asker) -> None:
    first = asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog")
    again = asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog", sequence=asker.sequence)
    assert again == first
    asker.accepted(Op.CREATE_DIRECTORY, b"/scratch/a")
    asker.accepted(Op.CREATE_DIRECTORY, b"/scratch/a", sequence=asker.sequence)
    asker.accepted(Op.REMOVE_DIRECTORY, b"/scratch/a")
    asker.accepted(Op.REMOVE_DIRECTORY, b"/scratch/a", sequence=asker.sequence)


def test_who_begins_afresh_with_the_same_numbers_gets_a_new_session(asker: Asker) -> None:
    asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog", sequence=1)
    asker.accepted(Op.TERMINATE_SESSION, sequence=2)
    asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog", sequence=1)
    assert asker.accepted(Op.READ_FILE, size=5).data == LOG[:5]


def test_a_sequence_number_used_again_later_is_a_new_request(world: World, asker: Asker) -> None:
    asker.accepted(Op.CREATE_DIRECTORY, b"/scratch/a", sequence=7)
    world.run(6.0)
    asker.station.send("HEARTBEAT", type=mav.MAV_TYPE_GCS)
    assert asker.refused(Op.CREATE_DIRECTORY, b"/scratch/a", sequence=7) == Error.FILE_EXISTS


def test_sessions_are_bounded_and_free_again_once_ended(asker: Asker) -> None:
    numbers = [asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog").session for _ in range(SESSIONS_MAX)]
    assert sorted(numbers) == list(range(SESSIONS_MAX))
    assert asker.refused(Op.OPEN_FILE_RO, b"/logs/flight.tlog") == Error.NO_SESSIONS_AVAILABLE
    asker.accepted(Op.TERMINATE_SESSION, session=2)
    assert asker.accepted(Op.OPEN_FILE_RO, b"/logs/empty.tlog").session == 2


def test_the_sessions_of_who_falls_silent_end(world: World, asker: Asker) -> None:
    asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog")
    for _ in range(int(IDLE_S) + 1):
        asker.station.send("HEARTBEAT", type=mav.MAV_TYPE_GCS)
        world.run(1.0)
    assert asker.refused(Op.READ_FILE, size=5) == Error.INVALID_SESSION


def test_clients_are_bounded_the_one_longest_unheard_makes_way(world: World, asker: Asker) -> None:
    asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog")
    for component in range(1, CLIENTS_MAX + 1):
        asker.station.encoder.component = component
        asker.accepted(Op.NONE)
    asker.station.encoder.component = 190
    assert asker.refused(Op.READ_FILE, size=5) == Error.INVALID_SESSION


def test_a_full_scratch_area_takes_no_more_and_keeps_what_it_has(make_world: Callable[..., World]) -> None:
    asker = Asker(make_world(speed=0.0, scratch=MemoryArea(capacity=100)))
    session = asker.accepted(Op.CREATE_FILE, b"/scratch/x").session
    asker.accepted(Op.WRITE_FILE, b"x" * 100, session=session)
    assert asker.refused(Op.WRITE_FILE, b"y", session=session, offset=100) == Error.FAIL_ERRNO
    assert asker.refused(Op.TRUNCATE_FILE, b"/scratch/x", offset=2**32 - 1) == Error.FAIL_ERRNO
    assert asker.accepted(Op.LIST_DIRECTORY, b"/scratch").data == b"Fx\t100\0"


def test_the_tools_name_the_vehicles_reason(world: World) -> None:
    with pytest.raises(FtpError, match=r"/logs/none: not found"):
        world.converse(world.station(), fetch("/logs/none"), 5.0)
    silent = world.station(down=Wire(drop=1.0), greeting=False)
    with pytest.raises(LinkError, match="doesn't answer"):
        world.converse(silent, fetch("/logs/flight.tlog"), 20.0)


# --- component metadata


def metadata(world: World, station: Station) -> tuple[Any, dict[str, Any], dict[str, Any]]:
    """COMPONENT_METADATA and the two files, as a ground station gets them."""
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 397) == [mav.MAV_RESULT_ACCEPTED]
    [told] = station.all("COMPONENT_METADATA")

    def read(uri: str, crc: int) -> dict[str, Any]:
        assert uri.startswith("mftp://")
        data = world.converse(world.station(), fetch(uri.removeprefix("mftp://")), 5.0)
        assert crc32(data) == crc
        assert data[:8] == b"\xfd7zXZ\0\0\x01"  # checked by CRC-32, the only check that ground stations know
        loaded: dict[str, Any] = json.loads(lzma.decompress(data))
        return loaded

    general = read(told.uri, told.file_crc)
    [entry] = [t for t in general["metadataTypes"] if t["type"] == 1]
    return told, general, read(entry["uri"], entry["fileCrc"])


def test_the_metadata_says_of_every_parameter_what_its_declaration_says(world: World) -> None:
    _, general, file = metadata(world, world.station())
    assert (general["version"], file["version"]) == (1, 1)  # the one version that QGroundControl reads
    p = world.vehicle.parameters
    assert [entry["name"] for entry in file["parameters"]] == list(p.names)
    for entry in file["parameters"]:
        d = p.declaration(entry["name"])
        assert entry["type"] == ("Int32" if d.is_int else "Float")
        assert (entry["min"], entry["max"], entry["default"]) == (d.minimum, d.maximum, d.default)
        assert (entry["shortDesc"], entry.get("longDesc", "")) == (d.short, d.long)
        assert (entry.get("units", ""), entry["group"]) == (d.unit, d.group)
        assert [(v["value"], v["description"]) for v in entry.get("values", [])] == list(d.values)
        if not d.is_int:
            assert float(f"{d.default:.{entry['decimalPlaces']}f}") == d.default


def test_what_the_vehicle_does_not_have_is_not_described(world: World) -> None:
    station = world.station()
    _, general, _ = metadata(world, station)
    assert [t["type"] for t in general["metadataTypes"]] == [1]
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 395) != [mav.MAV_RESULT_ACCEPTED]  # COMPONENT_INFORMATION
    assert station.all("COMPONENT_INFORMATION") == []


def test_the_tools_make_room_where_sessions_were_left_open(world: World, asker: Asker) -> None:
    asker.station.encoder.system, asker.station.encoder.component = 252, 190
    for _ in range(SESSIONS_MAX):
        asker.accepted(Op.OPEN_FILE_RO, b"/logs/flight.tlog")
    assert world.converse(asker.station, fetch("/logs/flight.tlog"), 5.0) == LOG
