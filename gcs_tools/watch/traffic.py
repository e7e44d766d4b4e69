"""What the link carries from one vehicle: frames and bytes by message, and how much of it is lost on the way."""

from collections import deque
from typing import NamedTuple

from gcs_tools.report.link_quality import source
from sitl.mavlink.codec import Frame

WINDOW_S = 5.0  # rates are told over
LOSS_WINDOW_S = 15.0


class Flow(NamedTuple):
    """One message, or all of them."""

    name: str
    frames_Hz: float
    bytes_Hz: float


class Traffic:
    """Hears every frame of one vehicle."""

    def __init__(self) -> None:
        self.names: set[str] = set()  # of all messages that ever came
        self._since_s: float | None = None
        self._recent: deque[tuple[float, Frame]] = deque()

    def hear(self, frame: Frame, wall_s: float) -> None:
        if self._since_s is None:
            self._since_s = wall_s
        self.names.add(frame.name)
        self._recent.append((wall_s, frame))
        while self._recent[0][0] < wall_s - LOSS_WINDOW_S:
            self._recent.popleft()

    def restart(self) -> None:
        """The vehicle counts from the beginning."""
        self._recent.clear()

    def flows(self, wall_s: float) -> list[Flow]:
        """By message, most bytes first; wall time counts."""
        span_s = self._span_s(wall_s)
        count: dict[str, list[int]] = {}
        for at_s, frame in reversed(self._recent):
            if at_s < wall_s - span_s:
                break
            entry = count.setdefault(frame.name, [0, 0])
            entry[0] += 1
            entry[1] += len(frame.raw)
        found = [Flow(name, n / span_s, size / span_s) for name, (n, size) in count.items()]
        return sorted(found, key=lambda flow: (-flow.bytes_Hz, flow.name))

    def _span_s(self, wall_s: float) -> float:
        heard_s = wall_s - self._since_s if self._since_s is not None else WINDOW_S
        return min(WINDOW_S, max(1.0, heard_s))

    def loss(self, wall_s: float) -> float | None:
        """Share of the vehicle's frames of late that never came, by their numbers; None where that can't be told."""
        frames = [frame for at_s, frame in self._recent if at_s >= wall_s - LOSS_WINDOW_S]
        if len(frames) < 2:
            return None
        return source(frames[0].system, frames[0].component, frames).loss


def total(flows: list[Flow]) -> Flow:
    return Flow("all", sum(flow.frames_Hz for flow in flows), sum(flow.bytes_Hz for flow in flows))
