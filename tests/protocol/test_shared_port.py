"""One port for all vehicles: who hears what, who is answered by whom, and what a flood costs."""

import pytest

from sitl.mavlink.codec import Encoder, Parser, mav, message
from sitl.mavlink.endpoint import Endpoint, PortKind
from sitl.mavlink.limits import DAEMON, UNLIMITED, shared
from sitl.mavlink.shared import SharedPort
from sitl.mavlink.signing import Signer
from sitl.mavlink.streams import Profile
from sitl.vehicle import Vehicle, load_vehicle

GCS, OTHER = ("127.0.0.1", 14550), ("127.0.0.1", 50_000)
SYSTEMS = (1, 2, 3)
ARM = mav.MAV_CMD_COMPONENT_ARM_DISARM


class Swarm:
    def __init__(self, limits=UNLIMITED, signers=(None, None), forward=False) -> None:
        spec = load_vehicle("yawsitter")
        self.vehicles = [Vehicle(spec) for _ in SYSTEMS]
        self.endpoints = [
            Endpoint(vehicle, system_id=system, signer=signers[0], forward=forward)
            for vehicle, system in zip(self.vehicles, SYSTEMS, strict=True)
        ]
        self.port = SharedPort(self.endpoints, limits, signers[0], forward=forward)
        self.encoder = Encoder(255, 190, signers[1])

    def say(self, name, address=GCS, wall_s=0.0, **fields) -> bool:
        return self.port.receive(self.encoder.encode(message(name, **fields)), address, wall_s)

    def heard(self, wall_s=0.0) -> list:
        """(address, frame) of all that is sent now, in order."""
        sent = [datagram for endpoint in self.endpoints for datagram in endpoint.poll(wall_s)]
        assert {datagram.kind for datagram in sent} <= {PortKind.SHARED}
        parser = Parser()
        return [(datagram.address, frame) for datagram in sent for frame in parser.feed(datagram.data)]

    def acks(self, wall_s=0.0) -> list:
        found = [(address, frame.system) for address, frame in self.heard(wall_s) if frame.name == "COMMAND_ACK"]
        return found


@pytest.fixture
def swarm() -> Swarm:
    swarm = Swarm()
    for vehicle in swarm.vehicles:
        vehicle.advance(100_000)
    swarm.say("HEARTBEAT", type=6, mavlink_version=3)
    swarm.heard()
    return swarm


def test_a_message_goes_to_the_vehicle_that_it_names_and_that_one_answers(swarm) -> None:
    swarm.say("COMMAND_LONG", target_system=2, target_component=1, command=ARM, param1=1.0)
    assert swarm.acks() == [(GCS, 2)]
    assert [vehicle.commander.armed for vehicle in swarm.vehicles] == [False, True, False]


def test_a_broadcast_goes_to_all_of_them(swarm) -> None:
    swarm.say("COMMAND_LONG", target_system=0, target_component=1, command=ARM, param1=1.0)
    assert swarm.acks() == [(GCS, system) for system in SYSTEMS]


def test_a_message_for_a_system_that_is_not_there_ends_here(swarm) -> None:
    assert swarm.say("COMMAND_LONG", target_system=9, target_component=1, command=ARM, param1=1.0)
    assert swarm.acks() == []


def test_whoever_has_spoken_to_one_is_served_by_all_and_answers_go_to_the_asker_alone(swarm) -> None:
    swarm.say("COMMAND_LONG", OTHER, target_system=1, target_component=1, command=ARM, param1=1.0)
    sent = swarm.heard()
    greeted = {frame.system for address, frame in sent if address == OTHER and frame.name == "HEARTBEAT"}
    assert greeted == set(SYSTEMS)
    assert [address for address, frame in sent if frame.name == "COMMAND_ACK"] == [OTHER]


def test_who_speaks_to_one_only_is_not_forgotten_by_the_others(swarm) -> None:
    for second in range(40):
        swarm.say("COMMAND_LONG", wall_s=float(second), target_system=1, target_component=1, command=ARM, param1=1.0)
        swarm.heard(float(second))
    assert [len(endpoint.peers) for endpoint in swarm.endpoints] == [1, 1, 1]
    assert {frame.system for _, frame in swarm.heard(41.0) if frame.name == "HEARTBEAT"} == set(SYSTEMS)


def test_our_own_messages_that_come_back_are_nobodys(swarm) -> None:
    swarm.encoder.system, swarm.encoder.component = 2, 1
    swarm.say("COMMAND_LONG", target_system=1, target_component=1, command=ARM, param1=1.0)
    assert swarm.acks() == []


def test_a_vehicle_that_fails_at_a_message_keeps_it_from_nobody(swarm, caplog) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("broken")

    swarm.endpoints[0].take = fail
    swarm.say("COMMAND_LONG", target_system=0, target_component=1, command=ARM, param1=1.0)
    assert swarm.acks() == [(GCS, 2), (GCS, 3)]
    assert swarm.port.faults == 1


def test_a_broadcast_costs_its_sender_once_for_each_vehicle() -> None:
    def accepted(target: int) -> int:
        swarm = Swarm(shared(DAEMON, len(SYSTEMS)))
        swarm.say("HEARTBEAT", type=6, mavlink_version=3)
        return sum(swarm.say("PARAM_REQUEST_READ", target_system=target, target_component=7) for _ in range(5000))

    assert accepted(0) == pytest.approx(accepted(1) / len(SYSTEMS), rel=0.01)


def test_half_a_frame_from_one_does_not_eat_anothers(swarm) -> None:
    whole = swarm.encoder.encode(message("COMMAND_LONG", target_system=2, target_component=1, command=ARM, param1=1.0))
    swarm.port.receive(whole[:10], OTHER, 0.0)
    swarm.port.receive(whole, GCS, 0.0)
    assert swarm.acks() == [(GCS, 2)]


def test_with_a_key_a_signed_broadcast_is_taken_by_all_and_only_once() -> None:
    key = bytes(range(32))
    swarm = Swarm(signers=(Signer(key, unix_s=1.8e9), Signer(key, unix_s=1.8e9)))
    for vehicle in swarm.vehicles:
        vehicle.advance(100_000)
    swarm.encoder.signer.keep_time(0.0)
    arm = message("COMMAND_LONG", target_system=0, target_component=1, command=ARM, param1=1.0)
    frame = swarm.encoder.encode(arm)
    swarm.port.receive(frame, GCS, 0.0)
    assert swarm.acks() == [(GCS, system) for system in SYSTEMS]
    swarm.port.receive(frame, GCS, 0.0)
    assert swarm.acks() == []
    assert swarm.port.unauthentic == 1


def test_a_profile_slows_what_nobody_asked_for_and_leaves_unheard_peers_their_heartbeats_alone() -> None:
    profile = Profile(10.0, (PortKind.ONBOARD,))
    vehicle = Vehicle(load_vehicle("yawsitter"))
    static = [(PortKind.SHARED, GCS), (PortKind.ONBOARD, OTHER)]
    endpoint = Endpoint(vehicle, static_peers=static, profile=profile)

    def second() -> list:
        sent = []
        for _ in range(50):
            vehicle.advance(vehicle.now_us + 20_000)
            sent += endpoint.poll(vehicle.now_us * 1e-6)
        parser = Parser()
        return [(datagram.kind, frame.name) for datagram in sent for frame in parser.feed(datagram.data)]

    second()
    sent = second()
    assert sent.count((PortKind.SHARED, "ATTITUDE")) == 10
    assert sent.count((PortKind.SHARED, "VFR_HUD")) == 4
    assert {name for kind, name in sent if kind is PortKind.ONBOARD} == {"HEARTBEAT"}
    hello = Encoder(255, 190).encode(message("HEARTBEAT", type=6, mavlink_version=3))
    endpoint.receive(hello, OTHER, PortKind.ONBOARD, vehicle.now_us * 1e-6)
    assert second().count((PortKind.ONBOARD, "ATTITUDE")) in (10, 11)


class Party:
    """Two ground stations at the shared port, and a camera at the second vehicle's own."""

    camera = ("127.0.0.1", 50_001)

    def __init__(self, forward: bool) -> None:
        self.swarm = Swarm(forward=forward)
        self._encoders = {GCS: Encoder(255, 190), OTHER: Encoder(254, 190), self.camera: Encoder(2, 100)}
        for address in self._encoders:
            self.heard_when_said("HEARTBEAT", address, type=6, mavlink_version=3)

    def heard_when_said(self, name: str, address, **fields) -> list:
        """Who hears it then, each as often as it does."""
        frame = self._encoders[address].encode(message(name, **fields))
        if address is self.camera:
            self.swarm.endpoints[1].receive(frame, address, PortKind.ONBOARD, 0.0)
        else:
            self.swarm.port.receive(frame, address, 0.0)
        sent = [datagram for endpoint in self.swarm.endpoints for datagram in endpoint.poll(0.0)]
        return sorted(datagram.address for datagram in sent if datagram.data == frame)


def test_what_is_forwarded_reaches_everybody_whom_it_concerns_once() -> None:
    party = Party(forward=True)
    camera = party.camera
    assert party.heard_when_said("HEARTBEAT", GCS, type=6) == [OTHER, camera]
    assert party.heard_when_said("STATUSTEXT", camera, text=b"smile") == [GCS, OTHER]
    assert party.heard_when_said("COMMAND_LONG", GCS, target_system=2, target_component=100, command=203) == [camera]
    assert party.heard_when_said("COMMAND_ACK", camera, command=203, target_system=255, target_component=190) == [GCS]
    assert party.heard_when_said("COMMAND_LONG", GCS, target_system=254, target_component=190, command=1) == [OTHER]
    assert party.heard_when_said("COMMAND_LONG", GCS, target_system=3, target_component=1, command=ARM) == []
    assert party.heard_when_said("COMMAND_LONG", GCS, target_system=77, target_component=1, command=ARM) == []


def test_nothing_is_forwarded_unless_asked_for() -> None:
    party = Party(forward=False)
    assert party.heard_when_said("HEARTBEAT", GCS, type=6) == []
    assert party.heard_when_said("STATUSTEXT", party.camera, text=b"smile") == []
    assert party.heard_when_said("COMMAND_LONG", GCS, target_system=254, target_component=190, command=1) == []
