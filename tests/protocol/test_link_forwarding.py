"""Passing messages on between peers."""

from collections.abc import Callable

import pytest
from mavlink_pair import Station, World

from sitl.mavlink.codec import mav
from sitl.mavlink.endpoint import PortKind
from sitl.mavlink.signing import Signer

MakeWorld = Callable[..., World]


class Party:
    """A ground station, a camera that belongs to our system, and another vehicle, each behind its own address."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.ground = self.join(255, 190)
        self.camera = self.join(1, 100)
        self.other = self.join(2, 1)
        world.run(0.6)
        self.forget()

    def join(self, system: int, component: int) -> Station:
        station = self.world.station(kind=PortKind.GCS, system=system, component=component, greeting=False)
        station.send("HEARTBEAT", type=mav.MAV_TYPE_GENERIC)
        self.world.run(0.02)
        return station

    def forget(self) -> None:
        for station in self.world.stations:
            station.forget()

    def who_heard(self, name: str, system: int) -> list[Station]:
        return [
            station
            for station in self.world.stations
            for frame in station.heard
            if frame.name == name and frame.system == system
        ]


@pytest.fixture
def party(make_world: MakeWorld) -> Party:
    return Party(make_world(forward=True))


def send(party: Party, name: str, by: Station, **fields: object) -> list[Station]:
    party.forget()
    by.send(name, **fields)
    party.world.run(0.05)
    return party.who_heard(name, by.encoder.system)


def test_off_unless_asked_for(world: World) -> None:
    party = Party(world)
    assert send(party, "HEARTBEAT", party.ground, type=6) == []
    assert send(party, "COMMAND_LONG", party.ground, target_system=2, target_component=1, command=400) == []


def test_a_broadcast_reaches_all_others_and_never_its_sender(party: Party) -> None:
    assert send(party, "HEARTBEAT", party.other, type=2) == [party.ground, party.camera]
    assert send(party, "STATUSTEXT", party.camera, text="smile") == [party.ground, party.other]
    assert send(party, "COMMAND_LONG", party.ground, command=520, param1=1) == [party.camera, party.other]


def test_a_message_for_another_system_reaches_the_peer_behind_which_it_was_heard(party: Party) -> None:
    to_other = {"target_system": 2, "target_component": 1, "command": 400, "param1": 1.0}
    assert send(party, "COMMAND_LONG", party.ground, **to_other) == [party.other]
    assert send(party, "COMMAND_ACK", party.other, command=400, target_system=255, target_component=190) == [
        party.ground
    ]
    assert send(party, "COMMAND_LONG", party.ground, target_system=77, command=400) == []
    assert not party.world.vehicle.commander.armed


def test_another_component_of_our_system_gets_what_is_meant_for_it_and_we_keep_what_is_ours(party: Party) -> None:
    def request(component: int) -> list[Station]:
        fields = {"target_system": 1, "target_component": component, "command": 512, "param1": 148.0}
        return send(party, "COMMAND_LONG", party.ground, **fields)

    assert request(100) == [party.camera]
    assert party.ground.all("COMMAND_ACK") == []
    assert request(1) == []
    assert len(party.ground.all("COMMAND_ACK")) == 1
    assert request(0) == [party.camera]  # to all of our system
    assert len(party.ground.all("COMMAND_ACK")) == 1
    assert request(55) == []


def test_two_systems_behind_one_address_are_both_found_and_not_echoed_to_each_other(party: Party) -> None:
    party.other.encoder.system = 3
    send(party, "HEARTBEAT", party.other, type=2)
    assert send(party, "PARAM_REQUEST_LIST", party.ground, target_system=3, target_component=1) == [party.other]
    assert send(party, "PARAM_REQUEST_LIST", party.other, target_system=2, target_component=1) == []


def test_what_comes_round_a_loop_is_not_sent_round_again(party: Party) -> None:
    """Two peers that pass on to each other everything that they hear from us."""
    for station, mirror in ((party.camera, party.other), (party.other, party.camera)):
        station.react = lambda frame, mirror=mirror: mirror.send_bytes(frame.raw)
    party.ground.send("STATUSTEXT", text="once")
    party.world.run(2.0)
    texts = [frame for frame in party.camera.heard + party.other.heard if frame.name == "STATUSTEXT"]
    assert len([frame for frame in texts if frame.system == 255]) <= 4
    assert len([m for m in party.ground.all("STATUSTEXT") if m.text == "once"]) <= 1


def test_the_heartbeats_of_others_change_nothing_in_our_own_state(party: Party) -> None:
    before = party.world.vehicle.snapshot()._replace(now_us=0)
    flags = mav.MAV_MODE_FLAG_SAFETY_ARMED | mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    for _ in range(3):
        fields = {"type": 19, "autopilot": 12, "base_mode": flags, "custom_mode": 67371008, "system_status": 4}
        party.other.send("HEARTBEAT", **fields)
        party.world.run(1.0)
    after = party.world.vehicle.snapshot()._replace(now_us=0)
    assert (after.mode, after.armed) == (before.mode, before.armed)
    own = [frame.message for frame in party.ground.heard if frame.name == "HEARTBEAT" and frame.system == 1]
    assert all(m.custom_mode == 50593792 for m in own)


def test_keys_and_radio_reports_stay_where_they_were_said(party: Party) -> None:
    assert send(party, "SETUP_SIGNING", party.ground, target_system=2, target_component=1) == []
    assert send(party, "RADIO_STATUS", party.ground) == []


def test_frames_go_on_byte_for_byte_so_that_signatures_stay_good(make_world: MakeWorld) -> None:
    unix_s = 1_750_000_000.0
    world = make_world(forward=True, signer=Signer(b"k" * 32), wall_s=unix_s)
    party = Party(world)
    signer = Signer(b"k" * 32)
    signer.keep_time(unix_s + 10.0)
    party.ground.encoder.signer = signer
    party.ground.send("STATUSTEXT", text="signed")
    sent = party.ground.up._on_the_way[-1][-1]
    world.run(0.05)
    assert [frame.raw for frame in party.other.heard if frame.system == 255] == [sent]
    party.ground.encoder.signer = None
    assert send(party, "STATUSTEXT", party.ground, text="unsigned") == []


def test_viewers_and_peers_of_version_1_are_not_sent_what_they_can_t_read(make_world: MakeWorld) -> None:
    world = make_world(forward=True, static_peers=[(PortKind.VIEWER, ("127.0.0.1", 5000))])
    viewer = world.station(kind=PortKind.VIEWER, greeting=False)
    old = world.station(kind=PortKind.GCS, system=9, greeting=False)
    old.encoder.version = 1
    old.send("HEARTBEAT", type=6)
    new = world.station(kind=PortKind.GCS)
    new.send("STATUSTEXT", text="new")
    old.send("STATUSTEXT", text="old")
    world.run(0.05)
    assert not [frame for frame in viewer.heard + old.heard if frame.system in (255, 9)]
    assert [m.text for m in new.all("STATUSTEXT")][-1] == "old"
