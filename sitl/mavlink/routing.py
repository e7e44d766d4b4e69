"""Forwarding between peers, as MAVLink's routing rules have it (mavlink.io/en/guide/routing.html).

A message for another system goes to the peers behind which that system was heard, one for another component of our
system to those behind which that component was heard, a broadcast to everybody; never back to where it came from.
Frames go on byte for byte, so signatures stay good. What is not known to the dialect can't be checked and stays here.
"""

import functools
from typing import TYPE_CHECKING

from sitl.mavlink.codec import Frame, by_id, by_name
from sitl.mavlink.identity import COMPONENT_ID
from sitl.mavlink.limits import Allowance
from sitl.mavlink.streams import PortKind

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

SEEN_S = 0.5  # the same bytes again within this time have come round a loop
SEEN_MAX = 1024
ROUTES_MAX = 64  # systems and components remembered behind one peer
# a key is for one link alone; a radio's report is about the link that it came over
_NEVER = (by_name("SETUP_SIGNING").id, by_name("RADIO_STATUS").id)


@functools.cache
def target_places(message_id: int) -> tuple[int, int]:
    """Where a message has target_system and target_component among its fields; −1: it has none."""
    names = [field.name for field in by_id(message_id).fields]
    system = "target_system" if "target_system" in names else "target"
    return (
        names.index(system) if system in names else -1,
        names.index("target_component") if "target_component" in names else -1,
    )


class Router:
    """Passes frames on between a link's peers."""

    def __init__(self, link: "Link") -> None:
        self.forwarded = 0
        self._link = link
        self._allowance = Allowance(link.limits.forwarded_Hz, link.limits.forwarded_burst)
        self._seen: dict[bytes, float] = {}

    def take(self, origin: "Peer", frame: Frame, shared: bool = True) -> None:
        """Note who is behind `origin`, and pass the frame on to whom it concerns; `shared`: at the shared port, too."""
        if len(origin.routes) < ROUTES_MAX:
            origin.routes.add((frame.system, frame.component))
        if frame.id in _NEVER or self._has_come_round(frame.raw):
            return
        for peer in self._recipients(frame):
            if (
                peer is origin
                or (peer.kind is PortKind.SHARED and not shared)
                or (peer.encoder.version == 1 and frame.version == 2)
            ):
                continue
            if not self._allowance.take(self._link.wall_s):
                return
            self._link.put(peer, frame.raw)
            self.forwarded += 1

    def _recipients(self, frame: Frame) -> "list[Peer]":
        system_place, component_place = target_places(frame.id)
        system = frame.message[system_place] if system_place >= 0 else 0
        component = frame.message[component_place] if component_place >= 0 else 0
        peers = [peer for peer in self._link.peers if peer.kind is not PortKind.VIEWER]
        if system == 0:
            return peers
        if system == self._link.system_id and component == COMPONENT_ID:
            return []
        if system == self._link.system_id and component:
            return [peer for peer in peers if (system, component) in peer.routes]
        return [peer for peer in peers if any(s == system for s, _ in peer.routes)]

    def _has_come_round(self, raw: bytes) -> bool:
        now_s, seen = self._link.wall_s, self._seen
        before_s = seen.pop(raw, None)
        if len(seen) >= SEEN_MAX:
            del seen[next(iter(seen))]
        seen[raw] = now_s
        return before_s is not None and now_s - before_s < SEEN_S
