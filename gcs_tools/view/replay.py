"""A recorded flight (.mcap of `sitl run --record`) as a source: the same messages, at a moment of one's choice.

The recording holds every control step; fifty a second are kept here, as a vehicle sends them by default.
"""

from bisect import bisect_right
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from gcs_tools.mcap_reader import messages
from gcs_tools.view import topics
from gcs_tools.view.feed import Status
from gcs_tools.view.history import Recorded, row
from gcs_tools.view.vehicle import Instant, Vehicle
from sitl.strict_yaml import ConfigError

SLOT_NS = 20_000_000  # one instant in each


class Told(NamedTuple):
    """A message that is not sampled."""

    now_us: int
    topic: str
    payload: bytes


class Track:
    """One vehicle's recording."""

    def __init__(self, instance: int, instants: list[dict[str, bytes]], told: list[Told]) -> None:
        self.instants = [
            Instant(**{topic: topics.decode(topic, payload) for topic, payload in parts.items()}) for parts in instants
        ]
        self.instants.sort(key=lambda instant: instant.now_us)
        self.stamps_us = [instant.now_us for instant in self.instants]
        self.vehicle = Vehicle(instance)
        self.vehicle.alive = True
        self.vehicle.history = self.history = Recorded(np.array([row(instant) for instant in self.instants]))
        self._told = sorted(told, key=lambda message: message.now_us)
        self._shown = 0  # of what was told

    def show(self, now_us: int) -> None:
        """Bring the vehicle to this moment, from wherever it is."""
        index = max(1, bisect_right(self.stamps_us, now_us))
        self.vehicle.instant = self.instants[index - 1]
        self.history.show(index)
        if self._shown and self._told[self._shown - 1].now_us > now_us:
            self.vehicle.events.clear()
            self._shown = 0
        while self._shown < len(self._told) and (self._told[self._shown].now_us <= now_us or self.vehicle.mode is None):
            message = self._told[self._shown]
            self.vehicle.take(message.topic, message.payload)
            self._shown += 1


class Replay:
    """A recorded source. `time_s` counts from the recording's begin; it runs on with each poll while `playing`."""

    def __init__(self, name: str, tracks: list[Track]) -> None:
        self.name = name
        self.playing = False
        self.speed = 1.0
        self.time_s = 0.0
        self._tracks = tracks
        self._begin_us = min(track.stamps_us[0] for track in tracks)
        self.duration_s = (max(track.stamps_us[-1] for track in tracks) - self._begin_us) * 1e-6
        self._vehicles = {track.vehicle.instance: track.vehicle for track in tracks}
        self._wall_s: float | None = None

    @classmethod
    def load(cls, path: Path) -> "Replay":
        """Raises ConfigError for a file that is no recording of a flight."""
        instants: dict[int, dict[int, tuple[int, dict[str, bytes]]]] = {}
        told: dict[int, list[Told]] = {}
        damage: list[str] = []
        for _, instance, topic, log_ns, payload in messages(_read(path), damage):
            if instance is None or topic not in topics.TYPES:
                continue
            if topic in topics.SAMPLED:
                taken_ns, parts = instants.setdefault(instance, {}).setdefault(log_ns // SLOT_NS, (log_ns, {}))
                if log_ns == taken_ns:
                    parts[topic] = payload
            else:
                told.setdefault(instance, []).append(Told(_now_us(path, payload), topic, payload))
        tracks = []
        for instance, slots in sorted(instants.items()):
            whole = [parts for _, parts in slots.values() if len(parts) == len(topics.SAMPLED)]
            if whole:
                try:
                    tracks.append(Track(instance, whole, told.get(instance, [])))
                except msgspec.DecodeError as error:
                    raise ConfigError(f"{path}: a message that can't be read: {error}") from None
        if not tracks:
            if damage:
                raise ConfigError(f"{path}: no recording that can be read: {damage[0]}")
            raise ConfigError(f"{path}: holds no flight of a YawSitter (the .mcap of `sitl run --record` does)")
        replay = cls(path.name, tracks)
        replay.poll(0.0)
        return replay

    @property
    def vehicles(self) -> Mapping[int, Vehicle]:
        return self._vehicles

    @property
    def status(self) -> Status:
        return Status(True, f"Replay of {self.name}, {self.duration_s:.1f} s.")

    def poll(self, wall_s: float) -> None:
        if self.playing and self._wall_s is not None:
            self.time_s = min(self.duration_s, self.time_s + self.speed * (wall_s - self._wall_s))
            self.playing = self.time_s < self.duration_s
        self._wall_s = wall_s
        now_us = self._begin_us + round(self.time_s * 1e6)
        for track in self._tracks:
            track.show(now_us)

    def seek(self, time_s: float) -> None:
        """From there on; shown with the next poll."""
        self.time_s = min(max(0.0, time_s), self.duration_s)

    def toggle(self) -> None:
        """Play or pause; at the end, from the begin."""
        if not self.playing and self.time_s >= self.duration_s:
            self.time_s = 0.0
        self.playing = not self.playing

    def close(self) -> None:
        """Nothing is open."""


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None


class _Stamp(msgspec.Struct):
    now_us: int = 0


_stamp = msgspec.json.Decoder(_Stamp)


def _now_us(path: Path, payload: bytes) -> int:
    """A message's own time; 0 where it has none, as the description."""
    try:
        return _stamp.decode(payload).now_us
    except msgspec.DecodeError as error:
        raise ConfigError(f"{path}: a message that can't be read: {error}") from None
