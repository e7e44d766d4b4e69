"""What is flown in Hold and Orbit on request, and where the vehicle faces meanwhile."""

import math

import pytest
from onboard_flights import NAN, after, hovering, item, place, standing, wait

from sitl.frames import heading, wrap_pi
from sitl.onboard.gaze import Look
from sitl.onboard.guided import Task
from sitl.onboard.mission_items import ItemCommand as C
from sitl.onboard.modes import Mode, Verdict
from sitl.vehicle import Vehicle

CENTRE = (6.0, 0.0, NAN)


def facing(vehicle: Vehicle) -> float:
    n = vehicle.snapshot().nav
    return heading(n.qw, n.qx, n.qy, n.qz)


def bearing(vehicle: Vehicle, north: float, east: float) -> float:
    n, e, _ = place(vehicle)
    return math.atan2(east - e, north - n)


def orbiting(radius: float, look: Look = Look.POINT, speed: float | None = 1.5, total: float = math.inf) -> Vehicle:
    vehicle = hovering()
    assert vehicle.commander.guided.orbit(CENTRE, radius, speed, look, total).ok
    assert vehicle.commander.mode is Mode.ORBIT
    after(vehicle, 10.0)
    return vehicle


@pytest.mark.parametrize(("radius", "way"), [(3.0, 1.0), (-3.0, -1.0)])
def test_an_orbit_keeps_its_radius_speed_and_direction_and_faces_the_centre_lap_after_lap(
    radius: float, way: float
) -> None:
    vehicle = orbiting(radius)
    swept, last = 0.0, None

    def watch(v: Vehicle) -> None:
        nonlocal swept, last
        n, e, d = place(v)
        angle = math.atan2(e, n - 6.0)
        assert math.hypot(n - 6.0, e) == pytest.approx(3.0, abs=0.15)
        assert d == pytest.approx(-3.0, abs=0.15)
        s = v.snapshot().nav
        assert math.hypot(s.v_north_m_s, s.v_east_m_s) == pytest.approx(1.5, abs=0.15)
        assert abs(wrap_pi(facing(v) - bearing(v, 6.0, 0.0))) < math.radians(12.0)
        swept += 0.0 if last is None else wrap_pi(angle - last)
        last = angle

    after(vehicle, 60.0, watch)
    assert swept == pytest.approx(way * 60.0 * 1.5 / 3.0, rel=0.05)
    assert vehicle.snapshot().orbiting.clockwise is (way > 0.0)


def test_an_orbit_of_so_many_radians_ends_there_in_hold() -> None:
    vehicle = hovering()
    c = vehicle.commander
    assert c.guided.orbit((3.0, 0.0, NAN), 3.0, 1.0, Look.AHEAD, math.pi).ok
    task = c.guided.task
    wait(vehicle, lambda v: c.mode is Mode.HOLD, 40.0)
    assert task.state is Task.State.DONE
    assert place(vehicle) == pytest.approx((6.0, 0.0, -3.0), abs=0.2)
    assert facing(vehicle) == pytest.approx(0.0, abs=0.1)
    assert vehicle.snapshot().orbiting is None


def test_an_orbit_along_its_tangent_faces_the_way_it_flies() -> None:
    vehicle = orbiting(3.0, Look.ALONG)

    def watch(v: Vehicle) -> None:
        s = v.snapshot().nav
        assert abs(wrap_pi(facing(v) - math.atan2(s.v_east_m_s, s.v_north_m_s))) < math.radians(20.0)

    after(vehicle, 10.0, watch)


def test_an_orbit_too_fast_for_its_radius_is_flown_as_fast_as_it_can_be() -> None:
    vehicle = orbiting(2.0, speed=6.0)
    s = vehicle.snapshot().nav
    speed = math.hypot(s.v_north_m_s, s.v_east_m_s)
    assert 1.2 < speed < math.sqrt(vehicle.parameters["MPC_ACC_HOR"] * 2.0) * 1.1


def test_an_orbit_is_left_by_any_other_mode_and_can_not_be_asked_for_as_a_mode() -> None:
    vehicle = orbiting(3.0)
    c = vehicle.commander
    assert c.hold().ok
    after(vehicle, 5.0)
    held = place(vehicle)
    after(vehicle, 5.0)
    assert place(vehicle) == pytest.approx(held, abs=0.1)
    assert c.set_mode(Mode.ORBIT).verdict is Verdict.DENIED


@pytest.mark.parametrize("radius", [0.2, 2000.0])
def test_a_circle_of_no_sensible_radius_is_denied(radius: float) -> None:
    outcome = hovering().commander.guided.orbit(CENTRE, radius, None, Look.POINT, math.inf)
    assert outcome.verdict is Verdict.DENIED


def test_requests_on_the_ground_are_refused() -> None:
    guided = standing().commander.guided
    for outcome in (
        guided.orbit((3.0, 0.0, -3.0), 3.0, None, Look.POINT, math.inf),
        guided.turns((3.0, 0.0, -3.0), 3.0, 1.0),
        guided.turn(1.0, 0, None),
    ):
        assert outcome.verdict is Verdict.TEMPORARILY_REJECTED


def test_a_task_tells_how_far_it_has_come_and_that_it_is_done() -> None:
    vehicle = hovering()
    guided = vehicle.commander.guided
    assert guided.turns((0.0, 0.0, NAN), -3.0, 2.0).ok
    task, seen = guided.task, []
    while task.state is Task.State.RUNNING:
        vehicle.advance(vehicle.now_us + 200_000)
        seen.append(task.progress)
    assert seen == sorted(seen)
    assert {0.25, 0.5, 0.75} <= {round(4.0 * p) / 4.0 for p in seen}
    assert (task.state, task.progress) == (Task.State.DONE, 1.0)
    assert vehicle.commander.mode is Mode.HOLD


def test_a_task_is_interrupted_by_the_next_request() -> None:
    vehicle = hovering()
    guided = vehicle.commander.guided
    assert guided.reposition((NAN, NAN, NAN), stay_s=100.0).ok
    task = guided.task
    after(vehicle, 1.0)
    assert guided.turn(1.0, 0, None).ok
    assert task.state is Task.State.INTERRUPTED


@pytest.mark.parametrize(("way", "swept"), [(0, -90.0), (1, 270.0), (-1, -90.0)])
def test_a_turn_goes_the_way_it_is_asked_to(way: int, swept: float) -> None:
    vehicle = hovering()
    assert vehicle.commander.guided.turn(math.radians(-90.0), way, math.radians(40.0)).ok
    turned, last = 0.0, facing(vehicle)

    def watch(v: Vehicle) -> None:
        nonlocal turned, last
        turned, last = turned + wrap_pi(facing(v) - last), facing(v)
        assert abs(v.snapshot().reference.heading_rate_rad_s) < math.radians(42.0)

    after(vehicle, 15.0, watch)
    assert math.degrees(turned) == pytest.approx(swept, abs=2.0)


# what it faces


def test_a_point_of_interest_is_faced_in_hold_while_the_vehicle_goes_elsewhere() -> None:
    vehicle = hovering()
    c = vehicle.commander
    assert c.face((10.0, 10.0, 0.0)).ok
    after(vehicle, 6.0)
    assert facing(vehicle) == pytest.approx(math.radians(45.0), abs=0.03)
    assert c.guided.reposition((10.0, 0.0, NAN)).ok
    after(vehicle, 12.0)
    assert place(vehicle)[:2] == pytest.approx((10.0, 0.0), abs=0.1)
    assert facing(vehicle) == pytest.approx(math.radians(90.0), abs=0.03)


def test_a_mission_faces_its_point_of_interest_until_it_says_none() -> None:
    plan = (
        item(C.DO_SET_ROI_LOCATION, (5.0, 20.0, 0.0)),
        item(C.WAYPOINT, (10.0, 0.0, -3.0), p1=3.0),
        item(C.DO_SET_ROI_NONE),
        item(C.WAYPOINT, (10.0, 5.0, -3.0), p1=3.0, p4=0.0),
    )
    vehicle = hovering()
    assert vehicle.mission.replace(plan) is None
    assert vehicle.commander.start_mission().ok
    wait(vehicle, lambda v: v.mission.current == 2 or v.mission.current == 3, 30.0)
    assert facing(vehicle) == pytest.approx(bearing(vehicle, 5.0, 20.0), abs=0.05)
    wait(vehicle, lambda v: v.commander.mode is Mode.HOLD, 30.0)
    assert facing(vehicle) == pytest.approx(0.0, abs=0.05)


def test_there_is_nothing_to_face_in_modes_that_steer_the_heading_themselves() -> None:
    vehicle = hovering()
    assert vehicle.commander.set_mode(Mode.POSITION).ok
    assert vehicle.commander.face((10.0, 10.0, 0.0)).verdict is Verdict.TEMPORARILY_REJECTED
