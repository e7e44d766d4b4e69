"""Transfers over UDP on loopback: the whole parameter list, over a bad link too; a mission of 500 items up and down,
verbatim; a log of a megabyte over MAVLink FTP and over LOG_*, checked byte for byte.
"""

import math
import random
from collections.abc import Iterator
from typing import Any

from benchmarks.figure import Figure, at_least, at_most, spread, told
from benchmarks.processes import BenchmarkError, converse, daemon, free_instance, onboard
from gcs_tools import logs, params
from gcs_tools.client import Client, Script
from gcs_tools.ftp import Ftp
from gcs_tools.impairment import Impairment
from gcs_tools.link import now_s
from gcs_tools.plan import Item
from gcs_tools.upload import upload
from sitl.mavlink import codec
from sitl.mavlink.codec import mav
from sitl.mavlink.wire import float32

RUNS = 5
ITEMS = 500
LOG_BYTES = 1_000_000
SEEDS = (1, 2, 3)  # of the bad link
_RETRY_S, _GIVE_UP_S = 0.5, 20.0
_GLOBAL, _RELATIVE, _LOCAL = 5, 6, 1  # MAV_FRAME


def measure(quick: bool) -> Iterator[Figure]:
    instance = free_instance()
    log = random.Random(1).randbytes(LOG_BYTES)
    with daemon(instance, "--no-zenoh", logs={"flight.tlog": log}):
        listed, count, written, up, down = converse(onboard(instance), instance + 1, _talk)
        lossy = [
            converse(onboard(instance), instance + 1, _list_all, Impairment(0.2, 0.05, 0.1, seed)) for seed in SEEDS
        ]
        by_ftp, by_log = converse(onboard(instance), instance + 1, lambda client: _read_log(client, log))
    yield at_most(f"parameter list, {count} values over UDP", listed, 0.3, "s")
    if any(n != count for n, _ in lossy):
        raise BenchmarkError(f"not all of {count} parameters came over the bad link")
    yield told("  complete with 20 % lost, 5 % doubled, 100 ms jitter", spread([took for _, took in lossy], "s"))
    yield told("  one value written and answered", spread([1e3 * t for t in written], "ms"))
    yield at_most(f"mission of {ITEMS} items up over UDP", up, 2.0, "s")
    yield at_most(f"mission of {ITEMS} items down, verbatim", down, 2.0, "s")
    yield at_least("log of 1 MB in bursts over MAVLink FTP", [LOG_BYTES / t * 1e-6 for t in by_ftp], 2.0, "MB/s")
    yield told("  the same over LOG_*", spread([LOG_BYTES / t * 1e-6 for t in by_log], "MB/s"))


def _list_all(client: Client) -> Script[tuple[int, float]]:
    begun_s = now_s()
    found = yield from params.fetch_all(client)
    return len(found), now_s() - begun_s


def _read_log(client: Client, log: bytes) -> Script[tuple[list[float], list[float]]]:
    """Seconds that it took each way."""
    ways: dict[str, list[float]] = {"ftp": [], "log": []}
    for _ in range(RUNS):
        for way, took in ways.items():
            got = bytearray(len(log))

            def place(offset: int, data: bytes, got: bytearray = got) -> None:
                got[offset : offset + len(data)] = data

            begun_s = now_s()
            if way == "ftp":
                with Ftp(client) as ftp:
                    yield from ftp.read("/logs/flight.tlog", place)
            else:
                yield from logs.pieces(client, logs.Log(0, None, len(log)), place)
            took.append(now_s() - begun_s)
            if got != log:
                raise BenchmarkError("the log came other than it is")
    return ways["ftp"], ways["log"]


def _talk(client: Client) -> Script[tuple[list[float], int, list[float], list[float], list[float]]]:
    listed, written, up, down = [], [], [], []
    count = 0
    for run in range(RUNS):
        begun_s = now_s()
        count = len((yield from params.fetch_all(client)))
        listed.append(now_s() - begun_s)
        begun_s = now_s()
        yield from params.store(client, "RATE_Y_P", 2.5 + 0.125 * run)
        written.append((now_s() - begun_s) / 2)  # it reads the old value first
        items = _items(run)
        begun_s = now_s()
        yield from upload(client, items)
        up.append(now_s() - begun_s)
        begun_s = now_s()
        stored = yield from _download(client)
        down.append(now_s() - begun_s)
        if [_text(item) for item in stored] != [_text(item) for item in items]:
            raise BenchmarkError("the mission came back other than it went")
    return listed, count, written, up, down


def _items(seed: int) -> list[Item]:
    """Waypoints in three frames with numbers that no rounding would leave as they are."""
    rng = random.Random(seed)
    items = []
    for k in range(ITEMS):
        frame = (_RELATIVE, _GLOBAL, _LOCAL)[k % 3]
        x, y = (rng.randrange(-900_000, 900_000) for _ in range(2))
        if frame != _LOCAL:
            x, y = 556_985_000 + x // 10, 373_595_000 + y // 10
        z = {_RELATIVE: 5.0, _GLOBAL: 195.0, _LOCAL: -5.0}[frame] + rng.random()
        yaw = math.nan if k % 5 else rng.uniform(-180.0, 180.0)
        items.append(Item(frame, 16, float32(rng.random()), float32(1 + rng.random()), 0.0, float32(yaw), x, y, z))
    return items


def _text(item: Item) -> str:
    """The item as the wire has it, NaN and all, for comparison."""
    return repr(tuple(float32(v) if isinstance(v, float) else v for v in item))


class _Download:
    """The items as they come; each answer asks for the next from within `receive`."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self.count: int | None = None
        self.items: list[Item] = []

    def counted(self, m: Any) -> None:
        if self.count is None:
            self.count = m.count
            self.ask()

    def ask(self) -> None:
        client = self._client
        if self.count is None:
            client.send(codec.message("MISSION_REQUEST_LIST", **client.address()))
        elif len(self.items) < self.count:
            client.send(codec.message("MISSION_REQUEST_INT", seq=len(self.items), **client.address()))

    def item(self, m: Any) -> None:
        if m.seq == len(self.items):
            self.items.append(Item(*(getattr(m, name) for name in Item._fields)))
            self.ask()


def _download(client: Client) -> Script[list[Item]]:
    download = _Download(client)
    client.on["MISSION_COUNT"], client.on["MISSION_ITEM_INT"] = download.counted, download.item
    begun_s = client.wall_s
    try:
        while download.count is None or len(download.items) < download.count:
            if client.wall_s > begun_s + _GIVE_UP_S:
                raise BenchmarkError("the mission does not come down")
            had = len(download.items)
            download.ask()
            ask_again_s = client.wall_s + _RETRY_S
            while client.wall_s < ask_again_s or len(download.items) > had:
                if download.count is not None and len(download.items) >= download.count:
                    break
                if len(download.items) > had:
                    had, ask_again_s = len(download.items), client.wall_s + _RETRY_S
                yield ask_again_s
    finally:
        del client.on["MISSION_COUNT"], client.on["MISSION_ITEM_INT"]
    client.send(codec.message("MISSION_ACK", type=mav.MAV_MISSION_ACCEPTED, **client.address()))
    return download.items
