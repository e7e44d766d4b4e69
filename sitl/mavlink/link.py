"""What all services of the link share: the vehicle, the peers, the time, and the way out for messages."""

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from sitl.mavlink.codec import Definition, message
from sitl.mavlink.identity import Identity
from sitl.mavlink.limits import Limits
from sitl.mavlink.metadata import Metadata
from sitl.mavlink.peers import Address, Peer, Peers, PortKind
from sitl.mavlink.signing import Signer
from sitl.mavlink.streams import FULL, Profile
from sitl.mavlink.view import Craft, View
from sitl.onboard.modes import Severity

if TYPE_CHECKING:
    from sitl.vehicle import Vehicle

OUTBOX_MAX = 20_000  # datagrams kept for a caller that doesn't poll
CHUNK = 50  # bytes of text in one STATUSTEXT
COMPLAIN_S = 5.0  # wall time between two texts to the same peer for the same reason
COMPLAINTS_MAX = 16


class Datagram(NamedTuple):
    """One frame on its way out of the port of `kind`."""

    kind: PortKind
    address: Address
    data: bytes


class Link:
    """The services' common ground. `wall_s` is the time of the call in progress."""

    def __init__(
        self,
        vehicle: "Vehicle",
        identity: Identity,
        system_id: int,
        static_peers: Iterable[tuple[PortKind, Address]],
        limits: Limits,
        signer: Signer | None,
        profile: Profile = FULL,
    ) -> None:
        self.vehicle = vehicle
        self.identity = identity
        self.metadata = Metadata.of(vehicle.parameters)
        self.system_id: int = system_id
        self.wall_s = 0.0
        self.limits = limits
        self.signer = signer
        self.peers = Peers(system_id, static_peers, vehicle.now_us, limits, signer, profile)
        self.on_frame: Callable[[bytes, bool], None] | None = None
        self.shutdown_requested = False
        self.reboot_requested = False
        self.outbox: list[Datagram] = []
        self._craft = Craft.of(vehicle.spec.airframe.airframe)
        self._view: View | None = None
        self._text_id = 0
        self._silent_s = (math.inf, -math.inf)  # wall time from when to when the link carries nothing

    def silence(self, seconds: float) -> None:
        """Carry nothing either way for so long, from after what is being handled now."""
        self._silent_s = (self.wall_s, self.wall_s + seconds)

    @property
    def silent(self) -> bool:
        return self._silent_s[0] < self.wall_s < self._silent_s[1]

    def view(self) -> View:
        """What the messages show of the vehicle now."""
        snapshot = self.vehicle.snapshot()
        view = self._view
        if view is None or view.s is not snapshot:
            view = self._view = View(snapshot, self._craft)
        return view

    def send(self, peer: Peer, message: Any) -> None:
        """To one peer."""
        definition: Definition = message._definition
        self.send_packed(peer, definition, definition.encode(message))

    def send_packed(self, peer: Peer, definition: Definition, payload: bytes) -> None:
        """To one peer, a payload that is packed already."""
        if not peer.encoder.carries(definition):
            return
        frame = peer.encoder.frame(definition, payload)
        self.put(peer, frame)
        if self.on_frame is not None:
            self.on_frame(frame, True)

    def broadcast(self, message: Any) -> None:
        """To every peer."""
        definition: Definition = message._definition
        self.broadcast_packed(definition, definition.encode(message))

    def broadcast_packed(self, definition: Definition, payload: bytes, but: Peer | None = None) -> None:
        """To every peer except `but`."""
        for peer in self.peers:
            if peer is not but:
                self.post(peer, definition, payload)

    def post(self, peer: Peer, definition: Definition, payload: bytes) -> None:
        """One peer's copy of what goes to all: the tap sees only the first peer's."""
        if not peer.encoder.carries(definition):
            return
        frame = peer.encoder.frame(definition, payload)
        self.put(peer, frame)
        if self.on_frame is not None and peer is self.peers.primary:
            self.on_frame(frame, True)

    def put(self, peer: Peer, frame: bytes) -> None:
        """Bytes that are a frame already."""
        if len(self.outbox) < OUTBOX_MAX:
            self.outbox.append(Datagram(peer.kind, peer.address, frame))

    def tell(self, peer: Peer | None, severity: Severity, text: str) -> None:
        """STATUSTEXT to one peer, or to all, in as many pieces as it needs."""
        data = text.encode("ascii", "replace")
        if len(data) <= CHUNK:
            pieces, identity = [data], 0
        else:
            # the last piece ends in a zero byte; a text that fills it needs an empty one after it
            pieces = [data[k : k + CHUNK] for k in range(0, len(data) + 1, CHUNK)]
            self._text_id = identity = self._text_id % 0xFFFF + 1
        for number, piece in enumerate(pieces[:256]):
            status = message("STATUSTEXT", severity=int(severity), text=piece, id=identity, chunk_seq=number)
            if peer is None:
                self.broadcast(status)
            else:
                self.send(peer, status)

    def complain(self, peer: Peer, reason: str) -> None:
        """Tell a peer why its request was refused; the same reason again only after a while."""
        told_s = peer.complaints.get(reason)
        if not reason or (told_s is not None and self.wall_s - told_s < COMPLAIN_S):
            return
        if len(peer.complaints) >= COMPLAINTS_MAX:
            peer.complaints.clear()
        peer.complaints[reason] = self.wall_s
        self.tell(peer, Severity.WARNING, reason)
