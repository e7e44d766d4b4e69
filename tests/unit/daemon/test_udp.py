"""The sockets, on ports that the system picks."""

import socket

import pytest

from sitl.daemon.config import Port, SettingError
from sitl.daemon.udp import DATAGRAMS_AT_ONCE, Sockets


@pytest.fixture
def client():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(5.0)
        yield sock


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


@pytest.fixture
def sockets():
    ports = {Port.GCS: ("127.0.0.1", free_port()), Port.ONBOARD: ("127.0.0.1", free_port())}
    both = Sockets(ports, 0)
    both.ports = ports
    yield both
    both.close()


def test_a_datagram_says_which_port_it_came_to_and_from_whom(sockets, client) -> None:
    client.sendto(b"hello", sockets.ports[Port.ONBOARD])
    assert sockets.wait(5.0)
    assert list(sockets.receive()) == [(Port.ONBOARD, client.getsockname(), b"hello")]


def test_waiting_ends_when_the_time_is_over(sockets) -> None:
    assert not sockets.wait(0.001)
    assert not sockets.wait(-1.0)
    assert list(sockets.receive()) == []


def test_a_flood_is_taken_in_portions(sockets, client) -> None:
    for _ in range(DATAGRAMS_AT_ONCE + 5):
        client.sendto(b"x", sockets.ports[Port.GCS])
    assert len(list(sockets.receive())) == DATAGRAMS_AT_ONCE
    assert len(list(sockets.receive())) == 5
    assert sockets.received == DATAGRAMS_AT_ONCE + 5


def test_a_reply_leaves_from_the_port_that_was_written_to(sockets, client) -> None:
    sockets.send(Port.GCS, client.getsockname(), b"reply")
    assert client.recvfrom(100) == (b"reply", sockets.ports[Port.GCS])
    assert sockets.sent == 1


def test_what_the_system_refuses_is_counted_and_forgotten(sockets) -> None:
    sockets.send(Port.GCS, ("127.0.0.1", 0), b"to nowhere")
    sockets.send(Port.GCS, ("127.0.0.1", 14550), bytes(70_000))
    assert (sockets.sent, sockets.dropped) == (0, 2)


def test_a_port_in_use_is_named_with_the_way_out(sockets) -> None:
    taken = sockets.ports[Port.ONBOARD]
    free = ("127.0.0.1", free_port())
    with pytest.raises(SettingError, match=rf"UDP port {taken[1]} .* in use.*--instance 5"):
        Sockets({Port.GCS: free, Port.ONBOARD: taken}, 4)
    again = Sockets({Port.GCS: free}, 4)  # the one that had been bound was let go
    again.close()


def test_an_address_that_is_not_this_machine_s_is_refused_in_one_line() -> None:
    with pytest.raises(SettingError, match=r"can't listen on 192\.0\.2\.1"):
        Sockets({Port.GCS: ("192.0.2.1", free_port())}, 0)
