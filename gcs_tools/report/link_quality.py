"""What became of the frames on the way, told from their sequence numbers: each sender counts from 0 to 255 and over."""

from collections import Counter, OrderedDict, defaultdict
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from gcs_tools.report.tlog_frames import Stamped
from sitl.mavlink.codec import Frame

_RECENT = 128  # frames that one may repeat: half a round, as after a whole one the same bytes may be said anew
_AWAY = 128  # frames without the one that should follow, after which it is lost: half a round
_RETURNS = 4  # to where a counter was left, for each time that it was lost, that make it one among others


class Source(NamedTuple):
    """One sender. lost, doubled, late in frames; lost None: not to be told, as it counts for several links at once."""

    system: int
    component: int
    frames: int
    lost: int | None
    doubled: int
    late: int

    @property
    def loss(self) -> float | None:
        """Share of what was sent."""
        return None if self.lost is None else self.lost / max(1, self.frames - self.doubled + self.lost)


class Rate(NamedTuple):
    """One message of the vehicle. mean_Hz and longest_s, its longest silence, in the vehicle's time."""

    name: str
    frames: int
    mean_Hz: float
    longest_s: float


class LinkQuality(NamedTuple):
    sources: list[Source]  # the vehicle first
    rates: list[Rate]
    per_second: list[tuple[float, int]]  # of the vehicle's frames, by second of wall time from the log's start
    silent_s: float  # the vehicle's longest silence, wall time


def quality(stamped: Sequence[Stamped], vehicle: tuple[int, int], stamps: Mapping[str, Sequence[float]]) -> LinkQuality:
    """Of all frames of a log; vehicle: (system, component). stamps: the vehicle's time of each of its messages."""
    by_sender: dict[tuple[int, int], list[Frame]] = defaultdict(list)
    for s in stamped:
        by_sender[s.frame.system, s.frame.component].append(s.frame)
    sources = [source(*who, sent) for who, sent in by_sender.items()]
    sources.sort(key=lambda s: ((s.system, s.component) != vehicle, s.system, s.component))
    rates = []
    for name, times in stamps.items():
        ordered = sorted(times)
        span_s = ordered[-1] - ordered[0]
        longest_s = max((b - a for a, b in pairwise(ordered)), default=0.0)
        rates.append(Rate(name, len(times), (len(times) - 1) / span_s if span_s > 0.0 else 0.0, longest_s))
    begin_s = stamped[0].unix_s
    heard = [s.unix_s - begin_s for s in stamped if (s.frame.system, s.frame.component) == vehicle]
    by_second = Counter(int(t) for t in heard)
    per_second = [(float(k), by_second[k]) for k in range(int(max(heard)))]  # whole seconds
    silent_s = max((b - a for a, b in pairwise(heard)), default=0.0)
    return LinkQuality(sources, sorted(rates, key=lambda r: -r.frames), per_second, silent_s)


def source(system: int, component: int, frames: Sequence[Frame]) -> Source:
    """How a sender's frames arrived, from their numbers in the order of their arrival."""
    recent: OrderedDict[bytes, None] = OrderedDict()
    numbers = []
    for frame in frames:
        if frame.raw in recent:
            continue
        recent[frame.raw] = None
        if len(recent) > _RECENT:
            recent.popitem(last=False)
        numbers.append(frame.sequence)
    doubled = len(frames) - len(numbers)
    if is_shared(numbers):
        return Source(system, component, len(frames), None, doubled, 0)
    lost, late = gaps(numbers)
    return Source(system, component, len(frames), lost, doubled, late)


def gaps(numbers: Sequence[int]) -> tuple[int, int]:
    """(lost, late) of one counter. What is up to half a round behind the newest has come late."""
    if not numbers:
        return 0, 0
    newest, missing = numbers[0], set[int]()
    lost = late = 0
    for number in numbers[1:]:
        step = (number - newest) & 0xFF
        if 0 < step < 128:
            missing.update((newest + k) & 0xFF for k in range(1, step))
            missing.discard(number)
            lost += step - 1
            newest = number
        elif number in missing:
            missing.discard(number)
            lost, late = lost - 1, late + 1
    return lost, late


def is_shared(numbers: Sequence[int]) -> bool:
    """Whether numbers of other counters stand among those of one, which goes on each time exactly where it was left.

    A record made at the vehicle is so: it has one link's frames whole, and of other links what was said to them alone.
    """
    following: int | None = None
    away = returns = left = 0
    for number in numbers:
        if following is None or number == following:
            returns += away > 0
            following, away = (number + 1) & 0xFF, 0
            continue
        away += 1
        if away > _AWAY:
            left, away, following = left + 1, 0, (number + 1) & 0xFF
    return returns >= _RETURNS * (left + 1)
