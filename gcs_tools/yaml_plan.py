"""The project's own mission files (docs/missions.md): YAML → a Plan; mistakes are named by file, line and field."""

import json
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Annotated, Any

import msgspec

from gcs_tools import fence_check, yaml_fence
from gcs_tools.plan import FRAME_LOCAL_NED, FRAME_MISSION, LOCAL_SCALE, Item, Plan, Streamed, Uploaded
from gcs_tools.reference import PEAK_ACCELERATION, PEAK_SPEED, Circle, TimedPoint, Waypoints
from gcs_tools.yaml_types import NAN, Down, Duration, Heading, Height, Instant, Length, Name, Struct, wire_xy
from sitl.strict_yaml import ConfigError, Document

MAX_SPEED_M_S = 10.0  # far above what the vehicle tracks in hover; beyond it a file is surely mistyped
MAX_ACCELERATION_M_S2 = 8.0


class _Head(Struct, kw_only=True):
    name: Name
    kind: str
    description: str = ""
    paper: str | None = None
    fence: yaml_fence.Entries | None = None
    rally: yaml_fence.Entries | None = None


class _Timed(_Head, kw_only=True):
    key_times_s: tuple[Instant, ...] = ()
    heading_deg: Heading | None = 0.0


class _Point(Struct, kw_only=True):
    t_s: Instant
    at_m: tuple[Length, Length, Down]


class _Waypoints(_Timed, kw_only=True):
    duration_s: Duration
    waypoints: Annotated[list[_Point], msgspec.Meta(min_length=2, max_length=10_000)]


class _Circle(_Timed, kw_only=True):
    radius_m: Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]
    altitude_m: Height
    climb_s: Duration
    lap_s: Duration
    laps: Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)] = 1.0
    ramp_s: Instant = 0.0
    centre_bearing_deg: Heading = 180.0
    direction: str = "clockwise"


class _Mission(_Head, kw_only=True):
    limit_s: Duration = 600.0
    items: Annotated[list[dict[str, Any]], msgspec.Meta(min_length=1, max_length=10_000)]


# Items of a mission. `do` picks the structure; the functions below it write the wire's fields (MAV_CMD numbers).
class _Takeoff(Struct, kw_only=True):
    do: str
    at_m: tuple[Length, Length, Down]
    heading_deg: Heading | None = None


class _Waypoint(Struct, kw_only=True):
    do: str
    at_m: tuple[Length, Length, Down]
    hold_s: Instant = 0.0
    acceptance_m: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 0.0
    heading_deg: Heading | None = None


class _Land(Struct, kw_only=True):
    do: str
    at_m: tuple[Length, Length]
    heading_deg: Heading | None = None


class _Return(Struct, kw_only=True):
    do: str


class _Speed(Struct, kw_only=True):
    do: str
    speed_m_s: Annotated[float, msgspec.Meta(gt=0.0, le=MAX_SPEED_M_S)]


class _Delay(Struct, kw_only=True):
    do: str
    seconds_s: Duration


def _placed(command: int, at_m: tuple[float, ...], heading_deg: float | None, p1: float = 0.0, p2: float = 0.0) -> Item:
    north, east, *down = at_m
    yaw = NAN if heading_deg is None else heading_deg
    x, y = wire_xy(north, east)
    return Item(FRAME_LOCAL_NED, command, p1, p2, 0.0, yaw, x, y, down[0] if down else 0.0)


def _bare(command: int, p1: float = 0.0, p2: float = 0.0, p3: float = 0.0) -> Item:
    return Item(FRAME_MISSION, command, p1, p2, p3, 0.0, 0, 0, 0.0)


ITEMS: dict[str, tuple[Any, Callable[[Any], Item]]] = {
    "takeoff": (_Takeoff, lambda i: _placed(22, i.at_m, i.heading_deg)),
    "waypoint": (_Waypoint, lambda i: _placed(16, i.at_m, i.heading_deg, i.hold_s, i.acceptance_m)),
    "land": (_Land, lambda i: _placed(21, i.at_m, i.heading_deg)),
    "return": (_Return, lambda i: _bare(20)),
    "speed": (_Speed, lambda i: _bare(178, 1.0, i.speed_m_s, -1.0)),
    "delay": (_Delay, lambda i: _bare(93, i.seconds_s, -1.0, -1.0)),
}
DIRECTIONS = {"clockwise": 1, "anticlockwise": -1}
PAPER_TABLES = ("rectangle", "circle")


def loads(text: str, name: str) -> Plan:
    """The Plan in the text of a YAML mission file; `name` stands for the file in messages."""
    file = Document(text, name)
    data = file.data
    if "kind" not in data:
        file.fault("", f"'kind' is missing; allowed: {', '.join(KINDS)}")
    file.choice("kind", data["kind"], KINDS)
    if data.get("paper") is not None:
        file.choice("paper", data["paper"], PAPER_TABLES)
    build, struct = KINDS[data["kind"]]
    plan: Plan = build(file, file.convert(data, struct))
    return plan


def _waypoints(file: Document, m: _Waypoints) -> Plan:
    points = [TimedPoint(p.t_s, p.at_m) for p in m.waypoints]
    if points[0].t_s != 0.0 or points[0].at_m[2] != 0.0:
        file.fault("waypoints[0]", "a flight starts on the ground: the first waypoint has t_s 0 and a down of 0")
    for i, (a, b) in enumerate(pairwise(points), start=1):
        span = b.t_s - a.t_s
        if span <= 0.0:
            file.fault(f"waypoints[{i}].t_s", f"{b.t_s:g} s doesn't come after the waypoint before it ({a.t_s:g} s)")
        way = math.dist(a.at_m, b.at_m)
        speed, acceleration = PEAK_SPEED * way / span, PEAK_ACCELERATION * way / span**2
        if speed > MAX_SPEED_M_S or acceleration > MAX_ACCELERATION_M_S2:
            file.fault(
                f"waypoints[{i}]",
                f"{way:g} m in {span:g} s takes {speed:.1f} m/s and {acceleration:.1f} m/s²;"
                f" allowed up to {MAX_SPEED_M_S:g} m/s and {MAX_ACCELERATION_M_S2:g} m/s²",
            )
    if m.duration_s < points[-1].t_s:
        file.fault("duration_s", f"{m.duration_s:g} s ends before the last waypoint ({points[-1].t_s:g} s)")
    return _streamed(file, m, Waypoints(points), m.duration_s)


def _circle(file: Document, m: _Circle) -> Plan:
    file.choice("direction", m.direction, DIRECTIONS)
    if 2.0 * m.ramp_s > m.lap_s * m.laps:
        file.fault("ramp_s", f"{m.ramp_s:g} s up and down doesn't fit; allowed up to {m.lap_s * m.laps / 2:g} s")
    circle = Circle(
        radius_m=m.radius_m,
        altitude_m=m.altitude_m,
        climb_s=m.climb_s,
        lap_s=m.lap_s,
        laps=m.laps,
        ramp_s=m.ramp_s,
        bearing_rad=math.radians(m.centre_bearing_deg),
        direction=DIRECTIONS[m.direction],
    )
    speed = circle.peak_speed_m_s
    if speed > MAX_SPEED_M_S or speed**2 / m.radius_m > MAX_ACCELERATION_M_S2:
        file.fault(
            "lap_s",
            f"this circle takes {speed:.1f} m/s and {speed**2 / m.radius_m:.1f} m/s²;"
            f" allowed up to {MAX_SPEED_M_S:g} m/s and {MAX_ACCELERATION_M_S2:g} m/s²",
        )
    if PEAK_SPEED * m.altitude_m / m.climb_s > MAX_SPEED_M_S:
        file.fault("climb_s", f"{m.altitude_m:g} m in {m.climb_s:g} s; allowed up to {MAX_SPEED_M_S:g} m/s")
    return _streamed(file, m, circle, circle.end_s)


def _streamed(file: Document, m: _Timed, reference: Waypoints | Circle, duration_s: float) -> Streamed:
    for i, t in enumerate(m.key_times_s):
        if t > duration_s:
            file.fault(f"key_times_s[{i}]", f"{t:g} s is after the end; allowed 0 to {duration_s:g} s")
    heading = None if m.heading_deg is None else math.radians(m.heading_deg)
    fence, rally = yaml_fence.read_fence(file, m.fence), yaml_fence.read_rally(file, m.rally)
    plan = Streamed(m.name, file.name, reference, duration_s, m.key_times_s, heading, m.paper, fence, rally)
    objection = fence_check.along_reference(plan)
    if objection:
        file.fault("fence", objection)
    return plan


def _mission(file: Document, m: _Mission) -> Plan:
    items = []
    for i, raw in enumerate(m.items):
        if "do" not in raw:
            file.fault(f"items[{i}]", f"'do' is missing; allowed: {', '.join(ITEMS)}")
        file.choice(f"items[{i}].do", raw["do"], ITEMS)
        struct, write = ITEMS[raw["do"]]
        items.append(write(file.convert(raw, struct, f"items[{i}]")))
    fence, rally = yaml_fence.read_fence(file, m.fence), yaml_fence.read_rally(file, m.rally)
    return Uploaded(m.name, file.name, tuple(items), m.limit_s, None, m.paper, fence, rally)


KINDS: dict[str, tuple[Any, Any]] = {
    "waypoints": (_waypoints, _Waypoints),
    "circle": (_circle, _Circle),
    "mission": (_mission, _Mission),
}


# How each item is written again: command → (do, its fields from the wire's).
def _at(item: Item) -> list[float]:
    return [item.x / LOCAL_SCALE, item.y / LOCAL_SCALE, item.z]


_WRITTEN: dict[int, tuple[str, Callable[[Item], dict[str, Any]]]] = {
    22: ("takeoff", lambda i: {"at_m": _at(i), "heading_deg": i.param4}),
    16: (
        "waypoint",
        lambda i: {"at_m": _at(i), "hold_s": i.param1, "acceptance_m": i.param2, "heading_deg": i.param4},
    ),
    21: ("land", lambda i: {"at_m": _at(i)[:2], "heading_deg": i.param4}),
    20: ("return", lambda i: {}),
    178: ("speed", lambda i: {"speed_m_s": i.param2}),
    93: ("delay", lambda i: {"seconds_s": i.param1}),
}


def dumps(plan: Uploaded) -> str:
    """The text of a YAML mission. Raises ConfigError, naming item and field, for what these files can't say."""
    lines = [f"name: {json.dumps(plan.name[:80])}", "kind: mission", f"limit_s: {plan.limit_s:g}"]
    lines += [*yaml_fence.written(plan.fence, plan.rally, plan.source), "items:"]
    for n, item in enumerate(plan.items):
        where = f"{plan.source}: item {n}"
        if item.command not in _WRITTEN:
            known = ", ".join(f"{command} ({do})" for command, (do, _) in _WRITTEN.items())
            raise ConfigError(f"{where}: command: {item.command} can't be written as YAML; allowed: {known}")
        do, fields = _WRITTEN[item.command]
        said = {"do": do} | {k: v for k, v in fields(item).items() if v != 0.0 and v == v}
        struct, write = ITEMS[do]
        try:
            again = write(msgspec.convert(said, struct))
        except msgspec.ValidationError as error:
            raise ConfigError(f"{where}: {error}") from None
        for field, old, new in zip(Item._fields, item, again, strict=True):
            unset = field.startswith("param") and {str(old), str(new)} <= {"0.0", "nan", "0"}
            if not unset and old != new and not (do == "return" and field in ("frame", "x", "y", "z")):
                raise ConfigError(f"{where}: {field}: {old:g} can't be written as YAML; it would become {new:g}")
        pairs = ", ".join(f"{k}: {v if isinstance(v, str) else json.dumps(v)}" for k, v in said.items())
        lines.append(f"  - {{{pairs}}}")
    return "\n".join(lines) + "\n"
