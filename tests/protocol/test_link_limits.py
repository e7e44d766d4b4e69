"""A flood costs its sender, not the others."""

from collections.abc import Callable

import pytest
from mavlink_pair import World

from sitl.mavlink.codec import Encoder, mav, message
from sitl.mavlink.endpoint import PortKind
from sitl.mavlink.limits import DAEMON
from sitl.mavlink.peers import LEARNED_MAX

MakeWorld = Callable[..., World]
REQUEST = message("COMMAND_LONG", target_system=1, target_component=1, command=512, param1=30.0)


def flood(world: World, port: int, data: bytes, count: int, hosts: int = 1) -> None:
    for k in range(count):
        host = f"10.0.{k % hosts // 250}.{k % hosts % 250}"
        world.endpoint.receive(data, (host, port), PortKind.GCS, world.wall_s)


def test_one_peers_flood_leaves_the_others_their_answers(make_world: MakeWorld) -> None:
    world = make_world(limits=DAEMON)
    station = world.station(kind=PortKind.GCS)
    data = Encoder(254, 190).encode(REQUEST)
    for _ in range(200):  # 20,000 a second for two seconds
        flood(world, 7000, data, 200)
        world.step()
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 30) == [0]
    answered = len([d for d in world.sent if d.address == ("10.0.0.0", 7000)])
    assert answered < 2 * (2 * DAEMON.peer_Hz + DAEMON.peer_burst) + 2 * 1000  # ATTITUDE and ACK each, and the streams
    assert world.endpoint.refused > 40_000 - 2 * DAEMON.peer_Hz - 2 * DAEMON.peer_burst
    beats = [frame for frame in station.heard if frame.name == "HEARTBEAT"]
    assert len(beats) >= 3


def test_thousands_of_addresses_share_one_allowance_and_cost_bounded_memory(make_world: MakeWorld) -> None:
    world = make_world(limits=DAEMON)
    station = world.station(kind=PortKind.GCS)
    data = Encoder(254, 190).encode(REQUEST)
    for _ in range(500):
        flood(world, 7000, data, 20, hosts=10_000)
        if world.wall_s % 1.0 < 0.01:
            station.send("HEARTBEAT", type=mav.MAV_TYPE_GCS)
        world.step()
    assert len(world.endpoint.peers) <= LEARNED_MAX
    assert station.address in {peer.address for peer in world.endpoint.peers}
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 30) == [0]


def test_many_frames_in_one_datagram_count_as_many(make_world: MakeWorld) -> None:
    world = make_world(limits=DAEMON)
    station = world.station(kind=PortKind.GCS)
    ping = Encoder(254, 190).encode(message("PING", seq=1))
    station.send_bytes(ping * 1200)
    world.step()
    station.forget()
    station.send_bytes(ping)
    world.step()
    assert station.all("PING") == []
    world.run(0.2)
    station.send_bytes(ping)
    world.run(0.05)
    assert len(station.all("PING")) == 1


@pytest.mark.parametrize("size", [300, 60_000])
def test_rubbish_is_counted_and_the_longer_the_sooner_refused(make_world: MakeWorld, size: int) -> None:
    world = make_world(limits=DAEMON)
    for _ in range(100):
        world.endpoint.receive(b"\xfd" * size, ("10.0.0.1", 7000), PortKind.GCS, 0.0)
    assert world.endpoint.unreadable + world.endpoint.refused == 100
    assert len(world.endpoint.peers) == 0
    assert (world.endpoint.refused > 90) == (size > 1000)


def test_refusals_are_told_without_flooding_the_log(make_world: MakeWorld, caplog: pytest.LogCaptureFixture) -> None:
    world = make_world(limits=DAEMON)
    data = Encoder(254, 190).encode(REQUEST)
    for _ in range(1500):
        flood(world, 7000, data, 100)
        world.step()
    told = [record for record in caplog.records if "refused" in record.message]
    assert len(told) == 2
