"""Identity, heartbeats and peers."""

import itertools
from collections.abc import Callable

import pytest
from mavlink_pair import World

from sitl.mavlink import peers
from sitl.mavlink.codec import Encoder, Parser, mav, message
from sitl.mavlink.endpoint import Identity, PortKind
from sitl.mavlink.streams import OFF

MakeWorld = Callable[..., World]
GCS_PEER = (PortKind.GCS, ("127.0.0.1", 14550))
ONBOARD_PEER = (PortKind.ONBOARD, ("127.0.0.1", 14540))


def sent_to(world: World, port: int, name: str) -> list[object]:
    frames = [frame for d in world.sent if d.address[1] == port for frame in Parser().feed(d.data)]
    return [frame for frame in frames if frame.name == name]


@pytest.mark.parametrize(("identity", "autopilot"), [(Identity.PX4, 12), (Identity.GENERIC, 0)])
def test_the_heartbeat_names_a_simulated_tailsitter_in_hold(
    make_world: MakeWorld, identity: Identity, autopilot: int
) -> None:
    world = make_world(identity=identity)
    station = world.station()
    m = station.all("HEARTBEAT")[0]
    assert (m.type, m.autopilot, m.custom_mode) == (19, autopilot, 50593792)
    assert m.system_status == mav.MAV_STATE_STANDBY
    assert m.base_mode & mav.MAV_MODE_FLAG_HIL_ENABLED
    assert m.base_mode & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    assert not m.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED


@pytest.mark.parametrize("speed", [0.0, 1.0, 8.0])
def test_heartbeats_keep_to_wall_time_whatever_the_simulation_speed(make_world: MakeWorld, speed: float) -> None:
    world = make_world(speed=speed)
    station = world.station()
    station.forget()
    world.run(5.0)
    assert len(station.all("HEARTBEAT")) in (4, 5, 6)


def test_a_heartbeat_follows_an_arm_change_at_once(world: World) -> None:
    station = world.station()
    world.run(0.3)
    station.forget()
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [0]
    assert station.all("HEARTBEAT")[0].base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED
    assert station.all("HEARTBEAT")[0].system_status == mav.MAV_STATE_ACTIVE


def test_streams_run_on_simulation_time(make_world: MakeWorld) -> None:
    world = make_world(speed=4.0)
    station = world.station()
    station.forget()
    world.run(1.0)
    assert len(station.all("LOCAL_POSITION_NED")) == pytest.approx(120, abs=20)  # 30 Hz of simulation, seen every 40 ms
    boot = [m.time_boot_ms for m in station.all("SYSTEM_TIME")]
    assert boot[-1] - boot[0] == pytest.approx(3000, abs=100)


def test_a_standing_simulation_streams_nothing_but_answers(make_world: MakeWorld) -> None:
    world = make_world(speed=0.0)
    station = world.station()
    station.forget()
    world.run(0.5)
    assert station.all("ATTITUDE") == []
    assert station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 30) == [0]
    assert len(station.all("ATTITUDE")) == 1


def test_a_static_peer_is_served_without_ever_speaking(make_world: MakeWorld) -> None:
    world = make_world(static_peers=[GCS_PEER, ONBOARD_PEER])
    world.run(2.0)
    assert len(sent_to(world, 14550, "ATTITUDE")) == pytest.approx(100, abs=2)
    assert len(sent_to(world, 14540, "ATTITUDE")) == pytest.approx(200, abs=2)
    assert len(sent_to(world, 14550, "HEARTBEAT")) == 2


def test_a_new_peer_is_told_that_this_is_a_simulator(world: World) -> None:
    station = world.station()
    assert any("YawSitter SITL" in text and "simulated" in text for text in station.texts())


def test_bytes_that_are_no_message_make_nobody_a_peer(world: World) -> None:
    station = world.station(greeting=False)
    station.send_bytes(b"\xfd\x09\x00 garbage" * 5)
    world.run(0.1)
    assert len(world.endpoint.peers) == 0


def test_a_silent_peer_is_forgotten_and_its_rates_with_it(world: World) -> None:
    station = world.station()
    station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, 30, -1)
    world.run(peers.SILENT_S + 1.5)
    assert len(world.endpoint.peers) == 0
    station.send("HEARTBEAT", type=6)
    world.run(0.1)
    station.forget()
    world.run(1.0)
    assert len(station.all("ATTITUDE")) > 50


def test_a_static_peer_that_falls_silent_goes_back_to_default_rates(make_world: MakeWorld) -> None:
    world = make_world(static_peers=[(PortKind.ONBOARD, ("127.0.0.1", 5000))])
    station = world.station()
    station.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, 30, -1)
    (peer,) = world.endpoint.peers
    assert peer.schedule.interval(30) == OFF
    world.run(peers.SILENT_S + 1.5)
    (peer,) = world.endpoint.peers
    assert peer.schedule.interval(30) == 10_000


def test_the_peer_longest_unheard_makes_way_when_there_are_too_many(world: World) -> None:
    data = Encoder(255, 190).encode(message("HEARTBEAT", type=6))
    for k in range(200):
        world.endpoint.receive(data, ("127.0.0.1", 6000 + k), PortKind.GCS, k * 0.1)
    ports = {peer.address[1] for peer in world.endpoint.peers}
    assert ports == set(range(6200 - peers.LEARNED_MAX, 6200))


def test_a_peer_that_speaks_never_makes_way_however_many_newcomers_there_are(world: World) -> None:
    data = Encoder(255, 190).encode(message("HEARTBEAT", type=6))
    for k in range(10_000):
        wall_s = k * 0.002
        if k % 500 == 0:
            world.endpoint.receive(data, ("127.0.0.1", 5000), PortKind.GCS, wall_s)
            assert ("127.0.0.1", 5000) in {peer.address for peer in world.endpoint.peers}
        world.endpoint.receive(data, ("10.0.0.1", 1024 + k), PortKind.GCS, wall_s)
        assert len(world.endpoint.peers) <= peers.LEARNED_MAX
    assert world.endpoint.refused > 9000


def test_two_peers_have_their_own_numbering_rates_and_transfers(world: World) -> None:
    slow, fast = world.station(), world.station(kind=PortKind.GCS)
    slow.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, 30, 500_000)
    fast.ask(mav.MAV_CMD_SET_MESSAGE_INTERVAL, 30, 20_000)
    slow.forget(), fast.forget()
    world.run(2.0)
    assert len(slow.all("ATTITUDE")) == pytest.approx(4, abs=1)
    assert len(fast.all("ATTITUDE")) == pytest.approx(100, abs=2)
    for station in (slow, fast):
        numbers = [frame.sequence for frame in station.heard]
        assert all((b - a) % 256 == 1 for a, b in itertools.pairwise(numbers))


def test_half_a_frame_from_one_peer_does_not_eat_anothers(world: World) -> None:
    one, two = world.station(), world.station()
    frame = one.encoder.encode(message("COMMAND_LONG", target_system=1, command=512, param1=30))
    one.send_bytes(frame[:15])
    world.step()
    assert two.ask(mav.MAV_CMD_REQUEST_MESSAGE, 30) == [0]
    one.send_bytes(frame[15:])
    one.forget()
    world.run(0.05)
    assert [ack.result for ack in one.all("COMMAND_ACK")] == [0]


def test_a_peer_that_speaks_only_version_1_hears_version_1(world: World) -> None:
    old, new = world.station(greeting=False), world.station(greeting=False)
    old.encoder.version = 1
    for station in (old, new):
        station.send("HEARTBEAT", type=6)
    world.run(0.2)
    assert {frame.version for frame in old.heard} == {1}
    assert {frame.version for frame in new.heard} == {2}
    old.encoder.version = 2
    old.send("HEARTBEAT", type=6)
    world.run(0.02)
    old.forget()
    world.run(0.2)
    assert {frame.version for frame in old.heard} == {2}


def test_messages_for_another_system_or_component_are_left_alone(world: World) -> None:
    station = world.station()
    for system, component in ((2, 1), (1, 100), (0, 154)):
        station.send("COMMAND_LONG", target_system=system, target_component=component, command=400, param1=1)
    world.run(0.1)
    assert station.all("COMMAND_ACK") == []
    assert not world.vehicle.commander.armed


@pytest.mark.parametrize("address", [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_broadcasts_and_our_own_address_are_answered_to_the_sender(world: World, address: tuple[int, int]) -> None:
    station = world.station(system=77, component=42)
    station.send("COMMAND_LONG", target_system=address[0], target_component=address[1], command=520, param1=1)
    world.run(0.05)
    [ack] = station.all("COMMAND_ACK")
    assert (ack.result, ack.target_system, ack.target_component) == (0, 77, 42)


def test_answers_go_only_to_the_peer_that_asked(world: World) -> None:
    one, two = world.station(), world.station()
    one.ask(mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1)
    assert one.all("AUTOPILOT_VERSION")
    assert not two.all("AUTOPILOT_VERSION")
    assert not two.all("COMMAND_ACK")


def test_our_own_frames_come_back_over_a_loop_are_ignored(world: World) -> None:
    echo = world.station(system=1, component=1, greeting=False)
    echo.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    world.run(0.1)
    assert len(world.endpoint.peers) == 0
    assert not world.vehicle.commander.armed


def test_pings_and_timesyncs_are_answered_with_what_they_asked(world: World) -> None:
    station = world.station()
    station.send("PING", time_usec=123, seq=7)
    station.send("TIMESYNC", ts1=456)
    station.send("PING", time_usec=9, seq=8, target_system=5)  # somebody's answer
    station.send("TIMESYNC", ts1=1, tc1=2)  # likewise
    world.run(0.05)
    [ping] = station.all("PING")
    assert (ping.time_usec, ping.seq, ping.target_system, ping.target_component) == (123, 7, 255, 190)
    [sync] = station.all("TIMESYNC")
    assert sync.ts1 == 456
    assert abs(sync.tc1 - world.vehicle.now_us * 1000) < 60e6


def test_the_tap_sees_every_frame_once_however_many_peers_there_are(world: World) -> None:
    seen: list[tuple[bytes, bool]] = []
    one, _two = world.station(), world.station()
    world.endpoint.on_frame = lambda data, outgoing: seen.append((data, outgoing))
    one.forget()
    one.send("PING", seq=1)
    world.run(1.0)
    incoming = [data for data, outgoing in seen if not outgoing]
    assert [Parser().feed(data)[0].name for data in incoming] == ["PING"]
    outgoing = [data for data, outgoing in seen if outgoing]
    assert outgoing == [frame.raw for frame in one.heard]


def test_silent_ground_stations_are_reported_lost_and_found(world: World) -> None:
    told: list[bool] = []
    world.vehicle.commander.link_lost = told.append
    station = world.station()
    world.run(9.0)
    assert told == []
    world.run(2.0)
    assert told == [True]
    station.send("HEARTBEAT", type=mav.MAV_TYPE_GCS)
    world.run(0.1)
    assert told == [True, False]


def test_a_companions_heartbeat_is_no_ground_station(world: World) -> None:
    told: list[bool] = []
    world.vehicle.commander.link_lost = told.append
    station = world.station(greeting=False)
    station.send("HEARTBEAT", type=mav.MAV_TYPE_ONBOARD_CONTROLLER)
    world.run(20.0)
    assert told == []


def test_the_next_deadline_lies_ahead_and_no_further_than_a_heartbeat(world: World) -> None:
    world.station()
    for _ in range(50):
        world.step()
        assert world.wall_s < world.endpoint.next_deadline() <= world.wall_s + 1.0


def test_long_texts_arrive_in_chunks_that_end_in_a_zero(world: World) -> None:
    station = world.station()
    for length in (49, 50, 51, 100, 149, 700):
        world.vehicle.events.tell(4, "".join(chr(ord("a") + k % 26) for k in range(length)))
        station.forget()
        world.run(0.02)
        chunks = station.all("STATUSTEXT")
        assert len(station.texts()[0]) == length
        assert [m.chunk_seq for m in chunks] == list(range(len(chunks)))
        if length > 50:
            assert len({m.id for m in chunks}) == 1
            assert chunks[0].id != 0
            assert len(chunks[-1].text) < 50
