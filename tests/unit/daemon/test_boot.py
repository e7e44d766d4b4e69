"""What the vehicle says before it is there."""

import subprocess
import sys

import pytest

from sitl.daemon.boot import HEARTBEAT_S, Boot, is_lone_heartbeat
from sitl.daemon.config import Port
from sitl.mavlink.codec import Encoder, Parser, mav, message
from sitl.mavlink.identity import Identity

STATIC = (Port.GCS, ("127.0.0.1", 14550))
STRANGER = (Port.ONBOARD, ("127.0.0.1", 50_000))
HEARTBEAT = Encoder(255, 190).encode(message("HEARTBEAT", type=6, mavlink_version=3))


def voices(*systems: int) -> dict:
    return dict.fromkeys((Port.GCS, Port.ONBOARD), systems)


class Wire:
    """Sockets that keep what is sent."""

    def __init__(self) -> None:
        self.incoming: list = []
        self.outgoing: list = []

    def receive(self):
        arrived, self.incoming = self.incoming, []
        return [(*where, data) for where, data in arrived]

    def send(self, port, address, data) -> None:
        self.outgoing.append(((port, address), data))

    def taken(self) -> list:
        sent, self.outgoing = self.outgoing, []
        return sent


@pytest.fixture
def wire() -> Wire:
    return Wire()


def test_the_first_turn_already_heartbeats_as_booting(wire) -> None:
    Boot(wire, Identity.PX4, voices(7), [STATIC]).turn(100.0)
    ((peer, data),) = wire.taken()
    (frame,) = Parser().feed(data)
    assert peer == STATIC
    assert (frame.system, frame.component) == (7, 1)
    assert frame.message.system_status == mav.MAV_STATE_BOOT
    assert frame.message.type == 19  # VTOL_TAILSITTER_DUOROTOR
    assert frame.message.autopilot == mav.MAV_AUTOPILOT_PX4
    assert not frame.message.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED


def test_the_heartbeat_is_repeated_each_second_and_numbered(wire) -> None:
    boot = Boot(wire, Identity.GENERIC, voices(1), [STATIC])
    for k in range(100):
        boot.turn(k * 0.05)
    frames = [Parser().feed(data)[0] for _, data in wire.taken()]
    assert len(frames) == round(100 * 0.05 / HEARTBEAT_S)
    assert [frame.sequence for frame in frames] == list(range(len(frames)))
    assert frames[0].message.autopilot == mav.MAV_AUTOPILOT_GENERIC


def test_whoever_says_hello_is_answered_at_once_and_introduced_later(wire) -> None:
    boot = Boot(wire, Identity.PX4, voices(1), [STATIC])
    boot.turn(0.0)
    wire.taken()
    wire.incoming = [(STRANGER, HEARTBEAT)]
    boot.turn(0.1)
    assert [peer for peer, _ in wire.taken()] == [STRANGER]
    assert boot.heard == {STRANGER: HEARTBEAT}
    boot.turn(1.0)
    assert [peer for peer, _ in wire.taken()] == [STATIC, STRANGER]


def test_requests_and_garbage_are_not_kept(wire) -> None:
    boot = Boot(wire, Identity.PX4, voices(1), [])
    arm = Encoder(255, 190).encode(message("COMMAND_LONG", target_system=1, command=400, param1=1.0))
    wire.incoming = [(STRANGER, arm), (STRANGER, b""), (STRANGER, b"\xfd"), (STRANGER, HEARTBEAT + arm)]
    boot.turn(0.0)
    assert boot.heard == {}
    assert wire.taken() == []


def test_a_crowd_is_not_remembered_without_end(wire) -> None:
    boot = Boot(wire, Identity.PX4, voices(1), [])
    wire.incoming = [((Port.GCS, ("127.0.0.1", port)), HEARTBEAT) for port in range(2000, 2500)]
    boot.turn(0.0)
    assert len(boot.heard) < 20


def test_a_heartbeat_is_told_by_its_header() -> None:
    assert is_lone_heartbeat(HEARTBEAT)
    assert not is_lone_heartbeat(HEARTBEAT[:-1])


def test_nothing_heavy_is_imported_before_the_first_heartbeat() -> None:
    code = (
        "import sys, sitl.__main__, sitl.daemon.main; "
        "print([m for m in ('numba', 'numpy', 'zenoh', 'msgspec') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert out.stdout.strip() == "[]"


def test_the_port_for_whom_a_socket_is_has_the_link_s_names() -> None:
    from sitl.mavlink.peers import PortKind

    assert {port.value for port in Port} == {kind.value for kind in PortKind}
