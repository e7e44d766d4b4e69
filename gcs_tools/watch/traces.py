"""What a number was over the last minutes, a value a second."""

from collections import deque
from collections.abc import Callable

KEPT_S = 180


def newest(_old: float, new: float) -> float:
    return new


class Trace:
    """fold: what is kept of two values that come within one second."""

    def __init__(self, fold: Callable[[float, float], float] = newest) -> None:
        self.value: float | None = None  # the newest
        self.greatest = 0.0  # amount of all that ever came
        self._fold = fold
        self._seconds: deque[tuple[int, float]] = deque(maxlen=KEPT_S)

    def put(self, value: float, wall_s: float) -> None:
        self.value = value
        self.greatest = max(self.greatest, abs(value))
        second = int(wall_s // 1.0)
        if self._seconds and self._seconds[-1][0] == second:
            value = self._fold(self._seconds.pop()[1], value)
        self._seconds.append((second, value))

    def last(self, count: int, wall_s: float) -> list[float | None]:
        """One value for each of the last `count` seconds, the newest last; None where nothing came."""
        first = int(wall_s // 1.0) - count + 1
        found: list[float | None] = [None] * count
        for second, value in self._seconds:
            if 0 <= second - first < count:
                found[second - first] = value
        return found
