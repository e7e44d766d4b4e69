"""The seconds before the vehicle is there: heartbeats that say MAV_STATE_BOOT while its kernels load or compile.

Light on purpose: nothing here may import numpy, numba or the vehicle, so that the first HEARTBEAT leaves within a
fraction of a second. Requests that arrive meanwhile are not kept, since acting on them seconds later would surprise
whoever sent them; clients repeat them.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Generic

from sitl.daemon.config import Address
from sitl.daemon.udp import Place, Sockets
from sitl.mavlink.codec import Encoder
from sitl.mavlink.identity import COMPONENT_ID, Identity, boot_heartbeat
from sitl.mavlink.signing import SIGNATURE_BYTES, Signer, is_signed

HEARTBEAT_S = 1.0
HEARD_MAX = 16
_HEARTBEAT_BYTES = 21  # header 10, payload 9, checksum 2


def is_lone_heartbeat(data: bytes) -> bool:
    """Whether a datagram is one MAVLink 2 HEARTBEAT, signed or not, and nothing else."""
    if len(data) not in (_HEARTBEAT_BYTES, _HEARTBEAT_BYTES + SIGNATURE_BYTES) or data[0] != 0xFD:
        return False
    return data[7:10] == b"\0\0\0" and is_signed(data) == (len(data) > _HEARTBEAT_BYTES)


class Boot(Generic[Place]):
    """Heartbeats to the static peers and to whoever has written. voices: the system ids that speak at each place."""

    def __init__(
        self,
        sockets: Sockets[Place],
        identity: Identity,
        voices: Mapping[Place, Sequence[int]],
        peers: Iterable[tuple[Place, Address]],
        signer: Signer | None = None,
    ) -> None:
        self.heard: dict[tuple[Place, Address], bytes] = {}  # the last lone HEARTBEAT of each, for the vehicle to learn
        self._sockets = sockets
        self._message = boot_heartbeat(identity)
        self._voices = voices
        self._signer = signer
        self._encoders = {peer: self._made(peer) for peer in peers}
        self._due_s = float("-inf")

    def _made(self, peer: tuple[Place, Address]) -> list[Encoder]:
        return [Encoder(system, COMPONENT_ID, self._signer) for system in self._voices[peer[0]]]

    def turn(self, wall_s: float) -> None:
        """Read what is there; heartbeat to everyone when it is time, and at once to a newcomer."""
        if self._signer is not None:
            self._signer.keep_time(wall_s)
        for place, address, data in self._sockets.receive():
            if not is_lone_heartbeat(data) or len(self.heard) >= HEARD_MAX:
                continue
            self.heard[place, address] = data
            if (place, address) not in self._encoders:
                self._encoders[place, address] = self._made((place, address))
                self._send((place, address))
        if wall_s >= self._due_s:
            self._due_s = wall_s + HEARTBEAT_S
            for peer in self._encoders:
                self._send(peer)

    def _send(self, peer: tuple[Place, Address]) -> None:
        for encoder in self._encoders[peer]:
            self._sockets.send(*peer, encoder.encode(self._message))
