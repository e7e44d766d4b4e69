"""A bad link, for trying what a good one hides: losses, doubles and delays that also change the order.

The same datagrams at the same times with the same seed meet the same fate.
"""

import heapq
import math
import random
from typing import Generic, NamedTuple, TypeVar

T = TypeVar("T")

LOSS_MAX, JITTER_MAX_S = 0.95, 10.0
_NAMES = "loss=0..0.95, dup=0..1, jitter=0..10 (seconds) and seed=N, with commas between"


class Impairment(NamedTuple):
    """Shares of datagrams lost and doubled, the longest delay (they are uniform from zero), and the chance's seed."""

    loss: float = 0.0
    dup: float = 0.0
    jitter_s: float = 0.0
    seed: int = 1

    def reversed(self) -> "Impairment":
        """The same for the other direction, with a chance of its own."""
        return self._replace(seed=self.seed + 1)


def parse(text: str) -> Impairment:
    """'loss=0.2,dup=0.05,jitter=0.1,seed=1', each part optional. Raises ValueError that says what is allowed."""
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        name = name.strip()
        limit = {"loss": LOSS_MAX, "dup": 1.0, "jitter": JITTER_MAX_S, "seed": 2.0**32}.get(name, -1.0)
        if name in found or not 0.0 <= number <= limit or (name == "seed" and number != int(number)):
            raise ValueError(f"'{part}' in '{text}': an impairment is {_NAMES}")
        found[name] = number
    loss, dup, jitter_s = (found.get(name, 0.0) for name in ("loss", "dup", "jitter"))
    return Impairment(loss, dup, jitter_s, int(found.get("seed", 1)))


GOOD = Impairment()


class Wire(Generic[T]):
    """One direction of a link."""

    def __init__(self, impairment: Impairment = GOOD) -> None:
        self._random = random.Random(impairment.seed)
        self._bad = impairment
        self._on_the_way: list[tuple[float, int, T]] = []
        self._count = 0

    def put(self, now_s: float, data: T) -> None:
        bad, chance = self._bad, self._random.random
        for _ in range(2 if chance() < bad.dup else 1):
            if chance() >= bad.loss:
                self._count += 1
                heapq.heappush(self._on_the_way, (now_s + chance() * bad.jitter_s, self._count, data))

    def take(self, now_s: float) -> list[T]:
        """What has arrived by now."""
        arrived = []
        while self._on_the_way and self._on_the_way[0][0] <= now_s:
            arrived.append(heapq.heappop(self._on_the_way)[2])
        return arrived

    @property
    def next_s(self) -> float:
        """When the next one arrives."""
        return self._on_the_way[0][0] if self._on_the_way else math.inf
