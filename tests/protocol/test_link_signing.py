"""A signed link: pymavlink as the client with the key, and those who have none."""

import hashlib
from collections.abc import Callable
from typing import Any

import pytest
from mavlink_pair import Station, World
from pymavlink.dialects.v20 import common

from sitl.mavlink.codec import mav
from sitl.mavlink.endpoint import PortKind
from sitl.mavlink.signing import Signer

MakeWorld = Callable[..., World]
KEY = hashlib.sha256(b"a passphrase").digest()
UNIX_S = 1_750_000_000.0


class Client:
    """pymavlink on a station's wires."""

    def __init__(self, world: World, key: bytes | None = KEY) -> None:
        self.world, self.station = world, Station(world, port=5000 + len(world.stations), kind=PortKind.GCS)
        self.heard: list[Any] = []
        self.end = common.MAVLink(None, 255, 190)
        self.end.robust_parsing = True
        if key is not None:
            self.end.signing.secret_key = key
            self.end.signing.timestamp = int((UNIX_S - 1_420_070_400) * 1e5)
            self.end.signing.sign_outgoing = True
        self.station.take = lambda data: self.heard.extend(self.end.parse_buffer(data) or ())  # type: ignore[method-assign]

    def send(self, message: Any) -> bytes:
        data = bytes(message.pack(self.end))
        self.station.send_bytes(data)
        self.world.run(0.05)
        return data

    def arm(self) -> bytes:
        return self.send(common.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))

    def all(self, name: str) -> list[Any]:
        return [m for m in self.heard if m.get_type() == name]


@pytest.fixture
def signed(make_world: MakeWorld) -> World:
    return make_world(signer=Signer(KEY), wall_s=UNIX_S)


def test_who_has_the_key_commands_and_every_answer_is_signed(signed: World) -> None:
    client = Client(signed)
    client.arm()
    assert [ack.result for ack in client.all("COMMAND_ACK")] == [0]
    assert signed.vehicle.commander.armed
    signed.run(1.0)
    assert len(client.heard) > 100
    known = [m for m in client.heard if not m.get_type().startswith("UNKNOWN")]
    assert all(m.get_signed() for m in known), {m.get_type() for m in known if not m.get_signed()}


@pytest.mark.parametrize("key", [None, bytes(32)])
def test_without_the_key_nothing_is_commanded_nor_answered(signed: World, key: bytes | None) -> None:
    client = Client(signed, key)
    client.arm()
    client.send(common.MAVLink_param_set_message(1, 1, b"POS_X_P", 1.25, 9))
    assert not signed.vehicle.commander.armed
    assert signed.sent == []
    assert signed.endpoint.unauthentic == 2


def test_a_repeated_datagram_is_refused(signed: World) -> None:
    client, thief = Client(signed), Client(signed)
    data = client.arm()
    client.send(common.MAVLink_command_long_message(1, 1, 400, 0, 0, 0, 0, 0, 0, 0, 0))
    assert not signed.vehicle.commander.armed
    thief.station.send_bytes(data)
    signed.run(0.05)
    assert not signed.vehicle.commander.armed
    assert signed.endpoint.unauthentic == 1


def test_a_heartbeat_without_a_signature_is_seen_but_does_not_count_as_a_ground_station(signed: World) -> None:
    told: list[bool] = []
    signed.vehicle.commander.link_lost = told.append
    Client(signed).send(common.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
    bare = Client(signed, None)
    for _ in range(13):
        bare.send(common.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
        signed.run(1.0)
    assert told == [True]
    assert len(signed.endpoint.peers) == 2


def test_a_peer_that_spoke_version_1_is_answered_in_version_2_which_alone_can_be_signed(signed: World) -> None:
    old = Client(signed, None)
    old.station.encoder.version = 1
    old.station.send("HEARTBEAT", type=6)
    signed.run(0.2)
    assert {m.get_msgbuf()[0] for m in old.heard if m.get_type() != "BAD_DATA"} == {0xFD}


@pytest.mark.parametrize("key", [KEY, None])
def test_a_key_is_not_taken_over_the_link_nor_shown_to_recorders(make_world: MakeWorld, key: bytes | None) -> None:
    signer = Signer(KEY) if key else None
    world = make_world(signer=signer, wall_s=UNIX_S)
    seen: list[bytes] = []
    world.endpoint.on_frame = lambda data, outgoing: seen.append(data)
    client = Client(world, key)
    other = list(range(32))
    client.send(common.MAVLink_setup_signing_message(1, 1, other, 1))
    client.arm()
    assert [ack.result for ack in client.all("COMMAND_ACK")] == [mav.MAV_RESULT_ACCEPTED]
    assert any("--signing-key" in m.text for m in client.all("STATUSTEXT"))
    assert not any(bytes(other) in data for data in seen)
