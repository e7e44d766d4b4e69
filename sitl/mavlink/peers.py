"""Who is on the other side: addresses, each with its own numbering, parser, stream rates and transfers.

A peer that sends one sound frame to either port is learned by its address and served until it falls silent. Static
peers (the ports where ground stations and offboard programs listen by convention) are served always; falling silent
takes them back to what they were before they were heard. Forgetting a peer forgets all that was kept for it.
"""

from collections.abc import Iterable, Iterator

from sitl.mavlink.codec import Encoder, Parser
from sitl.mavlink.commands import Answers
from sitl.mavlink.identity import COMPONENT_ID
from sitl.mavlink.limits import Allowance, Limits
from sitl.mavlink.parameters import Listing
from sitl.mavlink.signing import Signer
from sitl.mavlink.streams import FULL, PortKind, Profile, Schedule

__all__ = ["Address", "Peer", "Peers", "PortKind"]

Address = tuple[str, int]

SILENT_S = 15.0  # wall time after which a peer is forgotten: a ground station heartbeats every second
LEARNED_MAX = 32  # peers beyond the static ones
QUIET_S = 3.0  # wall time after which a peer makes way for a newcomer where there are so many: never one that speaks


_LINK_NUMBERS = {kind: number for number, kind in enumerate(PortKind)}  # in signatures


class Peer:
    """One address at one port."""

    def __init__(
        self,
        kind: PortKind,
        address: Address,
        encoder: Encoder,
        limits: Limits,
        now_us: int,
        *,
        static: bool = False,
        profile: Profile = FULL,
    ) -> None:
        self.kind = kind
        self.address = address
        self.static = static
        self.encoder = encoder
        self.allowance = Allowance(limits.peer_Hz, limits.peer_burst)
        self._profile = profile
        self.reset(now_us)

    def reset(self, now_us: int) -> None:
        """As if never heard; only the count of frames goes on."""
        self.heard_s: float | None = None
        self.encoder.version = 2
        self.speaks_v2 = False
        self.parser = Parser()
        self.streams = not self.static or self.kind not in self._profile.on_hearing
        self.schedule = Schedule(self.kind, now_us, self._profile)
        self.listing = Listing()
        self.answers = Answers()
        self.routes: set[tuple[int, int]] = set()  # systems and components behind this address
        self.complaints: dict[str, float] = {}  # refusals told, and when: a stream of bad targets is one text

    def hear(self, version: int, wall_s: float) -> bool:
        """Note a sound frame in `version` of the framing; True if it is the first one."""
        first = self.heard_s is None
        self.heard_s = wall_s
        self.streams = True
        if version == 2:
            self.speaks_v2 = True
        self.encoder.version = 2 if self.speaks_v2 or self.encoder.signer is not None else 1
        return first


class Peers:
    """All peers of one vehicle."""

    def __init__(
        self,
        system_id: int,
        static: Iterable[tuple[PortKind, Address]],
        now_us: int,
        limits: Limits,
        signer: Signer | None,
        profile: Profile = FULL,
    ) -> None:
        self._system_id, self._limits, self._signer, self._profile = system_id, limits, signer, profile
        self._peers: dict[tuple[PortKind, Address], Peer] = {}
        for kind, address in static:
            self._add(kind, address, now_us, static=True)

    def _add(self, kind: PortKind, address: Address, now_us: int, *, static: bool = False) -> Peer:
        encoder = Encoder(self._system_id, COMPONENT_ID, self._signer, _LINK_NUMBERS[kind])
        peer = Peer(kind, address, encoder, self._limits, now_us, static=static, profile=self._profile)
        self._peers[kind, address] = peer
        return peer

    def __iter__(self) -> Iterator[Peer]:
        return iter(self._peers.values())

    def __len__(self) -> int:
        return len(self._peers)

    def __contains__(self, peer: Peer) -> bool:
        return self._peers.get((peer.kind, peer.address)) is peer

    @property
    def primary(self) -> Peer | None:
        """The first peer: what goes out to all is shown once, as it goes to this one."""
        return next(iter(self._peers.values()), None)

    def find(self, kind: PortKind, address: Address) -> Peer | None:
        return self._peers.get((kind, address))

    def learn(self, kind: PortKind, address: Address, wall_s: float, now_us: int) -> Peer | None:
        """A new peer, in place of the one longest unheard if there are too many; None if all of them still speak."""
        learned = [(peer.heard_s or 0.0, key) for key, peer in self._peers.items() if not peer.static]
        if len(learned) >= LEARNED_MAX:
            heard_s, oldest = min(learned, key=lambda entry: entry[0])
            if wall_s - heard_s < QUIET_S:
                return None
            del self._peers[oldest]
        return self._add(kind, address, now_us)

    def forget_silent(self, wall_s: float, now_us: int) -> None:
        """Drop the learned peers that have been silent too long, and take the static ones back to their start."""
        for key, peer in list(self._peers.items()):
            if peer.heard_s is None or wall_s - peer.heard_s < SILENT_S:
                continue
            if peer.static:
                peer.reset(now_us)
            else:
                del self._peers[key]
