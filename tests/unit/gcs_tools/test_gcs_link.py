"""The tools' socket, with real ones at the other end."""

import socket

from gcs_tools_stand_in import StandIn

from gcs_tools.client import Client
from gcs_tools.link import Connection, UdpLink
from gcs_tools.watch.station import Station
from sitl.mavlink import codec


def test_vehicles_that_call_from_several_addresses_are_all_answered() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    station = Station(Client)
    try:
        with UdpLink(Connection(True, "127.0.0.1", port)) as link:
            for system, sock in enumerate(sockets, start=1):
                sock.settimeout(2.0)
                for data in StandIn(system).turn(0.0):
                    sock.sendto(data, ("127.0.0.1", port))
            while len(station.vehicles) < 2:
                link.turn(station)
            link.turn(station)
            for system, sock in enumerate(sockets, start=1):
                parser, asked = codec.Parser(), set()
                while system not in asked:
                    for frame in parser.feed(sock.recv(2048)):
                        asked.add(getattr(frame.message, "target_system", 0))
    finally:
        for sock in sockets:
            sock.close()
