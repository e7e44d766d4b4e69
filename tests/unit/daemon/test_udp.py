"""The sockets, on ports that the system picks."""

import socket
import sys

import pytest

from sitl.daemon.config import Port, SettingError
from sitl.daemon.shunning import ADDRESSES_MAX, REFUSALS, SHUN_S
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


def test_a_flood_at_one_port_does_not_come_before_the_other_port(sockets, client) -> None:
    for _ in range(100):
        client.sendto(b"flood", sockets.ports[Port.GCS])
    client.sendto(b"request", sockets.ports[Port.ONBOARD])
    first = [data for (_, _, data), _ in zip(sockets.receive(), range(3), strict=False)]
    assert b"request" in first


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


def refuse(sockets, address, wall_s) -> None:
    for _ in range(REFUSALS):
        sockets.refused(Port.GCS, address, wall_s)


@pytest.mark.skipif(sys.platform != "linux", reason="the system has to sort datagrams by sender")
def test_a_flooding_address_is_shut_out_for_a_while_and_nobody_else_is(sockets, client) -> None:
    port = sockets.ports[Port.GCS]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flooder:
        flooder.bind(("127.0.0.1", 0))
        refuse(sockets, flooder.getsockname(), 100.0)
        for _ in range(10):
            flooder.sendto(b"flood", port)
            client.sendto(b"request", port)
        assert [data for _, _, data in sockets.receive()] == [b"request"] * 10
        sockets.send(Port.GCS, flooder.getsockname(), b"still served")
        assert flooder.recv(100) == b"still served"
        sockets.pardon(100.0 + SHUN_S - 0.1)
        flooder.sendto(b"flood", port)
        assert list(sockets.receive()) == []
        sockets.pardon(100.0 + SHUN_S)
        flooder.sendto(b"again", port)
        assert [data for _, _, data in sockets.receive()] == [b"again"]
    assert sockets.shunned == 1


def test_a_few_refusals_a_second_shut_nobody_out(sockets, client) -> None:
    for k in range(10 * REFUSALS):
        sockets.refused(Port.GCS, client.getsockname(), 100.0 + k * 2.5 / REFUSALS)
    assert sockets.shunned == 0


def test_while_one_is_shut_out_the_port_is_still_nobody_elses(sockets) -> None:
    refuse(sockets, ("127.0.0.1", 9), 100.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        with pytest.raises(OSError, match="in use"):
            other.bind(sockets.ports[Port.GCS])


def test_addresses_shut_out_are_bounded(sockets) -> None:
    for k in range(1, 200):
        refuse(sockets, ("127.0.0.1", k), 100.0)
    assert sockets.shunned <= ADDRESSES_MAX
