"""The battery's levels, and when it falls to the next."""

from enum import IntEnum

from sitl.onboard.parameters import Parameters


class Level(IntEnum):
    GOOD = 0
    LOW = 1
    CRITICAL = 2
    EMERGENCY = 3


_THRESHOLDS = {Level.EMERGENCY: "BAT_EMERGEN_THR", Level.CRITICAL: "BAT_CRIT_THR", Level.LOW: "BAT_LOW_THR"}


class BatteryWatch:
    """Notices each level once."""

    def __init__(self, parameters: Parameters) -> None:
        self._p = parameters
        self.level = Level.GOOD

    def restart(self) -> None:
        self.level = Level.GOOD

    def lasts(self, remaining: float) -> float:
        """How full the battery is when the level may change next, 0 … 1."""
        return max((self._p[name] for name in _THRESHOLDS.values() if self._p[name] <= remaining), default=0.0)

    def watch(self, remaining: float) -> Level | None:
        """The level, where it is worse than before."""
        level = next((level for level, name in _THRESHOLDS.items() if remaining < self._p[name]), Level.GOOD)
        was, self.level = self.level, level
        return level if level > was else None
