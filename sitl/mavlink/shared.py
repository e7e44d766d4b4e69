"""One port for all vehicles of a swarm, without sockets: what arrives there goes to those whom it is meant for.

As a router between the ground stations and the vehicles would (mavlink.io/en/guide/routing.html): a message for one
system goes to that vehicle alone, one without a target, or with target 0, to all of them. Whoever has been heard here
is served by every vehicle, as if it had written to each. Frames are parsed and checked once, whatever their number of
readers. What ground stations say to each other, or to a system that isn't here, ends here; where messages are forwarded
each vehicle passes them on at its own ports, and the first that gets one passes it on to the others here.
"""

import logging
from collections.abc import Callable, Iterable

from sitl.mavlink.codec import Frame, Parser
from sitl.mavlink.endpoint import Endpoint
from sitl.mavlink.identity import COMPONENT_ID
from sitl.mavlink.limits import Allowance, Limits, cost
from sitl.mavlink.peers import LEARNED_MAX, QUIET_S, SILENT_S, Address, PortKind
from sitl.mavlink.routing import target_places
from sitl.mavlink.signing import Signer

log = logging.getLogger(__name__)

AGAIN_S = 1.0  # wall time between two notices to all vehicles that an address still speaks


class _Sender:
    """One address."""

    def __init__(self, limits: Limits) -> None:
        self.parser = Parser()
        self.allowance = Allowance(limits.peer_Hz, limits.peer_burst)
        self.heard_s = float("-inf")
        self.told_s = float("-inf")


class SharedPort:
    """`endpoints` by system id; they may come and go at any time. limits: of each sender. forward: as they do."""

    def __init__(
        self, endpoints: Iterable[Endpoint], limits: Limits, signer: Signer | None = None, *, forward: bool = False
    ) -> None:
        self.endpoints = {endpoint.system_id: endpoint for endpoint in endpoints}
        self.faults = 0  # of vehicles in taking what was for them: mistakes in this program, logged
        self.refused = 0  # datagrams beyond their sender's allowance, or of one sender too many
        self.unreadable = 0  # that held no sound frame
        self.unauthentic = 0  # frames
        self._limits = limits
        self._signer = signer
        self._forward = forward
        self._senders: dict[Address, _Sender] = {}
        self._strangers = Allowance(limits.strangers_Hz, limits.strangers_burst)

    def receive(self, data: bytes, address: Address, wall_s: float) -> bool:
        """Take a datagram. Never raises, whatever the bytes. False: it was more than its sender may send."""
        sender = self._senders.get(address)
        allowance = sender.allowance if sender is not None else self._strangers
        if not allowance.take(wall_s):
            self.refused += 1
            return False
        frames = (sender.parser if sender is not None else Parser()).feed(data)
        allowance.charge(cost(data, len(frames)) - 1)
        if not frames:
            self.unreadable += 1
        for frame in frames:
            if frame.component == COMPONENT_ID and frame.system in self.endpoints:
                continue  # our own, come back over some loop
            if self._signer is not None and not self._is_authentic(self._signer, frame, wall_s):
                self.unauthentic += 1
                continue
            if sender is None:
                sender = self._learn(address, wall_s)
                if sender is None:
                    self.refused += 1
                    return False
            sender.heard_s = wall_s
            self._deliver(sender, frame, address, wall_s)
        return True

    def _is_authentic(self, signer: Signer, frame: Frame, wall_s: float) -> bool:
        signer.keep_time(wall_s)
        return signer.admits(frame.raw, frame.id, frame.system, frame.component)

    def _learn(self, address: Address, wall_s: float) -> _Sender | None:
        """Room for one more: those silent for long go, and where there are too many the one longest unheard."""
        senders = self._senders
        for silent in [each for each, s in senders.items() if wall_s - s.heard_s >= SILENT_S]:
            del senders[silent]
        if len(senders) >= LEARNED_MAX:
            oldest = min(senders, key=lambda each: senders[each].heard_s)
            if wall_s - senders[oldest].heard_s < QUIET_S:
                return None
            del senders[oldest]
        sender = senders[address] = _Sender(self._limits)
        return sender

    def _deliver(self, sender: _Sender, frame: Frame, address: Address, wall_s: float) -> None:
        if wall_s - sender.told_s >= AGAIN_S:
            sender.told_s = wall_s
            known = list(self.endpoints.values())
            self._give(known, lambda endpoint: endpoint.meet(address, PortKind.SHARED, frame.version, wall_s))
        place, _ = target_places(frame.id)
        system = frame.message[place] if place >= 0 else 0
        readers = [self.endpoints[system]] if system in self.endpoints else []
        if not system or (self._forward and not readers):
            readers = list(self.endpoints.values())
            sender.allowance.charge(len(readers) - 1)  # it costs that many times as much
        first = readers[0] if readers else None
        self._give(readers, lambda e: e.take(frame, address, PortKind.SHARED, wall_s, forwards=e is first))

    def _give(self, readers: Iterable[Endpoint], gift: Callable[[Endpoint], object]) -> None:
        """To each; one that fails at it takes nothing away from the others."""
        for endpoint in readers:
            try:
                gift(endpoint)
            except Exception:
                self.faults += 1
                log.exception("system %d", endpoint.system_id)
