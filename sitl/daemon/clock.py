"""Pacers: how far simulation time may go by now, and when to look again. Pure; wall time is handed in.

The loop has one step and asks its pacer two questions each turn. `Scaled` ties simulation time to wall time by a
factor (1: real time), `Unbounded` always grants one more slice, `Paused` grants only the steps asked for.
`Pacing` swaps one for another while the simulation runs, without a jump of simulation time.
"""

import math
from typing import Protocol

TURN_S = 0.004  # wall time between the loop's turns: 250 Hz serves 100 Hz streams and 50 Hz targets without haste
SWARM_TURN_S = 0.02  # of many vehicles, whose streams are slower: one slice a turn
PAUSED_TURN_S = 0.02  # nothing moves; datagrams wake the loop anyway
SLICE_US = 20_000  # simulation between two looks at the link: the commander's period
LAG_MAX_S = 0.25  # wall time that is caught up at most; what is beyond is given up, not raced after


class Pacer(Protocol):
    def due_us(self, now_us: int, wall_s: float) -> int:
        """The simulation time to reach in this turn."""

    def wake_s(self, wall_s: float) -> float:
        """The wall time of the next turn; not later than `wall_s`: at once."""


class Scaled:
    """Simulation time = anchor + speed × wall time since the anchor, in turns on an absolute grid of wall time."""

    def __init__(self, speed: float, now_us: int, wall_s: float, turn_s: float = TURN_S) -> None:
        self.speed = speed
        self._turn_s = turn_s
        self.slipped_s = 0.0  # wall time given up because the machine could not keep pace
        self._origin_s = wall_s  # of the grid of turns
        self._anchor_us = now_us
        self._anchor_s = wall_s

    def due_us(self, now_us: int, wall_s: float) -> int:
        due = self._anchor_us + round((wall_s - self._anchor_s) * 1e6 * self.speed)
        lag_s = (due - now_us) * 1e-6 / self.speed
        if lag_s > LAG_MAX_S:
            self.slipped_s += lag_s - LAG_MAX_S
            due = now_us + round(LAG_MAX_S * 1e6 * self.speed)
            self._anchor_us, self._anchor_s = due, wall_s
        return due

    def wake_s(self, wall_s: float) -> float:
        return self._origin_s + (math.floor((wall_s - self._origin_s) / self._turn_s + 1e-6) + 1) * self._turn_s


class Unbounded:
    """As fast as possible: one slice a turn, the next turn at once."""

    def due_us(self, now_us: int, wall_s: float) -> int:
        return now_us + SLICE_US

    def wake_s(self, wall_s: float) -> float:
        return wall_s


class Paused:
    """Stands still, but for the whole control steps that cover the milliseconds asked for."""

    def __init__(self, now_us: int, step_us: int) -> None:
        self._until_us = now_us
        self._step_us = step_us

    def step(self, now_us: int, milliseconds: int) -> None:
        self._until_us = now_us + math.ceil(milliseconds * 1000 / self._step_us) * self._step_us

    def due_us(self, now_us: int, wall_s: float) -> int:
        return max(now_us, min(self._until_us, now_us + SLICE_US))

    def wake_s(self, wall_s: float) -> float:
        return wall_s + PAUSED_TURN_S

    def stepping(self, now_us: int) -> bool:
        return now_us < self._until_us


class Pacing:
    """The pacer in force. `set` follows the parameters SIM_SPEED (0: as fast as possible), SIM_PAUSE, SIM_STEP_MS."""

    def __init__(self, step_us: int, now_us: int, wall_s: float, turn_s: float = TURN_S) -> None:
        self._step_us, self._turn_s = step_us, turn_s
        self._slipped_before_s = 0.0
        self._pacer: Scaled | Unbounded | Paused = Scaled(1.0, now_us, wall_s, turn_s)

    def set(self, speed: float, paused: bool, step_ms: int, now_us: int, wall_s: float) -> None:
        """Take new settings; the same ones again change nothing. `step_ms` counts only while paused."""
        pacer = self._pacer
        if paused:
            if not isinstance(pacer, Paused):
                self._use(Paused(now_us, self._step_us))
        elif speed <= 0.0:
            if not isinstance(pacer, Unbounded):
                self._use(Unbounded())
        elif not isinstance(pacer, Scaled) or pacer.speed != speed:
            self._use(Scaled(speed, now_us, wall_s, self._turn_s))
        if isinstance(self._pacer, Paused) and step_ms > 0 and not self._pacer.stepping(now_us):
            self._pacer.step(now_us, step_ms)

    def _use(self, pacer: Scaled | Unbounded | Paused) -> None:
        self._slipped_before_s = self.slipped_s
        self._pacer = pacer

    def due_us(self, now_us: int, wall_s: float) -> int:
        return self._pacer.due_us(now_us, wall_s)

    def wake_s(self, now_us: int, wall_s: float) -> float:
        return wall_s if self.stepping(now_us) else self._pacer.wake_s(wall_s)

    def stepping(self, now_us: int) -> bool:
        """Whether steps asked for while paused are still to be run."""
        return isinstance(self._pacer, Paused) and self._pacer.stepping(now_us)

    @property
    def has_deadlines(self) -> bool:
        """Whether a late turn is a fault: not when running as fast as possible, nor when paused."""
        return isinstance(self._pacer, Scaled)

    @property
    def slipped_s(self) -> float:
        """Wall time given up since the start, over all changes of speed."""
        return self._slipped_before_s + (self._pacer.slipped_s if isinstance(self._pacer, Scaled) else 0.0)


class Lateness:
    """How punctual the turns were: an overrun is a turn that began more than a whole turn late."""

    def __init__(self, turn_s: float = TURN_S) -> None:
        self.turn_s = turn_s
        self.turns = 0
        self.overruns = 0
        self.worst_s = 0.0

    def record(self, planned_s: float, wall_s: float) -> None:
        late = wall_s - planned_s
        self.turns += 1
        if late > self.worst_s:
            self.worst_s = late
        if late > self.turn_s:
            self.overruns += 1
