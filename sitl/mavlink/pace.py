"""How fast what comes in rows may go out: so much a second of wall time, and a little at once."""


class Pace:
    """A bucket that fills by `rate` units a second up to `most`; what goes out takes from `allowance`."""

    __slots__ = ("_filled_s", "_most", "_rate", "allowance")

    def __init__(self, rate: float, most: float) -> None:
        self.allowance = most
        self._rate, self._most = rate, most
        self._filled_s: float | None = None

    def refill(self, wall_s: float) -> float:
        """The allowance by now."""
        if self._filled_s is not None:
            self.allowance = min(self._most, self.allowance + (wall_s - self._filled_s) * self._rate)
        self._filled_s = wall_s
        return self.allowance
