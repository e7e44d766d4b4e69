"""What may stand in a fence, what it shuts out, and what the vehicle does about it."""

import math

import pytest
from onboard_flights import NAN, after, hovering, item, of_kind, place, standing, texts, wait

from sitl.onboard.fence import FenceCommand as F
from sitl.onboard.geofence import BreachKind
from sitl.onboard.mission_items import ItemCommand as C
from sitl.onboard.modes import EventKind, Mode, Verdict
from sitl.onboard.offboard import OffboardTarget
from sitl.onboard.plan import Frame, MissionItem
from sitl.onboard.rally import RallyCommand
from sitl.onboard.store import MemoryStore
from sitl.vehicle import Vehicle


def vertex(command: F, count: float, north: float, east: float, group: float = 0.0) -> MissionItem:
    x, y = round(north * 1e4), round(east * 1e4)
    return MissionItem(int(Frame.LOCAL_NED), int(command), 0, 1, count, group, 0.0, 0.0, x, y, 0.0, 1)


def polygon(command: F, *corners: tuple[float, float], group: float = 0.0) -> list[MissionItem]:
    return [vertex(command, len(corners), *corner, group) for corner in corners]


def square(command: F, half: float, north: float = 0.0, east: float = 0.0, group: float = 0.0) -> list[MissionItem]:
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return polygon(command, *((north + a * half, east + b * half) for a, b in signs), group=group)


def circle(command: F, radius: float, north: float = 0.0, east: float = 0.0, group: float = 0.0) -> list[MissionItem]:
    return [vertex(command, radius, north, east, group)]


ROOM = square(F.POLYGON_INCLUSION, 10.0)


# what may stand in it


@pytest.mark.parametrize(
    ("items", "index", "field"),
    [
        ([*ROOM, item(C.WAYPOINT, (0.0, 0.0, -3.0))], 4, "command"),
        (ROOM[:3], 0, "param1"),
        ([*ROOM[:2], *circle(F.CIRCLE_INCLUSION, 5.0), ROOM[2]], 2, "command"),
        ([*ROOM[:2], ROOM[2]._replace(param1=5.0), ROOM[3]], 2, "param1"),
        (polygon(F.POLYGON_INCLUSION, (0.0, 0.0), (1.0, 0.0)), 0, "param1"),
        ([vertex(F.POLYGON_EXCLUSION, NAN, 0.0, 0.0)], 0, "param1"),
        ([vertex(F.POLYGON_EXCLUSION, 3.5, 0.0, 0.0)], 0, "param1"),
        (circle(F.CIRCLE_EXCLUSION, 0.0), 0, "param1"),
        (circle(F.CIRCLE_EXCLUSION, NAN), 0, "param1"),
        (circle(F.CIRCLE_INCLUSION, math.inf), 0, "param1"),
        (circle(F.CIRCLE_INCLUSION, 5.0, group=-1.0), 0, "param2"),
        ([circle(F.CIRCLE_INCLUSION, 5.0)[0]._replace(param3=1.0)], 0, "param3"),
        ([circle(F.CIRCLE_INCLUSION, 5.0)[0]._replace(frame=int(Frame.MISSION))], 0, "frame"),
        ([circle(F.CIRCLE_INCLUSION, 5.0)[0]._replace(frame=6, x=910_000_000)], 0, "param5"),
        ([vertex(F.RETURN_POINT, 0.0, 0.0, 0.0), vertex(F.RETURN_POINT, 0.0, 1.0, 0.0)], 1, "command"),
    ],
)
def test_a_fence_that_is_wrong_is_refused_at_the_item_at_fault(
    items: list[MissionItem], index: int, field: str
) -> None:
    fence = standing().plans.fence
    assert fence.replace(ROOM) is None
    fault = fence.replace(items)
    assert fault is not None
    assert (fault.index, fault.field) == (index, field)
    assert fence.items == tuple(ROOM)


def test_a_fence_that_shuts_home_or_the_flying_vehicle_out_is_refused_and_says_so() -> None:
    vehicle = hovering()
    fence = vehicle.plans.fence
    fault = fence.replace(circle(F.CIRCLE_EXCLUSION, 2.0, north=1.0))
    assert (fault.index, fault.field) == (0, "place")
    assert fault.reason == "home would be inside the forbidden circle of fence item 0"
    assert vehicle.commander.guided.reposition((8.0, 0.0, NAN)).ok
    after(vehicle, 8.0)
    fault = fence.replace([*square(F.POLYGON_EXCLUSION, 1.0, 30.0), *circle(F.CIRCLE_INCLUSION, 4.0)])
    assert (fault.index, fault.reason) == (4, "the vehicle would be outside the circle of fence item 4")
    assert fence.items == ()


def test_a_fence_outlives_the_vehicle_and_keeps_its_id() -> None:
    store = MemoryStore()
    first = standing(store=store).plans
    assert first.fence.replace(ROOM) is None
    assert first.rally.replace([item(RallyCommand.RALLY_POINT, (5.0, 0.0, -2.0))]) is None
    again = standing(store=store).plans
    assert (again.fence.items, again.rally.items) == (first.fence.items, first.rally.items)
    assert (again.fence.plan_id, again.rally.plan_id) == (first.fence.plan_id, first.rally.plan_id)
    assert 0 not in (again.fence.plan_id, again.rally.plan_id)


# what it shuts out


@pytest.mark.parametrize(
    ("fence", "north", "east", "inside"),
    [
        (ROOM, 9.9, -9.9, True),
        (ROOM, 10.1, 0.0, False),
        (circle(F.CIRCLE_INCLUSION, 5.0), 3.0, 3.9, True),
        (circle(F.CIRCLE_INCLUSION, 5.0), 3.0, 4.1, False),
        ([*ROOM, *square(F.POLYGON_EXCLUSION, 1.0, 5.0)], 5.0, 0.5, False),
        ([*ROOM, *square(F.POLYGON_EXCLUSION, 1.0, 5.0)], 6.5, 0.5, True),
        ([*ROOM, *circle(F.CIRCLE_INCLUSION, 5.0)], 7.0, 0.0, False),  # one group: inside all of them
        ([*ROOM, *circle(F.CIRCLE_INCLUSION, 5.0, 12.0, group=1.0)], 14.0, 0.0, True),  # two groups: inside one
        ([*ROOM, *circle(F.CIRCLE_INCLUSION, 5.0, 12.0, group=1.0)], 18.0, 0.0, False),
        (polygon(F.POLYGON_INCLUSION, (-5, -5), (10, -5), (10, 5), (5, 0), (-5, 5)), 9.0, 0.0, True),
        (polygon(F.POLYGON_INCLUSION, (-5, -5), (10, -5), (10, 5), (5, 0), (-5, 5)), 4.0, 4.0, False),
        ([], 1e4, 1e4, True),
    ],
)
def test_areas_contain_what_lies_in_them(fence: list[MissionItem], north: float, east: float, inside: bool) -> None:
    plans = standing().plans
    assert plans.fence.replace(fence) is None
    assert (plans.geofence.violation((north, east, -3.0)) is None) is inside


def test_limits_of_distance_and_height_count_from_home_and_action_none_lifts_them() -> None:
    vehicle = standing(overrides={"GF_MAX_HOR_DIST": 20.0, "GF_MAX_VER_DIST": 10.0})
    geofence = vehicle.plans.geofence
    assert geofence.violation((19.0, 0.0, -9.0)) is None
    assert geofence.violation((15.0, 15.0, -3.0)).kind is BreachKind.BOUNDARY
    assert geofence.violation((0.0, 0.0, -10.5)).kind is BreachKind.MAX_ALTITUDE
    assert vehicle.parameters.set("GF_ACTION", 0) is None
    assert geofence.violation((15.0, 15.0, -30.0)) is None


# targets outside it


def test_targets_outside_the_fence_are_refused_and_named() -> None:
    vehicle = hovering(overrides={"GF_MAX_VER_DIST": 20.0})
    c = vehicle.commander
    assert vehicle.plans.fence.replace(ROOM) is None
    for outcome in (
        c.guided.reposition((12.0, 0.0, NAN)),
        c.guided.turns((8.0, 0.0, NAN), 4.0, 1.0),
        c.takeoff(c.home.alt_amsl_m + 25.0),
        c.set_home(c._places.global_of((30.0, 0.0, 0.0))),
        vehicle.offboard.submit(OffboardTarget(None, (0.0, 12.0, -3.0)), vehicle.now_us),
        vehicle.offboard.submit(OffboardTarget(None, (NAN, NAN, -25.0)), vehicle.now_us),
    ):
        assert outcome.verdict is Verdict.DENIED
        assert "fence" in outcome.reason
    assert vehicle.offboard.lost(vehicle.now_us)
    assert c.mode is Mode.HOLD
    assert c.guided.reposition((9.0, 0.0, NAN)).ok


def test_a_mission_that_leaves_the_fence_is_kept_but_not_started_and_says_why() -> None:
    vehicle = standing()
    c = vehicle.commander
    assert vehicle.plans.fence.replace(ROOM) is None
    plan = (item(C.TAKEOFF, (0.0, 0.0, -3.0)), item(C.WAYPOINT, (0.0, 15.0, -3.0)))
    assert vehicle.mission.replace(plan) is None
    after(vehicle, 0.1)
    told = "item 1 lies outside the fence: outside the polygon of fence item 0"
    assert f"mission can't be started: {told}" in texts(vehicle.events)
    outcome = c.start_mission()
    assert (outcome.verdict, outcome.reason) == (Verdict.TEMPORARILY_REJECTED, told)
    assert vehicle.plans.fence.clear() is None
    assert c.start_mission().ok


def test_arming_outside_the_fence_is_refused() -> None:
    store = MemoryStore()
    assert standing(store=store).plans.fence.replace([vertex_at_home(5.0)]) is None
    elsewhere = Vehicle(standing().spec, home=standing().commander.home._replace(lat_deg=55.70), store=store)
    elsewhere.advance(100_000)
    outcome = elsewhere.commander.arm()
    assert outcome.verdict is Verdict.TEMPORARILY_REJECTED
    assert "outside the fence" in outcome.reason


def vertex_at_home(radius: float) -> MissionItem:
    home = standing().commander.home
    x, y = round(home.lat_deg * 1e7), round(home.lon_deg * 1e7)
    return MissionItem(5, int(F.CIRCLE_INCLUSION), 0, 1, radius, 0.0, 0.0, 0.0, x, y, 0.0, 1)


# leaving it


def leaves(action: int, **overrides: float) -> Vehicle:
    """A vehicle that sticks drive out to the north of a fence of 10 m; it has been seen leaving."""
    vehicle = hovering(overrides={"GF_ACTION": action, **overrides})
    c = vehicle.commander
    assert vehicle.plans.fence.replace(ROOM) is None
    assert c.set_mode(Mode.POSITION).ok
    for _ in range(600):
        c.manual(1.0, 0.0, 0.0, 0.0)
        vehicle.advance(vehicle.now_us + 20_000)
        if c.geofence.breach.outside:
            return vehicle
    raise AssertionError("it has not left the fence")


@pytest.mark.parametrize(("action", "mode"), [(1, Mode.POSITION), (2, Mode.HOLD), (3, Mode.RETURN), (5, Mode.LAND)])
def test_a_breach_is_told_once_and_answered_as_the_parameter_says(action: int, mode: Mode) -> None:
    vehicle = leaves(action)
    c = vehicle.commander
    assert c.mode is mode
    assert (c.failsafe == "fence breached") is (action != 1)
    after(vehicle, 1.0)
    told = [text for text in texts(vehicle.events) if text.startswith("fence breached: outside the polygon")]
    assert len(told) == 1
    assert c.geofence.breach.times == 1
    assert c.geofence.breach.kind is BreachKind.BOUNDARY
    assert len(of_kind(vehicle, EventKind.FENCE)) == 1


def test_a_breach_terminates_the_flight_where_that_is_asked_for() -> None:
    vehicle = leaves(4)
    assert not vehicle.commander.armed
    assert vehicle.commander.failsafe == "flight terminated"


def test_a_vehicle_that_is_back_inside_may_breach_again() -> None:
    vehicle = leaves(3)
    wait(vehicle, lambda v: not v.commander.geofence.breach.outside, 30.0)
    assert vehicle.commander.geofence.breach.times == 1
    assert len(of_kind(vehicle, EventKind.FENCE)) == 2


def test_a_breach_ends_with_the_fence_or_the_wish_to_keep_to_it() -> None:
    for lift in (lambda v: v.plans.fence.replace([]), lambda v: v.parameters.set("GF_ACTION", 0.0)):
        vehicle = leaves(1)
        assert lift(vehicle) is None
        after(vehicle, 0.1)
        assert not vehicle.commander.geofence.breach.outside
        assert vehicle.commander.geofence.breach.times == 1


def test_with_prediction_the_vehicle_halts_within_the_fence() -> None:
    def furthest(vehicle: Vehicle) -> float:
        most = place(vehicle)[0]
        for _ in range(150):
            vehicle.advance(vehicle.now_us + 40_000)
            most = max(most, place(vehicle)[0])
        return most

    assert furthest(leaves(2)) > 11.0
    assert furthest(leaves(2, GF_PREDICT=1)) < 10.2


# where to return to


RALLY = [
    item(RallyCommand.RALLY_POINT, (8.0, 3.0, -2.0), p4=0.0),
    item(RallyCommand.RALLY_POINT, (-8.0, 3.0, -7.0), p4=0.0),
]


@pytest.mark.parametrize(("start", "end"), [((7.0, 0.0), (8.0, 3.0)), ((1.0, 0.0), (0.0, 0.0))])
def test_return_leads_to_the_nearest_of_home_and_the_rally_points(start: tuple, end: tuple) -> None:
    vehicle = hovering()
    c = vehicle.commander
    assert vehicle.plans.rally.replace(RALLY) is None
    assert c.guided.reposition((*start, NAN)).ok
    after(vehicle, 8.0)
    assert c.return_home().ok
    wait(vehicle, lambda v: not c.armed, 60.0)
    assert place(vehicle)[:2] == pytest.approx(end, abs=0.3)


def test_a_rally_point_outside_the_fence_is_left_out() -> None:
    vehicle = hovering()
    c = vehicle.commander
    assert vehicle.plans.rally.replace(RALLY) is None
    assert vehicle.plans.fence.replace(circle(F.CIRCLE_INCLUSION, 8.2)) is None
    assert c.guided.reposition((7.0, 0.0, NAN)).ok
    after(vehicle, 8.0)
    assert c.return_home().ok
    wait(vehicle, lambda v: not c.armed, 60.0)
    assert place(vehicle)[:2] == pytest.approx((0.0, 0.0), abs=0.3)


def test_the_missions_landing_counts_where_the_return_type_says_so() -> None:
    plan = (item(C.WAYPOINT, (5.0, 0.0, -3.0)), item(C.DO_LAND_START), item(C.LAND, (0.0, 9.0, 0.0)))
    for kind, end in ((0, (0.0, 0.0)), (1, (0.0, 9.0))):
        vehicle = hovering(overrides={"RTL_TYPE": kind})
        assert vehicle.mission.replace(plan) is None
        assert vehicle.commander.guided.reposition((0.0, 7.0, NAN)).ok
        after(vehicle, 8.0)
        assert vehicle.commander.return_home().ok
        wait(vehicle, lambda v: not v.commander.armed, 60.0)
        assert place(vehicle)[:2] == pytest.approx(end, abs=0.3)


def test_a_breach_returns_to_the_fences_own_point() -> None:
    vehicle = hovering(overrides={"GF_ACTION": 3})
    c = vehicle.commander
    point = vertex(F.RETURN_POINT, 0.0, 3.0, 4.0)._replace(z=-2.0)
    assert vehicle.plans.fence.replace([point, *ROOM]) is None
    assert c.set_mode(Mode.POSITION).ok
    while c.mode is Mode.POSITION:
        c.manual(1.0, 0.0, 0.0, 0.0)
        vehicle.advance(vehicle.now_us + 20_000)
    wait(vehicle, lambda v: not c.armed, 60.0)
    assert place(vehicle)[:2] == pytest.approx((3.0, 4.0), abs=0.3)


def test_return_waits_at_its_height_before_it_lands_or_for_ever() -> None:
    vehicle = hovering(overrides={"RTL_LAND_DELAY": 5.0, "RTL_DESCEND_ALT": 2.0})
    assert vehicle.commander.guided.reposition((5.0, 0.0, NAN)).ok
    after(vehicle, 6.0)
    assert vehicle.commander.return_home().ok
    wait(vehicle, lambda v: abs(place(v)[2] + 2.0) < 0.05 and abs(place(v)[0]) < 0.2, 60.0)
    since = vehicle.now_us
    wait(vehicle, lambda v: place(v)[2] > -1.5, 30.0)
    assert 4.0 < (vehicle.now_us - since) * 1e-6 < 9.0
    vehicle = hovering(overrides={"RTL_LAND_DELAY": -1.0})
    assert vehicle.commander.return_home().ok
    after(vehicle, 60.0)
    assert vehicle.commander.armed
    assert place(vehicle)[2] == pytest.approx(-3.0, abs=0.1)
