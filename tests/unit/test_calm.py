"""Ticks that are passed over change nothing: a flight has the same bits with them and without."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sitl.closed_loop import TRACE_COLUMNS
from sitl.control.guidance import Guidance
from sitl.model.failures import SOUND
from sitl.onboard.gaze import Look
from sitl.onboard.modes import Event
from sitl.onboard.plan import MissionItem
from sitl.snapshot import Snapshot
from sitl.vehicle import Vehicle, load_vehicle

pytestmark = pytest.mark.compiled

SPECS = {name: load_vehicle(name) for name in ("yawsitter", "yawsitter-real")}
NAN = math.nan
Request = Callable[[Vehicle], Any]
Script = list[tuple[float, Request]]
"""Seconds, and what is asked for then."""


def item(command: int, north: float = 0.0, east: float = 0.0, down: float = 0.0, *params: float) -> MissionItem:
    p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4] if params else (0.0, 0.0, 0.0, NAN)
    return MissionItem(1, command, 0, 1, p1, p2, p3, p4, round(north * 1e4), round(east * 1e4), down)


def flown(vehicle: str, script: Script, end_s: float, restless: bool, **options: Any) -> tuple[Any, ...]:
    """Trace, events, last snapshot and number of ticks of a flight that is advanced from request to request."""
    craft = Vehicle(SPECS[vehicle], **options)
    craft.restless = restless
    ticks, tick = [0], craft.commander.tick

    def counted(*now: Any) -> Guidance:
        ticks[0] += 1
        return tick(*now)

    craft.commander.tick = counted  # type: ignore[method-assign]
    trace = np.zeros((round(end_s * 500), len(TRACE_COLUMNS)))
    for at_s, request in [*script, (end_s, lambda _: None)]:
        until_us = round(at_s * 1e6)
        craft.advance(until_us, trace[craft.now_us // 2000 : until_us // 2000])
        request(craft)
    return trace, craft.events.since(0), craft.snapshot(), ticks[0]


def same(vehicle: str, script: Script, end_s: float, most: float, **options: Any) -> tuple[list[Event], Snapshot]:
    """Asserts it, and that no more than the share `most` of all ticks was taken."""
    every = flown(vehicle, script, end_s, True, **options)
    few = flown(vehicle, script, end_s, False, **options)
    assert few[1] == every[1]
    assert few[2] == every[2]
    different = np.flatnonzero((few[0] != every[0]).any(axis=1))
    assert not different.size, f"from {different[0] / 500} s on"
    assert few[3] <= most * every[3] + 2, f"{few[3]} of {every[3]} ticks"
    return few[1], few[2]


def mission(*items: MissionItem) -> Script:
    return [
        (0.1, lambda v: v.mission.replace(items)),
        (0.2, lambda v: v.commander.arm()),
        (0.3, lambda v: v.commander.start_mission()),
    ]


UP, DOWN = item(22, 0.0, 0.0, -3.0), item(21)
WIND = {"wind_N": (1.0, -0.5, 0.0), "gust_m_s": 0.4, "seed": 4}
MISSIONS = {
    "points to stop at and to pass": (UP, item(16, 6.0, 0.0, -3.0), item(16, 6.0, 5.0, -4.0), item(16, 9.0, 9.0), DOWN),
    "holds and delays": (
        UP, item(16, 1.0, 0.0, -3.0, 2.0), item(93, 0, 0, 0, 1.5), item(19, 1.0, 1.0, -3.0, 1.0), DOWN,
    ),
    "turns, a height, a heading": (
        UP, item(18, 0.0, 0.0, -3.0, 1.0, 0.0, 2.0), item(31, 0.0, 0.0, -5.0), item(115, 0, 0, 0, 90.0), DOWN,
    ),
    "jumps, speeds, a spline": (
        UP, item(16, 3.0, 0.0, -3.0), item(178, 0, 0, 0, 1.0, 1.0, -1.0), item(82, 3.0, 3.0, -3.0),
        item(82, 0.0, 3.0, -3.0), item(177, 0, 0, 0, 1.0, 1.0), item(20),
    ),
    "a distance, points met closely": (
        UP, item(114, 0, 0, 0, 3.0), item(16, 8.0, 0.0, -3.0, 0.0, 0.03), item(16, 8.0, 2.0, -3.0, 0.3, 0.014), DOWN,
    ),
    "a distance, a place to face": (
        UP, item(201, 5.0, 5.0, 0.0, 3.0), item(114, 0, 0, 0, 3.0), item(16, 8.0, 0.0, -3.0), item(197), DOWN,
    ),
}  # fmt: skip


@pytest.mark.parametrize("vehicle", SPECS)
@pytest.mark.parametrize("name", MISSIONS)
def test_missions_fly_the_same_with_a_fraction_of_the_ticks(name: str, vehicle: str) -> None:
    most = 0.6 if "face" in name else 0.4
    events, last = same(vehicle, mission(*MISSIONS[name]), 60.0, most, **WIND)
    assert not last.armed
    assert {e.value for e in events if e.kind.name == "ITEM_REACHED"} >= {0, 1, len(MISSIONS[name]) - 1}


REQUESTS: dict[str, tuple[Script, float, float]] = {
    "take-off, hold, landing": (
        [(0.1, lambda v: v.commander.takeoff()), (0.2, lambda v: v.commander.arm()),
         (9.0, lambda v: v.commander.land())],
        25.0, 0.3,
    ),
    "return from afar": (
        [(0.1, lambda v: v.commander.takeoff()), (0.2, lambda v: v.commander.arm()),
         (8.0, lambda v: v.commander.guided.reposition((8.0, 4.0, -3.0), 1.0, None, 1.0)),
         (16.0, lambda v: v.commander.return_home())],
        60.0, 0.3,
    ),
    "standing armed, then flying to a point": (
        [(0.1, lambda v: v.commander.arm()), (3.0, lambda v: v.commander.takeoff()),
         (9.0, lambda v: v.commander.guided.turns((0.0, 0.0, -2.5), 2.0, 1.0))],
        25.0, 0.4,
    ),
    "an orbit that looks inward": (
        [(0.1, lambda v: v.commander.takeoff()), (0.2, lambda v: v.commander.arm()),
         (7.0, lambda v: v.commander.guided.orbit((3.0, 0.0, -2.5), 3.0, 1.5, Look.POINT, math.inf))],
        20.0, 1.0,
    ),
    "an orbit without end": (
        [(0.1, lambda v: v.commander.takeoff()), (0.2, lambda v: v.commander.arm()),
         (7.0, lambda v: v.commander.guided.orbit((1.0, 0.0, -2.5), 1.0, 1.5, Look.AHEAD, math.inf))],
        30.0, 0.5,
    ),
    "sticks": (
        [(0.1, lambda v: v.commander.takeoff()), (0.2, lambda v: v.commander.arm()),
         (7.0, lambda v: v.commander.set_mode(v.commander.mode.POSITION)),
         (7.1, lambda v: v.commander.manual(0.5, 0.0, 0.2, 0.1)), (8.0, lambda v: v.commander.manual(0, 0, 0, 0))],
        12.0, 1.0,
    ),
    "a motor that fails": (
        [(0.1, lambda v: v.commander.takeoff()), (0.2, lambda v: v.commander.arm()),
         (6.0, lambda v: setattr(v, "failures", SOUND._replace(motor_left=0.0)))],
        12.0, 1.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("vehicle", SPECS)
@pytest.mark.parametrize("name", REQUESTS)
def test_requests_are_flown_the_same(name: str, vehicle: str) -> None:
    script, end_s, most = REQUESTS[name]
    same(vehicle, script, end_s, most, **WIND)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        pytest.param({"BAT_LOW_THR": 0.97, "BAT_CRIT_THR": 0.96, "COM_LOW_BAT_ACT": 2.0}, "battery", id="battery"),
        pytest.param({"GF_MAX_HOR_DIST": 4.0, "GF_ACTION": 3.0}, "breached", id="fence"),
        pytest.param({"GF_MAX_HOR_DIST": 4.0, "GF_ACTION": 2.0, "GF_PREDICT": 1.0}, "breached", id="fence ahead"),
    ],
)
def test_what_is_watched_is_noticed_at_the_very_tick(settings: dict[str, float], told: str) -> None:
    script: Script = [
        (0.1, lambda v: v.commander.takeoff()),
        (0.2, lambda v: v.commander.arm()),
        (7.0, lambda v: v.commander.guided.reposition((9.0, 0.0, -3.0))),
        (7.5, lambda v: [v.parameters.set(name, value) for name, value in settings.items()]),
    ]
    events, _ = same("yawsitter-real", script, 40.0, 1.0, **WIND)
    assert any(told in e.text for e in events)


def test_a_vehicle_that_has_begun_to_lie_is_looked_at_until_it_stands() -> None:
    craft = Vehicle(SPECS["yawsitter"])
    craft.advance(20_000)
    assert craft.commander.calm() is not None
    nav = craft.snapshot().nav
    craft.commander.tick(40_000, nav._replace(qw=1.0, qx=0.0, qy=0.0, qz=0.0), 2)
    assert craft.commander.calm() is None
    craft.commander.tick(60_000, nav, 4)
    assert craft.commander.calm() is not None


@settings(max_examples=12)
@given(
    cuts_ms=st.lists(st.integers(1, 9000), max_size=6),
    points=st.lists(st.tuples(st.floats(-6, 6), st.floats(-6, 6), st.floats(-5, -1)), min_size=1, max_size=3),
    hold_s=st.sampled_from([0.0, 0.7]),
    radius_m=st.sampled_from([0.0, 0.5, 3.0]),
)
def test_however_a_flight_is_cut_into_calls_it_is_the_same(
    cuts_ms: list[int], points: list[tuple[float, float, float]], hold_s: float, radius_m: float
) -> None:
    items = (UP, *(item(16, *point, hold_s, radius_m, 0.0, NAN) for point in points), DOWN)
    cuts: Script = [(1.0 + 2 * ms / 1000, lambda _: None) for ms in sorted(cuts_ms)]
    same("yawsitter-real", [*mission(*items), *cuts], 22.0, 1.0, seed=2, gust_m_s=0.3)


PLACES = st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(-6, -0.3))
ASKED: st.SearchStrategy[Request] = st.one_of(
    st.sampled_from(
        [
            lambda v: v.commander.arm(),
            lambda v: v.commander.takeoff(),
            lambda v: v.commander.land(),
            lambda v: v.commander.hold(),
            lambda v: v.commander.return_home(),
            lambda v: v.commander.disarm(),
            lambda v: v.commander.disarm(force=True),
            lambda v: v.commander.start_mission(),
            lambda v: v.commander.set_home(None),
            lambda v: v.commander.face((3.0, 3.0, 0.0)),
            lambda v: v.mission.replace((UP, item(16, 2.0, 1.0, -3.0), item(93, 0, 0, 0, 0.5), DOWN)),
            lambda v: v.mission.set_current(1),
            lambda v: v.parameters.set("GF_MAX_HOR_DIST", 5.0),
            lambda v: v.parameters.set("BAT_LOW_THR", 0.99),
            lambda v: v.reset(),
        ]
    ),
    PLACES.map(lambda place: lambda v: v.commander.guided.reposition(place, 0.5)),
    PLACES.map(lambda place: lambda v: v.commander.guided.turns(place, 1.5, 0.5)),
    PLACES.map(lambda place: lambda v: v.commander.guided.orbit(place, 2.0, None, Look.ALONG, 4.0)),
    st.floats(0.5, 3.0).map(lambda speed: lambda v: v.commander.change_speed(speed)),
)


@settings(max_examples=40)
@given(st.lists(st.tuples(st.integers(2, 600), ASKED), max_size=10), st.sampled_from(sorted(SPECS)), st.booleans())
def test_whatever_is_asked_whenever_it_is_flown_the_same(
    asked: list[tuple[int, Request]], vehicle: str, gusty: bool
) -> None:
    at_s, script = 0.02, [(0.02, lambda v: v.commander.takeoff()), (0.02, lambda v: v.commander.arm())]
    for steps, request in asked:
        at_s += steps * 0.002 * 5
        script.append((at_s, request))
    same(vehicle, script, at_s + 6.0, 1.0, seed=7, gust_m_s=0.5 if gusty else 0.0)
