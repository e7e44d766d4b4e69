"""Many clients behind one socket, as one: each vehicle's datagrams to its own client, and one heartbeat for all.

For a port that many vehicles share (`sitl swarm`). A Fleet does for a UdpLink what a Client does.
"""

import math
from collections.abc import Iterable

from gcs_tools.client import Client, LinkError


def system_of(data: bytes) -> int | None:
    """Who sent a datagram, by its first frame; all frames of one are from one vehicle."""
    if len(data) > 5 and data[0] == 0xFD:
        return data[5]
    if len(data) > 3 and data[0] == 0xFE:
        return data[3]
    return None


class Fleet:
    """`clients`: of one vehicle each, whose system ids they know. Ends when all have, or when the first one fails."""

    def __init__(self, clients: Iterable[Client]) -> None:
        self.clients = {client.system: client for client in clients}
        for quiet in list(self.clients.values())[1:]:
            quiet.heartbeats = False  # a heartbeat goes to every vehicle at the port

    def receive(self, data: bytes, wall_s: float) -> bool:
        client = self.clients.get(system_of(data))
        return client is not None and client.receive(data, wall_s)

    def poll(self, wall_s: float) -> list[bytes]:
        return [data for client in self.clients.values() for data in client.poll(wall_s)]

    @property
    def next_deadline(self) -> float:
        return min((client.next_deadline for client in self.clients.values()), default=math.inf)

    @property
    def finished(self) -> bool:
        return self.fault is not None or all(client.finished for client in self.clients.values())

    @property
    def fault(self) -> LinkError | None:
        """Of the first client that has one, with the vehicle's name."""
        for system, client in self.clients.items():
            if client.fault is not None:
                return LinkError(f"vehicle {system}: {client.fault}")
        return None
