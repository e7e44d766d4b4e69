"""The campaign file (docs/campaigns.md): YAML → a Campaign; mistakes are named by file, line and field."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import msgspec

from gcs_tools import random_plan
from gcs_tools.plan import read_text
from gcs_tools.random_plan import Limits
from sitl.campaign.distributions import SAMPLINGS, Choice, Distribution, Fixed, Grid, Normal, Uniform, Value
from sitl.campaign.results import LIMITED
from sitl.strict_yaml import ConfigError, Document

MOST_FLIGHTS = 1_000_000
BLOCKS = ("parameters", "plant", "believed")  # of settings by name
# settings with one value each, and what they are where the file says nothing
NUMBERS = {
    "wind_north_m_s": 0.0,
    "wind_east_m_s": 0.0,
    "wind_down_m_s": 0.0,
    "wind_speed_m_s": 0.0,
    "wind_toward_deg": 0.0,
    "gust_m_s": 0.0,
    "heading_deg": 0.0,
}
WORDS = {"mission": "", "vehicle": "yawsitter", "gains": ""}
RANDOM_MISSION = "mission.random"  # stands for missions made up from each flight's own seed

Count = Annotated[int, msgspec.Meta(ge=1, le=MOST_FLIGHTS)]
Seed = Annotated[int, msgspec.Meta(ge=0, lt=2**32)]
Scalar = float | str
Pair = tuple[float, float]


class _Range(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    start: float = msgspec.field(name="from")
    end: float = msgspec.field(name="to")
    count: Annotated[int, msgspec.Meta(ge=2, le=10_000)]


class _Entry(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """What may stand in a setting's place: one kind, and what qualifies it."""

    fixed: Scalar | None = None
    uniform: Pair | None = None
    normal: Pair | None = None
    choice: Annotated[list[Scalar], msgspec.Meta(min_length=1)] | None = None
    grid: Any = None
    within: Pair | None = None
    relative: bool = False


class _File(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    name: Annotated[str, msgspec.Meta(min_length=1, max_length=80)]
    description: str = ""
    flights: Count = 1
    sampling: str = "random"
    draws_seed: Seed = 1
    traces: bool | Annotated[int, msgspec.Meta(ge=1)] = False
    trace_rate_hz: float = 50.0
    success: dict[str, float] = {}
    split: tuple[int, int, int] = (8, 1, 1)
    mission: Any = None
    vehicle: Any = None
    gains: Any = None
    seed: Any = None
    heading_deg: Any = None
    wind_north_m_s: Any = None
    wind_east_m_s: Any = None
    wind_down_m_s: Any = None
    wind_speed_m_s: Any = None
    wind_toward_deg: Any = None
    gust_m_s: Any = None
    parameters: dict[str, Any] = {}
    plant: dict[str, Any] = {}
    believed: dict[str, Any] = {}


class Setting(NamedTuple):
    """What one setting of the flights is drawn from. relative: a factor of what the vehicle itself has there."""

    name: str
    distribution: Distribution
    relative: bool = False

    @property
    def key(self) -> str:
        """Its name among the settings of its kind: RATE_Y_P of parameters.RATE_Y_P."""
        return self.name.partition(".")[2] or self.name


class Campaign(NamedTuple):
    """What a campaign file says.

    settings: all that are given or have a default, by name, those of blocks as block.name. flights: draws; each is
    flown at every point of the grid. trace_every: of flights that keep their trace, 0: none. success: figures of a
    flight and what they may be at most. random: limits of missions made up from a seed, if any.
    document: for saying where a mistake stands.
    """

    name: str
    description: str
    flights: int
    sampling: str
    draws_seed: int
    trace_every: int
    trace_rate_hz: float
    success: dict[str, float]
    split: tuple[int, int, int]
    settings: dict[str, Setting]
    random: Limits | None
    document: Document

    def of_kind(self, *kinds: type[Any]) -> list[Setting]:
        return [s for s in self.settings.values() if isinstance(s.distribution, kinds)]

    @property
    def total(self) -> int:
        return self.flights * math.prod(len(s.distribution.extremes()) for s in self.of_kind(Grid))


def load(path: str) -> Campaign:
    """The campaign in the file at `path`. Raises ConfigError; its names and ranges are `cases.check`'s to judge."""
    try:
        text = read_text(path)
    except ConfigError as error:
        raise ConfigError(str(error).partition(" (in ")[0].replace("mission file", "campaign file")) from None
    return loads(text, path)


def loads(text: str, name: str) -> Campaign:
    document = Document(text, name)
    file = document.convert(document.data, _File)
    document.choice("sampling", file.sampling, SAMPLINGS)
    if file.mission is None:
        document.fault("", "'mission' is missing: a mission file, {choice: […]}, {grid: […]} or {random: {}}")
    for figure, limit in file.success.items():
        if figure not in LIMITED:
            document.fault(f"success.{figure}", f"is not a figure; allowed: {', '.join(LIMITED)}")
        if not limit >= 0.0:
            document.fault(f"success.{figure}", f"{limit} is no limit; allowed from 0")
    if not (1.0 <= file.trace_rate_hz <= 500.0):
        document.fault("trace_rate_hz", f"{file.trace_rate_hz:g} is outside 1 … 500")
    if min(file.split) < 0 or not 1 <= sum(file.split) <= 1000:
        document.fault("split", "three whole numbers, train : validation : test, for example [8, 1, 1]")
    random, settings = _random(document, file.mission), {}
    for name_, default in (NUMBERS | WORDS).items():
        data = getattr(file, name_)
        if name_ == "mission" and random is not None:
            settings[name_] = Setting(name_, Fixed(RANDOM_MISSION))
        elif data is None:
            settings[name_] = Setting(name_, Fixed(default))
        else:
            settings[name_] = _setting(document, name_, data, words=name_ in WORDS)
    if file.seed is not None:
        settings["seed"] = _seed(document, file.seed)
    for block in BLOCKS:
        for key, data in getattr(file, block).items():
            settings[f"{block}.{key}"] = _setting(document, f"{block}.{key}", data, relative=True)
    campaign = Campaign(
        file.name, file.description, file.flights, file.sampling, file.draws_seed, int(file.traces), file.trace_rate_hz,
        file.success, file.split, settings, random, document,
    )  # fmt: skip
    if campaign.total > MOST_FLIGHTS:
        document.fault("flights", f"{campaign.total} flights with the grid; allowed up to {MOST_FLIGHTS}")
    return campaign


def _random(document: Document, mission: Any) -> Limits | None:
    """The limits of {random: {…}}."""
    if not isinstance(mission, dict) or "random" not in mission:
        return None
    if len(mission) > 1:
        document.fault("mission", "random stands alone")
    values = {}
    given = mission["random"]
    if not isinstance(given, dict):
        document.fault("mission.random", "a mapping of limits, {} for the usual ones")
    for name, value in given.items():
        document.choice(f"mission.random.{name}", name, tuple(random_plan.ALLOWED))
        values[name] = _number(document, f"mission.random.{name}", value)
    if (mistake := random_plan.fault(values)) is not None:
        document.fault(f"mission.random.{mistake[0]}", mistake[1])
    return Limits(**values)


def _seed(document: Document, data: Any) -> Setting:
    setting = _setting(document, "seed", data)
    for value in setting.distribution.extremes():
        if not isinstance(setting.distribution, Fixed | Grid | Choice) or value != int(value) or not 0 <= value < 2**32:
            document.fault("seed", "whole numbers from 0 to 4294967295: one, or a choice or grid of them")
    return setting


def _setting(document: Document, name: str, data: Any, *, words: bool = False, relative: bool = False) -> Setting:
    if not isinstance(data, dict):
        return Setting(name, Fixed(_value(document, name, data, words)))
    entry = document.convert(data, _Entry, name)
    kinds = [k for k in ("fixed", "uniform", "normal", "choice", "grid") if getattr(entry, k) is not None]
    if len(kinds) != 1:
        document.fault(name, "exactly one of fixed, uniform, normal, choice, grid")
    (kind,) = kinds
    if words and kind in ("uniform", "normal"):
        document.fault(f"{name}.{kind}", "is for numbers; allowed: fixed, choice, grid")
    if entry.relative and not relative:
        document.fault(f"{name}.relative", "is for parameters, plant and believed")
    if entry.within is not None and kind != "normal":
        document.fault(f"{name}.within", "is for normal")
    return Setting(name, _distribution(document, name, kind, entry, words), entry.relative)


def _distribution(document: Document, name: str, kind: str, entry: _Entry, words: bool) -> Distribution:
    field = f"{name}.{kind}"
    if kind == "uniform":
        low, high = (_number(document, field, v) for v in entry.uniform or ())
        if not low < high:
            document.fault(field, f"[low, high] with low below high, not [{low:g}, {high:g}]")
        return Uniform(low, high)
    if kind == "normal":
        mean, std = (_number(document, field, v) for v in entry.normal or ())
        low, high = entry.within or (-math.inf, math.inf)
        if not std > 0.0:
            document.fault(field, f"[mean, standard deviation] with a deviation above 0, not {std:g}")
        if not low < high or mean + 6.0 * std < low or mean - 6.0 * std > high:
            document.fault(f"{name}.within", f"[{low:g}, {high:g}] leaves nothing of [{mean:g}, {std:g}]")
        return Normal(mean, std, low, high)
    if kind == "fixed":
        return Fixed(_value(document, field, entry.fixed, words))
    if kind == "choice":
        return Choice(tuple(_value(document, f"{field}[{k}]", v, words) for k, v in enumerate(entry.choice or ())))
    return Grid(_grid(document, field, entry.grid, words))


def _grid(document: Document, field: str, data: Any, words: bool) -> tuple[Value, ...]:
    if isinstance(data, Mapping) and not words:
        try:
            r = msgspec.convert(data, _Range)
        except msgspec.ValidationError as error:
            document.fault(field, f"{error}; {{from: LOW, to: HIGH, count: N}} or a list")
        step = (r.end - r.start) / (r.count - 1)
        return tuple(round(r.start + k * step, 12) for k in range(r.count))
    if not isinstance(data, list) or not data:
        document.fault(field, "a list of values" + ("" if words else " or {from: LOW, to: HIGH, count: N}"))
    values = tuple(_value(document, f"{field}[{k}]", v, words) for k, v in enumerate(data))
    if len(set(values)) < len(values):
        document.fault(field, "a value is given twice")
    return values


def _value(document: Document, field: str, value: Any, words: bool) -> Value:
    if not words:
        return _number(document, field, value)
    if not isinstance(value, str) or not value:
        document.fault(field, f"{value!r} is not a name")
    return value


def _number(document: Document, field: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        document.fault(field, f"{value!r} is not a finite number")
    return float(value)
