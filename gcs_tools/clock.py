"""What time it is on the vehicle, told from the stamps on what arrives.

The vehicle's clock is simulation time: it starts at zero, may run at any multiple of real time and may stand still.
"""

from collections.abc import Callable
from typing import NamedTuple

WINDOW_S = 0.5  # of the caller's clock: each window's least delayed stamp is an anchor of the estimate
AHEAD_S = 0.1  # how far past the newest stamp the estimate runs on when nothing more comes (a paused vehicle)
JUMP_S = 1.0  # a stamp this far behind the estimate is a pause, a restart or a slower pace, not a delay


class _Anchor(NamedTuple):
    stamp_s: float
    wall_s: float


class VehicleClock:
    """Estimates the vehicle's time as a line through (stamp, arrival) pairs, in seconds.

    A datagram is only ever late, never early. So the line runs through the least delayed pair in the second half of
    each window of the caller's time, its slope is that between the last two of these, and a stamp ahead of the line
    lifts it at once.
    """

    def __init__(self) -> None:
        self.rate = 1.0  # vehicle seconds per second of the caller
        self.newest_s: float | None = None  # the newest stamp heard
        self._anchor = _Anchor(0.0, 0.0)
        self._lift_s = 0.0  # by how much stamps of this window were ahead of the line
        self._best: _Anchor | None = None  # the next anchor
        self._best_lead = 0.0
        self._window_end_s = 0.0

    @property
    def known(self) -> bool:
        return self.newest_s is not None

    def _start(self, anchor: _Anchor, wall_s: float) -> None:
        self._anchor, self._lift_s, self._best = anchor, 0.0, None
        self._window_end_s = wall_s + WINDOW_S

    def _line(self, wall_s: float) -> float:
        return self._anchor.stamp_s + self.rate * (wall_s - self._anchor.wall_s)

    def hear(self, stamp_s: float, wall_s: float) -> None:
        """A message stamped stamp_s arrived at wall_s."""
        lead = stamp_s - self._line(wall_s)  # below zero: later than the line has it
        if self.newest_s is None or lead < -JUMP_S:
            self.newest_s, self.rate = stamp_s, 1.0
            self._start(_Anchor(stamp_s, wall_s), wall_s)
            return
        self.newest_s = max(self.newest_s, stamp_s)
        self._lift_s = max(self._lift_s, lead)
        in_second_half = wall_s >= self._window_end_s - 0.5 * WINDOW_S
        if in_second_half and (self._best is None or lead > self._best_lead):
            self._best, self._best_lead = _Anchor(stamp_s, wall_s), lead
        if self._best is not None and wall_s >= self._window_end_s:
            span = self._best.wall_s - self._anchor.wall_s
            if span > 0.4 * WINDOW_S:
                self.rate = max(0.0, (self._best.stamp_s - self._anchor.stamp_s) / span)
            self._start(self._best, wall_s)

    def at(self, wall_s: float) -> float:
        """The vehicle's time when the caller's clock reads wall_s; never far past the newest stamp."""
        if self.newest_s is None:
            raise LookupError("no stamp has been heard yet")
        return min(self._line(wall_s) + self._lift_s, self.newest_s + AHEAD_S)

    def when(self, vehicle_s: float) -> float:
        """The caller's time at which the vehicle's clock will read vehicle_s, at its present rate."""
        return self._anchor.wall_s + (vehicle_s - self._lift_s - self._anchor.stamp_s) / max(self.rate, 1e-3)


class Metronome:
    """Sends something every `period_s` of the vehicle's time; beats that were missed are not made up for."""

    def __init__(self, clock: VehicleClock, period_s: float) -> None:
        self._clock, self._period_s = clock, period_s
        self._next_s = 0.0

    def beat(self, wall_s: float, send: Callable[[float], None]) -> float:
        """Call `send` with the vehicle's time if it is due; when the next one will be, on the caller's clock."""
        now_s = self._clock.at(wall_s)
        if now_s >= self._next_s - 1e-6:
            send(now_s)
            self._next_s += self._period_s
            if self._next_s < now_s:
                self._next_s = now_s + self._period_s
        return self._clock.when(self._next_s)
