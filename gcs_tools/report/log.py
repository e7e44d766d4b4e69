"""What a log tells of a flight, whatever file it came from. Times are the vehicle's own, in seconds."""

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from gcs_tools.recording import Recording, series
from gcs_tools.report.link_quality import LinkQuality
from sitl.strict_yaml import ConfigError

# Series besides those of Recording, and how many columns they have behind the time. N is north, east, down.
COLUMNS = {
    "velocity": 3,  # m/s in N, as the vehicle believes
    "true_velocity": 3,
    "reference_velocity": 3,
    "angles": 3,  # the paper's φ, θ, ψ [deg], as the vehicle believes
    "angles_command": 3,
    "thrust": 2,  # commanded, left and right [N]
    "wind": 3,  # m/s in N: where the air moves
    "battery": 3,  # V, A, % left
    "turned": 1,  # angle [deg] between the believed attitude and the true one
    "sent": 3,  # position [m] in N of the targets that a client sent
}


class Status(NamedTuple):
    """From t_s on. None: not told."""

    t_s: float
    mode: str | None
    armed: bool | None
    landed: str | None


class Event(NamedTuple):
    """kind: a severity of texts, or what sort of thing happened."""

    t_s: float
    kind: str
    text: str


class Log:
    """What a reader has found. `reported` is what the vehicle believes, `true` the plant's truth, where it is told."""

    def __init__(self, path: Path, kind: str) -> None:
        self.path, self.kind = path, kind
        self.reported, self.true = Recording(), Recording()
        self.rows: defaultdict[str, list[Any]] = defaultdict(list)
        self.status: list[Status] = []
        self.events: list[Event] = []
        self.reached: list[tuple[float, int]] = []  # when which mission item was
        self.parameters: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)  # name → (t_s, value)
        self.defaults: Mapping[str, float] = {}
        self.facts: dict[str, str] = {}
        self.vehicle: str | None = None  # its name
        self.unix_s: tuple[float, float] | None = None  # wall time of the first and of the last entry
        self.link: LinkQuality | None = None
        self.damage: list[str] = []  # what could not be read, and where

    def series(self, name: str) -> Any:
        """(n, 1 + columns) with the time first, in its order; n may be 0."""
        return series(self.rows[name], 1 + COLUMNS[name], 0.0)

    def note_status(self, now: Status) -> None:
        if not self.status or self.status[-1][1:] != now[1:]:
            self.status.append(now)

    @property
    def span_s(self) -> tuple[float, float]:
        """From the first to the last that is told of the motion, or else of anything."""
        times = [row[0] for row in self.reported.positions] or [s.t_s for s in self.status] or [0.0]
        return min(times), max(times)

    def armed_spans(self) -> list[tuple[float, float]]:
        """When it was armed; a span that the log doesn't see end ends with the log."""
        spans, since = [], None
        for now in self.status:
            if now.armed and since is None:
                since = now.t_s
            elif since is not None and now.armed is False:
                spans.append((since, now.t_s))
                since = None
        if since is not None:
            spans.append((since, max(since, self.span_s[1])))
        return spans


def bundled_defaults(vehicle: str) -> dict[str, float]:
    """The parameters' defaults of a vehicle that comes with the simulator; none for others."""
    from sitl.vehicle import Vehicle
    from sitl.vehicle_spec import load_vehicle, vehicle_names

    if vehicle not in vehicle_names():
        return {}
    parameters = Vehicle(load_vehicle(vehicle)).parameters
    return {name: parameters.declaration(name).default for name in parameters.names}


def read(path: Path, system: int | None) -> Log:
    """The log in the file, told by its content; of several vehicles that with this id, or else the first one heard.

    Raises ConfigError for what is no log or has no vehicle in it.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: can't be read: {error.strerror}") from None
    if not data:
        raise ConfigError(f"{path}: is empty")
    if data.startswith(b"\x89MCAP0"):
        from gcs_tools.report import mcap_log

        return mcap_log.read(path, data, system)
    from gcs_tools.report import tlog

    return tlog.read(path, data, system)
