"""Calm: how long the onboard logic has nothing to decide, and what it waits for.

Most ticks change nothing: the trajectory in force is good for seconds. Where the logic can tell beforehand which tick
will be the next to change something, many control steps may be run at once (see Vehicle.advance). A calm must never be
too long; one that is too short costs a tick that changes nothing.
"""

import math
from enum import IntEnum
from typing import NamedTuple

from sitl.quaternion import Vec3

_NOWHERE: Vec3 = (0.0, 0.0, 0.0)


class Ground(IntEnum):
    """What about the reference would make a vehicle on its feet, or just above them, change its effort."""

    NOTHING = 0
    RISING = 1  # it stands with idling motors: a reference that leaves the ground
    RESTING = 2  # it flies: a reference on the ground


class Calm(NamedTuple):
    """No tick before `until_us` (simulation time) changes anything, as long as

    - the feet stay as they are, all up or some down, and the vehicle isn't found lying on the ground,
    - the reference doesn't come to what `ground` names,
    - the vehicle stays further than near_m from near_N (−1: wherever it is).
    """

    until_us: int
    ground: Ground
    near_N: Vec3 = _NOWHERE
    near_m: float = -1.0


class Wait(NamedTuple):
    """What a mode waits for: a time [s] (inf: none), a place."""

    until_s: float
    near_N: Vec3 = _NOWHERE
    near_m: float = -1.0


FOREVER = Wait(math.inf)


def before_us(t_s: float) -> int:
    """A simulation time surely not later than t_s."""
    return 1 << 52 if t_s > 1e9 else math.floor(t_s * 1e6) - 1
