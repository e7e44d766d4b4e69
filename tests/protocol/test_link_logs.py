"""The recorded flights over LOG_* and with the tools: listed, fetched over good and bad links, erased."""

import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from mavlink_pair import Station, Wire, World

from gcs_tools import logs
from gcs_tools.blocks import Blocks
from gcs_tools.client import Client, LinkError, Script
from sitl.mavlink.files import Entry, MemoryArea, OpenFile

BAD = {"drop": 0.2, "duplicate": 0.05, "jitter_s": 0.1}
ADDRESS = {"target_system": 1, "target_component": 1}
FLIGHTS = {
    "a.mcap": b"\x89MCAP0\r\n" + random.Random(1).randbytes(30_000),
    "a.tlog": random.Random(2).randbytes(90 * 50),
    "b.mcap": b"\x89MCAP0\r\n" + random.Random(3).randbytes(1_000),
    "b.tlog": b"",
}


class Shelf(MemoryArea):
    """An area with times, and a file that is in use."""

    def entries(self, path: Any) -> list[Entry]:
        return [entry._replace(changed_s=1_700_000_000.5) for entry in super().entries(path)]

    def remove(self, path: Any) -> None:
        if path == ("b.tlog",):
            raise OSError(16, "busy")
        super().remove(path)


@pytest.fixture
def world(make_world: Callable[..., World]) -> World:
    return make_world(speed=0.0, logs=Shelf({(name,): data for name, data in FLIGHTS.items()}))


def pieces(station: Station) -> list[tuple[int, bytes]]:
    return [(m.ofs, bytes(m.data[: m.count])) for m in station.all("LOG_DATA")]


def request(world: World, station: Station, number: int, offset: int, count: int) -> list[tuple[int, bytes]]:
    station.forget()
    station.send("LOG_REQUEST_DATA", **ADDRESS, id=number, ofs=offset, count=count)
    world.run(0.5)
    return pieces(station)


def test_every_file_is_listed_with_its_size_and_time(world: World) -> None:
    station = world.station()
    station.send("LOG_REQUEST_LIST", **ADDRESS, start=0, end=0xFFFF)
    world.run(0.1)
    told = [(m.id, m.num_logs, m.last_log_num, m.time_utc, m.size) for m in station.all("LOG_ENTRY")]
    assert told == [(k, 4, 3, 1_700_000_000, len(data)) for k, data in enumerate(FLIGHTS.values())]
    station.forget()
    station.send("LOG_REQUEST_LIST", **ADDRESS, start=1, end=2)
    world.run(0.1)
    assert [m.id for m in station.all("LOG_ENTRY")] == [1, 2]


def test_no_logs_are_told_as_none(make_world: Callable[..., World]) -> None:
    world = make_world(speed=0.0)
    station = world.station()
    station.send("LOG_REQUEST_LIST", **ADDRESS, start=0, end=0xFFFF)
    world.run(0.1)
    [m] = station.all("LOG_ENTRY")
    assert (m.num_logs, m.size) == (0, 0)


def test_a_log_flows_from_where_it_is_wanted_and_a_short_piece_says_where_it_ends(world: World) -> None:
    station, whole = world.station(), FLIGHTS["a.mcap"]
    got = request(world, station, 0, 0, 0xFFFFFFFF)
    assert b"".join(data for _, data in got) == whole
    assert [offset for offset, _ in got] == list(range(0, len(whole), 90))
    assert request(world, station, 0, 900, 200) == [
        (900, whole[900:990]),
        (990, whole[990:1080]),
        (1080, whole[1080:1100]),
    ]
    assert request(world, station, 1, 90 * 49, 1000)[-1] == (90 * 50, b"")  # it ends where a piece does
    assert request(world, station, 3, 0, 90) == [(0, b"")]


def test_what_is_not_there_is_answered_by_an_empty_piece(world: World) -> None:
    station = world.station()
    assert request(world, station, 99, 180, 90) == [(180, b"")]
    assert request(world, station, 0, 4_000_000_000, 90) == [(4_000_000_000, b"")]


def test_data_are_paced_and_stop_when_told(world: World) -> None:
    station = world.station()
    station.send("LOG_REQUEST_DATA", **ADDRESS, id=0, ofs=0, count=0xFFFFFFFF)
    world.step()
    first = len(pieces(station))
    assert 50 <= first <= 110
    station.send("LOG_REQUEST_END", **ADDRESS)
    world.run(0.02)
    stopped = len(pieces(station))
    world.run(0.5)
    assert len(pieces(station)) == stopped < len(FLIGHTS["a.mcap"]) // 90


def test_a_new_request_takes_the_place_of_the_old(world: World) -> None:
    station = world.station()
    station.send("LOG_REQUEST_DATA", **ADDRESS, id=0, ofs=0, count=0xFFFFFFFF)
    world.step()
    assert {offset for offset, _ in request(world, station, 1, 0, 180)} >= {0, 90}
    assert len(pieces(station)) < 110


def test_two_stations_read_different_logs_at_once(world: World) -> None:
    one, two = world.station(), world.station()
    one.send("LOG_REQUEST_DATA", **ADDRESS, id=0, ofs=0, count=0xFFFFFFFF)
    two.send("LOG_REQUEST_DATA", **ADDRESS, id=1, ofs=0, count=0xFFFFFFFF)
    world.run(1.0)
    assert b"".join(data for _, data in pieces(one)) == FLIGHTS["a.mcap"]
    assert b"".join(data for _, data in pieces(two)) == FLIGHTS["a.tlog"]


def test_numbers_stay_as_they_were_told_while_flights_come_and_go(world: World) -> None:
    station = world.station()
    station.send("LOG_REQUEST_LIST", **ADDRESS, start=0, end=0xFFFF)
    world.run(0.1)
    world.endpoint._logs._area.remove(("a.mcap",))
    assert request(world, station, 1, 0, 90) == [(0, FLIGHTS["a.tlog"][:90])]
    assert request(world, station, 0, 0, 90) == [(0, b"")]


def test_erasing_keeps_what_is_being_written_and_says_so(world: World) -> None:
    station = world.station()
    station.send("LOG_ERASE", **ADDRESS)
    world.run(0.1)
    assert [text for text in station.texts() if "kept" in text] != []
    station.send("LOG_REQUEST_LIST", **ADDRESS, start=0, end=0xFFFF)
    world.run(0.1)
    assert [(m.num_logs, m.size) for m in station.all("LOG_ENTRY")] == [(1, 0)]


# --- the tools


def without_ftp(station: Station) -> Station:
    """A station whose FTP requests get lost."""
    send = station.send_bytes
    station.send_bytes = lambda data: None if data[7:10] == b"\x6e\0\0" else send(data)  # type: ignore[method-assign]
    return station


def fetch_all(folder: Path) -> Callable[[Client], Script[list[Path]]]:
    def script(client: Client) -> Script[list[Path]]:
        paths = []
        for log in (yield from logs.listed(client)):
            paths.append((yield from logs.fetch(client, log, folder, lambda _name, _blocks: None)))
        return paths

    return script


def bad(world: World) -> Station:
    return world.station(greeting=False, up=Wire(seed=8, **BAD), down=Wire(seed=9, **BAD))


def test_all_logs_are_fetched_by_ftp_and_checked_over_a_bad_link(world: World, tmp_path: Path) -> None:
    paths = world.converse(bad(world), fetch_all(tmp_path), 200.0)
    assert {path.name: path.read_bytes() for path in paths} == FLIGHTS
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(FLIGHTS)


def test_without_ftp_all_logs_are_fetched_by_number_over_a_bad_link(world: World, tmp_path: Path) -> None:
    paths = world.converse(without_ftp(bad(world)), fetch_all(tmp_path), 200.0)
    assert [path.read_bytes() for path in paths] == list(FLIGHTS.values())
    assert [path.name for path in paths] == ["log-0.mcap", "log-1.tlog", "log-2.mcap", "log-3.tlog"]


def test_a_download_that_broke_off_goes_on_where_it_stopped(world: World, tmp_path: Path) -> None:
    [log] = [log for log in world.converse(world.station(), logs.listed, 5.0) if log.name == "a.mcap"]
    starts: list[int] = []

    def show(name: str, blocks: Blocks) -> None:
        starts.append(blocks.start)
        if blocks.complete_to > 10_000 and blocks.start == 0:
            raise LinkError("pulled the plug")

    with pytest.raises(LinkError, match="plug"):
        world.converse(world.station(), lambda c: logs.fetch(c, log, tmp_path, show), 20.0)
    left = (tmp_path / "a.mcap.part").stat().st_size
    assert left > 10_000
    path = world.converse(world.station(), lambda c: logs.fetch(c, log, tmp_path, show), 20.0)
    assert path.read_bytes() == FLIGHTS["a.mcap"]
    assert starts[-1] == left


def test_what_is_left_of_another_file_is_found_out_and_fetched_anew(world: World, tmp_path: Path) -> None:
    (tmp_path / "a.tlog.part").write_bytes(b"something else" * 10)
    [log] = [log for log in world.converse(world.station(), logs.listed, 5.0) if log.name == "a.tlog"]
    path = world.converse(world.station(), lambda c: logs.fetch(c, log, tmp_path, lambda _n, _b: None), 20.0)
    assert path.read_bytes() == FLIGHTS["a.tlog"]
    assert not (tmp_path / "a.tlog.part").exists()


def test_what_changes_on_the_way_is_not_passed_off_as_whole(world: World, tmp_path: Path) -> None:
    [log] = [log for log in world.converse(world.station(), logs.listed, 5.0) if log.name == "a.tlog"]
    growing: OpenFile = world.endpoint._logs._area.create(("a.tlog",), empty=False)

    def show(name: str, blocks: Blocks) -> None:
        growing.write(growing.size, b"more")

    with pytest.raises(LinkError, match="still being written"):
        world.converse(world.station(), lambda c: logs.fetch(c, log, tmp_path, show), 20.0)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_there_already_is_not_fetched_again(world: World, tmp_path: Path) -> None:
    world.converse(world.station(), fetch_all(tmp_path), 20.0)
    station = world.station()
    world.sent.clear()
    world.converse(station, fetch_all(tmp_path), 20.0)
    assert sum(len(d.data) for d in world.sent if d.address == station.address) < 10_000


def test_the_tools_erase(world: World) -> None:
    assert world.converse(world.station(), logs.erase, 20.0) == 3
    assert [log.name for log in world.converse(world.station(), logs.listed, 5.0)] == ["b.tlog"]


def test_logs_are_chosen_by_number_name_flight_or_all(world: World) -> None:
    found = world.converse(world.station(), logs.listed, 5.0)
    names: Callable[[str], Iterator[str]] = lambda wanted: [log.name for log in logs.chosen(found, wanted)]  # noqa: E731
    assert names("latest") == ["b.mcap", "b.tlog"]
    assert names("1") == ["a.tlog"]
    assert names("a") == ["a.mcap", "a.tlog"]
    assert names("all") == list(FLIGHTS)
    with pytest.raises(LinkError, match="log list"):
        logs.chosen(found, "none")
