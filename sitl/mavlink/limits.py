"""How much the vehicle takes from whom: so that a flood costs its sender, not the others and not the control loop.

Each peer may send so many frames a second and so many at once; all addresses that are no peers share one small
allowance, however many they are. What exceeds it is dropped before it is parsed.
"""

from typing import NamedTuple

BYTES = 256  # of a datagram that count as a frame at least, so that long rubbish costs what it takes to search


class Limits(NamedTuple):
    """Frames a second and at once [wall time]."""

    peer_Hz: float
    peer_burst: float
    strangers_Hz: float
    strangers_burst: float
    forwarded_Hz: float  # copies that go on to other peers
    forwarded_burst: float


UNLIMITED = Limits(*(float("inf"),) * 6)
DAEMON = Limits(4000.0, 1000.0, 200.0, 100.0, 8000.0, 2000.0)
"""A hundred times what ground stations send. Transfers send one frame a round trip; offboard targets at 50 Hz fit up to
80 × real time."""


def shared(limits: Limits, vehicles: int) -> Limits:
    """The same for a port that so many vehicles share: 100 frames a second more for each of them.

    A broadcast counts once for each vehicle that gets it.
    """
    return limits._replace(peer_Hz=limits.peer_Hz + 100.0 * vehicles, peer_burst=limits.peer_burst + 100.0 * vehicles)


class Allowance:
    """A token bucket on wall time."""

    __slots__ = ("_burst", "_left", "_rate_Hz", "_wall_s")

    def __init__(self, rate_Hz: float, burst: float) -> None:
        self._rate_Hz, self._burst = rate_Hz, burst
        self._left, self._wall_s = burst, float("-inf")

    def take(self, wall_s: float) -> bool:
        """One more, if there is any left."""
        passed_s = wall_s - self._wall_s
        if passed_s > 0.0:
            self._wall_s = wall_s
            self._left = min(self._burst, self._left + passed_s * self._rate_Hz)
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True

    def charge(self, more: float) -> None:
        """What was taken has turned out to be `more` than one."""
        self._left -= more


def cost(data: bytes, frames: int) -> int:
    """What a datagram counts, in frames."""
    return max(1, frames, len(data) // BYTES)
