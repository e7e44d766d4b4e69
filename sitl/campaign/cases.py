"""Which flights a campaign consists of: each a pure function of the campaign and its index."""

import difflib
import hashlib
import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from gcs_tools import plan as plans
from gcs_tools import random_plan
from gcs_tools.plan import Plan
from gcs_tools.random_plan import Limits
from sitl.campaign.distributions import Choice, Grid, Normal, Uniform, Value, unit_cube
from sitl.campaign.file import BLOCKS, RANDOM_MISSION, Campaign, Setting
from sitl.daemon.config import GUST_MAX_M_S, WIND_MAX_M_S
from sitl.model import airframe
from sitl.model.airframe import Airframe
from sitl.onboard.declarations import declarations
from sitl.onboard.events import EventLog
from sitl.onboard.parameters import ParameterRefusal, Parameters
from sitl.onboard.store import MemoryStore
from sitl.quaternion import Vec3
from sitl.strict_yaml import ConfigError
from sitl.vehicle import load_vehicle
from sitl.vehicle_spec import VehicleSpec, gains_named

Numbers = tuple[tuple[str, float], ...]
_OWN_COLUMN = ("seed", "mission", "vehicle")  # in the table of results whether they differ or not
FIRST_SEED = 1  # of draw 0, where the file says nothing of seeds


class Case(NamedTuple):
    """One flight. mission, vehicle, gains: as its command line names them. varied: what differs between flights."""

    number: int
    draw: int
    mission: str
    vehicle: str
    gains: str
    seed: int
    heading_deg: float
    wind_N: Vec3
    gust_m_s: float
    parameters: Numbers
    plant: Numbers
    believed: Numbers
    varied: tuple[tuple[str, Value], ...]

    @property
    def command(self) -> str:
        """The command line of this very flight, from the campaign's folder."""
        words = ["sitl fly", self.mission, "--vehicle", self.vehicle, "--seed", str(self.seed)]
        if self.gains:
            words += ["--gains", self.gains]
        if self.heading_deg:
            words.append(f"--heading={self.heading_deg!r}")
        if any(self.wind_N):
            words.append("--wind=" + ",".join(repr(v) for v in self.wind_N))
        if self.gust_m_s:
            words.append(f"--gust={self.gust_m_s!r}")
        for option, values in (("--set", self.parameters), ("--plant", self.plant), ("--believed", self.believed)):
            words += [f"{option} {name}={value!r}" for name, value in values]
        return " ".join(words)


class Equipment(NamedTuple):
    """All that flights need besides their case, by the names that cases have for it; plain data, for any process.

    texts: of the mission files.
    """

    missions: dict[str, Plan]
    texts: dict[str, str]
    vehicles: dict[str, VehicleSpec]
    gains: dict[str, dict[str, float]]
    random: Limits | None

    def mission(self, case: Case) -> Plan:
        return self.missions.get(case.mission) or plans.load(case.mission)


def equip(campaign: Campaign, folder: Path) -> Equipment:
    """Load the missions, vehicles and gains that a campaign names, files relative to `folder`. Raises ConfigError."""
    missions, texts = {}, {}
    for name, path in _paths(campaign, "mission", folder).items():
        missions[name] = plans.load(path)
        if not path.startswith(plans.RANDOM):
            texts[name] = plans.read_text(path)
    vehicles = {name: load_vehicle(path) for name, path in _paths(campaign, "vehicle", folder).items()}
    gains = {name: gains_named(path) for name, path in _paths(campaign, "gains", folder).items() if name}
    return Equipment(missions, texts, vehicles, gains, campaign.random)


def _paths(campaign: Campaign, kind: str, folder: Path) -> dict[str, str]:
    """What a setting of words names: by the name on the command line, the path."""
    found: dict[str, str] = {}
    for value in map(str, campaign.settings[kind].distribution.extremes()):
        if value != RANDOM_MISSION:
            name = _name(kind, value, folder)
            path = _resolved(kind, value, folder)
            if found.setdefault(name, path) != path:
                campaign.document.fault(kind, f"two files of the name {Path(value).name}; give one another name")
    return found


def _resolved(kind: str, value: str, folder: Path) -> str:
    is_file = kind == "mission" or "/" in value or value.endswith((".yaml", ".yml"))
    return str(folder / value) if is_file and value and not value.startswith(plans.RANDOM) else value


def _name(kind: str, value: str, folder: Path) -> str:
    """On the command line. Missions are copied into the campaign's folder, other files stay where they are."""
    if kind == "mission":
        return value if value.startswith(plans.RANDOM) else f"missions/{Path(value).name}"
    resolved = _resolved(kind, value, folder)
    return str(Path(resolved).resolve()) if resolved != value or "/" in value else value


def cases(campaign: Campaign, equipment: Equipment, folder: Path) -> list[Case]:
    """Every flight: for each draw in turn, all points of the grid. Raises ConfigError for values that can't be."""
    drawn = campaign.of_kind(Uniform, Normal, Choice)
    grid = campaign.of_kind(Grid)
    cube = unit_cube([s.name for s in drawn], campaign.flights, campaign.sampling, campaign.draws_seed)
    points = list(itertools.product(*(s.distribution.extremes() for s in grid)))
    base = {s.name: s.distribution.extremes()[0] for s in campaign.settings.values()}
    found: list[Case] = []
    maker, checks = _Maker(campaign, equipment, folder), _Checks(campaign, equipment)
    for draw, us in enumerate(cube.tolist()):
        own = base | {s.name: s.distribution.at(u) for s, u in zip(drawn, us, strict=True)}  # type: ignore[union-attr]
        for point in points:
            values = own | {s.name: v for s, v in zip(grid, point, strict=True)}
            found.append(maker.case(len(found), draw, values))
            checks.check(found[-1])
    return found


class _Maker:
    """Settings' values → a Case."""

    def __init__(self, campaign: Campaign, equipment: Equipment, folder: Path) -> None:
        self._campaign, self._equipment, self._folder = campaign, equipment, folder
        self._varied = [s.name for s in campaign.of_kind(Uniform, Normal, Choice, Grid) if s.name not in _OWN_COLUMN]
        self._own: dict[tuple[str, str, str], float] = {}

    def case(self, number: int, draw: int, values: Mapping[str, Any]) -> Case:
        v, random = values, self._campaign.random
        mission = random_plan.words(FIRST_SEED + draw, random) if random else str(v["mission"])
        speed_m_s, toward = v["wind_speed_m_s"], math.radians(v["wind_toward_deg"])
        vehicle, gains = (_name(k, v[k], self._folder) if v[k] else "" for k in ("vehicle", "gains"))
        blocks: dict[str, list[tuple[str, float]]] = {block: [] for block in BLOCKS}
        for setting in self._campaign.settings.values():
            block = setting.name.partition(".")[0]
            if block != setting.name:
                factor = self._own_number(setting, vehicle, gains) if setting.relative else 1.0
                blocks[block].append((setting.key, v[setting.name] * factor))
        return Case(
            number=number,
            draw=draw,
            mission=_name("mission", mission, self._folder),
            vehicle=vehicle,
            gains=gains,
            seed=int(v.get("seed", FIRST_SEED + draw)),
            heading_deg=v["heading_deg"],
            wind_N=(
                v["wind_north_m_s"] + speed_m_s * math.cos(toward),
                v["wind_east_m_s"] + speed_m_s * math.sin(toward),
                v["wind_down_m_s"],
            ),
            gust_m_s=v["gust_m_s"],
            parameters=tuple(blocks["parameters"]),
            plant=tuple(blocks["plant"]),
            believed=tuple(blocks["believed"]),
            varied=tuple((name, v[name]) for name in self._varied),
        )

    def _own_number(self, setting: Setting, vehicle: str, gains: str) -> float:
        """What the vehicle has by itself; NaN for what it hasn't, which is told of later."""
        at = (setting.name, vehicle, gains)
        if at not in self._own:
            spec, known = self._equipment.vehicles[vehicle], {}
            if setting.name.startswith("parameters."):
                known = {d.name: d.default for d in declarations(spec.gains, spec.parameters)}
                known |= self._equipment.gains.get(gains, {})
            else:
                known = spec.airframe.airframe._asdict()
            self._own[at] = known.get(setting.key, math.nan)
        return self._own[at]


class _Checks:
    """Whether cases can be flown at all; refusals name the campaign's file and field."""

    def __init__(self, campaign: Campaign, equipment: Equipment) -> None:
        self._fault = campaign.document.fault
        self._vehicles = equipment.vehicles
        self._parameters = {
            name: Parameters(declarations(spec.gains, spec.parameters), MemoryStore(), name, EventLog())
            for name, spec in equipment.vehicles.items()
        }
        for name in campaign.settings:
            block, _, key = name.partition(".")
            if block == "parameters":
                self._known(name, key, next(iter(self._parameters.values())).names)
            elif key:
                self._known(name, key, Airframe._fields)

    def _known(self, field: str, name: str, names: tuple[str, ...]) -> None:
        if name not in names:
            near = difflib.get_close_matches(name.upper() if names[0].isupper() else name, names, 6, 0.5)
            allowed = f"near it: {', '.join(near)}" if near else f"allowed: {', '.join(names)}"
            self._fault(field, f"unknown; {allowed}")

    def check(self, case: Case) -> None:
        where = f"flight {case.number} would have"
        for name, value in case.parameters:
            known = self._parameters[case.vehicle]
            refusal = known.check(name, value)
            if refusal is not None:
                d = known.declaration(name)
                allowed = f"{d.minimum:g} … {d.maximum:g} {d.unit}".rstrip()
                why = "read-only" if refusal is ParameterRefusal.READ_ONLY else f"allowed {allowed}"
                self._fault(f"parameters.{name}", f"{where} {value:g} ({refusal.value}); {why}")
        a = self._vehicles[case.vehicle].airframe.airframe
        for block, values in (("plant", case.plant), ("believed", case.believed)):
            try:
                airframe.changed(a, dict(values))
            except ConfigError as error:
                name = next((n for n, _ in values if f" {n}:" in str(error)), "")
                self._fault(f"{block}.{name}".rstrip("."), f"{where} {str(error).removeprefix('airframe: ')}")
        winds = zip((f"wind_{axis}_m_s" for axis in ("north", "east", "down")), case.wind_N, strict=True)
        for name, value, most in (*((n, v, WIND_MAX_M_S) for n, v in winds), ("heading_deg", case.heading_deg, 360.0)):
            if not abs(value) <= most:
                self._fault(name, f"{where} {value:g}; allowed {-most:g} … {most:g}")
        if not 0.0 <= case.gust_m_s <= GUST_MAX_M_S:
            self._fault("gust_m_s", f"{where} {case.gust_m_s:g}; allowed 0 … {GUST_MAX_M_S:g}")


def digest(campaign: Campaign, found: list[Case], equipment: Equipment) -> str:
    """Of everything that decides what is flown and kept; campaigns with the same one have the same results."""
    kept = campaign.trace_every, campaign.trace_rate_hz, sorted(campaign.success.items()), campaign.split
    whole = repr((kept, found, sorted(equipment.texts.items()), equipment.vehicles, equipment.gains))
    return hashlib.sha256(whole.encode()).hexdigest()[:16]
