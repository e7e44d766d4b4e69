"""Missions flown by whole vehicles: every kind of item, jumps, replacement in flight."""

import math

import numpy as np
import pytest
from onboard_flights import NAN, SPECS, after, hovering, item, of_kind, place, reached, standing, texts, wait

from sitl.frames import heading, wrap_pi
from sitl.geodesy import to_global
from sitl.onboard.mission import MissionState
from sitl.onboard.mission_items import ItemCommand as C
from sitl.onboard.modes import EventKind, Landed, Mode
from sitl.onboard.plan import Frame, MissionItem
from sitl.vehicle import Vehicle

UP = (0.0, 0.0, -3.0)
A, B = (6.0, 0.0, -3.0), (6.0, 6.0, -4.0)


def flown(plan: tuple[MissionItem, ...], seconds: float = 90.0, vehicle: Vehicle | None = None) -> Vehicle:
    """Upload, arm if need be, start, and fly until the mission mode is left."""
    vehicle = vehicle or standing()
    assert vehicle.mission.replace(plan) is None
    assert vehicle.commander.arm().ok
    assert vehicle.commander.start_mission().ok
    wait(vehicle, lambda v: v.commander.mode is not Mode.MISSION, seconds)
    return vehicle


@pytest.mark.parametrize("name", sorted(SPECS))
def test_a_whole_plan_is_flown_in_order_and_ends_landed_and_disarmed(name: str) -> None:
    plan = (
        item(C.TAKEOFF, UP),
        item(C.WAYPOINT, A),
        item(C.WAYPOINT, B, p1=1.0),
        item(C.DO_CHANGE_SPEED, p2=1.5, z=NAN),
        item(C.SPLINE_WAYPOINT, (0.0, 6.0, -4.0)),
        item(C.LAND, (0.0, 3.0, 0.0)),
    )
    vehicle = flown(plan, vehicle=standing(name))
    assert reached(vehicle) == [0, 1, 2, 3, 4, 5]
    assert [e.value for e in of_kind(vehicle, EventKind.ITEM_CURRENT) if not e.text] == [0, 1, 2, 3, 4, 5]
    assert vehicle.mission.state is MissionState.COMPLETE
    assert not vehicle.commander.armed
    assert place(vehicle)[:2] == pytest.approx((0.0, 3.0), abs=0.1)
    after(vehicle, 30.0)
    assert reached(vehicle) == [0, 1, 2, 3, 4, 5]
    assert len(of_kind(vehicle, EventKind.ARMED)) == 2
    assert (vehicle.commander.mode, vehicle.commander.landed) == (Mode.HOLD, Landed.ON_GROUND)


def test_a_landing_at_the_end_is_not_begun_again_while_it_waits_to_disarm() -> None:
    vehicle = hovering(2.0, "yawsitter-real", overrides={"COM_DISARM_LAND": 20.0})
    vehicle.mission.replace((item(C.LAND, (0.0, 0.0, 0.0)),))
    vehicle.commander.start_mission()
    wait(vehicle, lambda v: v.commander.landed is Landed.ON_GROUND, 30.0)
    after(vehicle, 18.0)
    assert (vehicle.commander.mode, vehicle.mission.state) == (Mode.MISSION, MissionState.COMPLETE)
    assert reached(vehicle) == [0]
    landed = [e.text for e in of_kind(vehicle, EventKind.LANDED)]
    assert landed[-1] == "on ground"
    assert landed.count("on ground") == 1
    wait(vehicle, lambda v: not v.commander.armed, 5.0)
    assert vehicle.commander.mode is Mode.HOLD


def test_a_mission_that_only_lands_a_standing_vehicle_disarms_it_without_lifting_off() -> None:
    vehicle = flown((item(C.LAND, (4.0, 0.0, 0.0)),), 10.0, standing("yawsitter-real"))
    assert of_kind(vehicle, EventKind.LANDED) == []
    assert reached(vehicle) == [0]
    assert not vehicle.commander.armed


def test_a_landing_in_the_middle_is_touched_and_left_again() -> None:
    vehicle = flown((item(C.TAKEOFF, UP), item(C.LAND, UP), item(C.WAYPOINT, A)))
    assert reached(vehicle) == [0, 1, 2]
    assert vehicle.commander.armed
    landed = [e.text for e in of_kind(vehicle, EventKind.LANDED)]
    assert landed.count("on ground") == 1
    assert place(vehicle) == pytest.approx(A, abs=0.2)


def test_a_first_waypoint_is_climbed_to_before_it_is_flown_to() -> None:
    vehicle, track = standing(), []
    vehicle.mission.replace((item(C.WAYPOINT, (15.0, 0.0, -2.0)),))
    vehicle.commander.arm()
    vehicle.commander.start_mission()
    after(vehicle, 25.0, lambda v: track.append(place(v)))
    assert all(down < -1.5 for north, _, down in track if north > 0.3)
    assert place(vehicle) == pytest.approx((15.0, 0.0, -2.0), abs=0.05)
    assert vehicle.mission.state is MissionState.COMPLETE


def test_a_point_in_the_ground_is_flown_to_just_above_it() -> None:
    vehicle = flown((item(C.TAKEOFF, UP), item(C.WAYPOINT, (3.0, 0.0, 5.0))))
    after(vehicle, 3.0)
    assert place(vehicle) == pytest.approx((3.0, 0.0, -0.2), abs=0.1)
    assert not vehicle.commander.tipped_over


@pytest.mark.parametrize("height_m", [-40.0, 0.0, 0.3])
def test_a_take_off_to_below_the_vehicle_still_leaves_the_ground(height_m: float) -> None:
    vehicle = standing()
    amsl = vehicle.commander.origin.alt_amsl_m + height_m
    flown((MissionItem(Frame.GLOBAL_INT, C.TAKEOFF, 0, 1, 0.0, 0.0, 0.0, NAN, 0, 0, amsl),), 20.0, vehicle)
    after(vehicle, 2.0)
    assert reached(vehicle) == [0]
    assert place(vehicle)[2] == pytest.approx(-0.5, abs=0.05)


def test_items_in_global_frames_lead_to_the_same_places() -> None:
    vehicle = standing()
    origin = vehicle.commander.origin
    lat, lon = (round(x * 1e7) for x in to_global(origin, 8.0, -4.0))
    plan = (
        MissionItem(Frame.GLOBAL_RELATIVE_ALT_INT, C.TAKEOFF, 0, 1, 0.0, 0.0, 0.0, NAN, 0, 0, 3.0),
        MissionItem(Frame.GLOBAL_INT, C.WAYPOINT, 0, 1, 0.0, 0.0, 0.0, NAN, lat, lon, origin.alt_amsl_m + 4.0),
    )
    after(flown(plan, vehicle=vehicle), 2.0)
    assert place(vehicle) == pytest.approx((8.0, -4.0, -4.0), abs=0.1)


def test_a_waypoint_in_line_is_flown_through_and_a_corner_with_a_hold_is_stopped_at() -> None:
    vehicle, speeds = hovering(), {1: [], 2: []}
    vehicle.mission.replace(
        (item(C.WAYPOINT, (12.0, 0.0, -3.0)), item(C.WAYPOINT, (24.0, 1.0, -3.0), p1=2.0), item(C.WAYPOINT, UP))
    )
    vehicle.commander.start_mission()

    def watch(v: Vehicle) -> None:
        s = v.snapshot()
        if s.mission_state is MissionState.ACTIVE and s.mission_current in speeds:
            speeds[s.mission_current].append(math.hypot(s.truth.v_north_m_s, s.truth.v_east_m_s))

    after(vehicle, 40.0, watch)
    assert min(speeds[1][:10]) > 1.0
    assert speeds[1][-1] < 0.05
    times = {e.value: e.now_us * 1e-6 for e in of_kind(vehicle, EventKind.ITEM_CURRENT) if not e.text}
    arrived = {e.value: e.now_us * 1e-6 for e in of_kind(vehicle, EventKind.ITEM_REACHED)}
    assert times[2] - arrived[1] == pytest.approx(2.0, abs=0.05)


def test_the_reference_moves_without_jumps_all_through_a_mission() -> None:
    vehicle, track = hovering(), []
    square = [item(C.WAYPOINT, (n, e, d)) for n, e, d in ((9, 0, -3), (12, 3, -5), (12, 9, -5), (0, 9, -2), (0, 0, -3))]
    vehicle.mission.replace((*square, item(C.LOITER_TURNS, (2.0, 0.0, -3.0), p1=1.0, p3=2.0)))
    vehicle.commander.start_mission()
    after(vehicle, 80.0, lambda v: track.append(v.snapshot().reference))
    x = np.array(track)
    dt = 0.02
    assert np.abs(np.diff(x[:, 3:6], axis=0) / dt).max() < 2.2  # accelerations, limits 1.2 level and 2 up
    assert np.abs(np.diff(x[:, 6:9], axis=0) / dt).max() < 4.5  # jerks
    assert np.abs(np.diff(x[:, 0:3], axis=0) / dt).max() < 3.2
    assert vehicle.mission.state is MissionState.COMPLETE


@pytest.mark.parametrize("radius_m", [0.01, 0.3, 2.0])
def test_a_waypoint_counts_only_within_its_own_radius(radius_m: float) -> None:
    vehicle = hovering()
    where = []

    def watch(v: Vehicle) -> None:
        if reached(v) and not where:
            where.append(math.dist(place(v), A))

    vehicle.mission.replace((item(C.WAYPOINT, A, p2=radius_m), item(C.WAYPOINT, (15.0, 1.0, -3.0))))
    vehicle.commander.start_mission()
    after(vehicle, 25.0, watch)
    assert where[0] <= radius_m + 0.05
    assert vehicle.mission.state is MissionState.COMPLETE


@pytest.mark.parametrize("command", [C.DELAY, C.CONDITION_DELAY])
def test_a_delay_waits_its_time(command: C) -> None:
    vehicle = flown((item(C.TAKEOFF, UP), item(command, p1=4.0), item(C.WAYPOINT, A)))
    arrived = {e.value: e.now_us * 1e-6 for e in of_kind(vehicle, EventKind.ITEM_REACHED)}
    assert arrived[1] - arrived[0] == pytest.approx(4.0, abs=0.05)


def test_a_loiter_waits_its_time_and_an_unlimited_one_for_ever() -> None:
    vehicle = standing()
    vehicle.mission.replace(
        (item(C.TAKEOFF, UP), item(C.LOITER_TIME, A, p1=3.0), item(C.LOITER_UNLIMITED, B), item(C.LAND, UP))
    )
    vehicle.commander.arm()
    vehicle.commander.start_mission()
    after(vehicle, 120.0)
    assert reached(vehicle) == [0, 1, 2]
    assert (vehicle.mission.state, vehicle.mission.current) == (MissionState.ACTIVE, 2)
    assert place(vehicle) == pytest.approx(B, abs=0.05)
    arrived = {e.value: e.now_us for e in of_kind(vehicle, EventKind.ITEM_REACHED)}
    begun = [e.now_us for e in of_kind(vehicle, EventKind.ITEM_CURRENT) if e.value == 2]
    assert (begun[0] - arrived[1]) * 1e-6 == pytest.approx(3.0, abs=0.05)


@pytest.mark.parametrize(("frame", "sign"), [(Frame.LOCAL_NED, 1.0), (Frame.GLOBAL_RELATIVE_ALT_INT, -1.0)])
def test_turns_are_flown_around_the_centre_in_the_sense_of_the_radius(frame: Frame, sign: float) -> None:
    vehicle, track = hovering(), []
    turns = item(C.LOITER_TURNS, (0.0, 0.0, -3.0), p1=2.0, p3=2.0 * sign, frame=int(frame))
    if frame is not Frame.LOCAL_NED:  # no latitude and longitude: around here
        turns = turns._replace(z=3.0)
    vehicle.mission.replace((turns,))
    vehicle.commander.start_mission()
    wait(vehicle, lambda v: math.hypot(*place(v)[:2]) > 1.9, 20.0)
    after(vehicle, 3.0)
    start = place(vehicle)
    after(vehicle, 60.0, lambda v: track.append(place(v)))
    angles = np.unwrap([math.atan2(e, n) for n, e, _ in track])
    assert sign * (angles[-1] - math.atan2(start[1], start[0])) == pytest.approx(4.0 * math.pi, abs=0.5)
    assert np.hypot(*np.array(track)[:, :2].T) == pytest.approx(2.0, abs=0.1)
    assert reached(vehicle) == [0]


@pytest.mark.parametrize(
    ("yaw", "expected_deg"),
    [(item(C.CONDITION_YAW, p1=90.0, p4=0.0), 90.0), (item(C.CONDITION_YAW, p1=30.0, p3=-1.0, p4=1.0), -30.0)],
)
def test_a_yaw_item_turns_on_the_spot(yaw: MissionItem, expected_deg: float) -> None:
    vehicle = flown((item(C.TAKEOFF, UP), yaw))
    after(vehicle, 2.0)
    assert math.degrees(heading(*vehicle.snapshot().truth[6:10])) == pytest.approx(expected_deg, abs=1.0)
    assert place(vehicle) == pytest.approx(UP, abs=0.1)


def test_a_waypoint_with_a_heading_is_reached_with_it() -> None:
    vehicle = flown((item(C.TAKEOFF, UP), item(C.WAYPOINT, A, p4=45.0)))
    after(vehicle, 2.0)
    assert math.degrees(heading(*vehicle.snapshot().truth[6:10])) == pytest.approx(45.0, abs=1.0)


def test_a_distance_item_waits_until_the_next_place_is_near() -> None:
    plan = (
        item(C.TAKEOFF, UP),
        item(C.CONDITION_DISTANCE, p1=4.0),
        item(C.DO_SET_HOME, p1=1.0),
        item(C.WAYPOINT, (12.0, 0.0, -3.0)),
    )
    vehicle = flown(plan)
    assert reached(vehicle) == [0, 1, 2, 3]
    assert vehicle.commander.home_N[0] == pytest.approx(8.0, abs=0.3)


def test_home_can_be_set_by_an_item() -> None:
    vehicle = flown((item(C.TAKEOFF, UP), item(C.DO_SET_HOME, (7.0, 8.0, 0.0), p1=0.0)))
    assert vehicle.commander.home_N == pytest.approx((7.0, 8.0, 0.0), abs=1e-3)


def test_a_return_item_completes_the_mission_and_goes_home() -> None:
    vehicle = flown((item(C.TAKEOFF, UP), item(C.WAYPOINT, A), item(C.RETURN_TO_LAUNCH), item(C.WAYPOINT, B)))
    assert vehicle.commander.mode is Mode.RETURN
    assert (vehicle.mission.state, reached(vehicle)) == (MissionState.COMPLETE, [0, 1, 2])
    wait(vehicle, lambda v: not v.commander.armed, 40.0)
    assert math.hypot(*place(vehicle)[:2]) < 0.1


def test_items_that_only_concern_others_are_passed_at_once() -> None:
    plan = (
        item(C.DO_LAND_START),
        item(C.DO_SET_ROI_NONE),
        item(C.DO_SET_ROI),
        item(C.DO_SET_ROI_LOCATION, UP),
        item(C.DO_VTOL_TRANSITION, p1=3.0),
        item(C.VTOL_TAKEOFF, UP),
        item(C.VTOL_LAND, UP),
    )
    assert reached(flown(plan)) == [0, 1, 2, 3, 4, 5, 6]


def test_the_speed_of_an_item_holds_until_the_default_is_asked_for() -> None:
    vehicle = standing()
    speeds: dict[int, float] = {}

    def watch(v: Vehicle) -> None:
        s = v.snapshot()
        speeds[s.mission_current] = max(speeds.get(s.mission_current, 0.0), abs(s.truth.v_north_m_s))

    vehicle.mission.replace(
        (
            item(C.TAKEOFF, UP),
            item(C.DO_CHANGE_SPEED, p2=0.8),
            item(C.WAYPOINT, (8.0, 0.0, -3.0), p1=1.0),
            item(C.DO_CHANGE_SPEED, p2=-2.0),
            item(C.WAYPOINT, (-4.0, 0.0, -3.0)),
        )
    )
    vehicle.commander.arm()
    vehicle.commander.start_mission()
    after(vehicle, 50.0, watch)
    assert speeds[2] == pytest.approx(0.8, abs=0.08)
    assert speeds[4] > 1.8


# jumps


def test_a_jump_is_taken_as_often_as_it_says() -> None:
    plan = (
        item(C.TAKEOFF, UP),
        item(C.WAYPOINT, (3.0, 0.0, -3.0)),
        item(C.DO_JUMP, p1=1.0, p2=2.0),
        item(C.WAYPOINT, A),
    )
    assert reached(flown(plan)) == [0, 1, 1, 1, 2, 3]


def test_a_jump_counts_afresh_when_a_complete_mission_is_started_again() -> None:
    plan = (item(C.WAYPOINT, A), item(C.DO_JUMP, p1=0.0, p2=1.0), item(C.WAYPOINT, B))
    vehicle = flown(plan, vehicle=hovering())
    assert vehicle.mission.state is MissionState.COMPLETE
    mark = vehicle.events.next_number
    vehicle.commander.set_mode(Mode.MISSION)
    wait(vehicle, lambda v: v.commander.mode is Mode.HOLD, 60.0)
    assert reached(vehicle, mark) == [0, 0, 1, 2]


def test_the_jumps_of_an_old_plan_do_not_count_in_a_new_one() -> None:
    plan = (item(C.WAYPOINT, A, p1=1.0), item(C.DO_JUMP, p1=0.0, p2=3.0), item(C.WAYPOINT, B))
    vehicle = hovering()
    vehicle.mission.replace(plan)
    vehicle.commander.start_mission()
    wait(vehicle, lambda v: len(reached(v)) == 2, 30.0)
    mark = vehicle.events.next_number
    assert vehicle.mission.replace((plan[0], item(C.DO_JUMP, p1=0.0, p2=1.0), plan[2])) is None
    wait(vehicle, lambda v: v.commander.mode is Mode.HOLD, 60.0)
    assert reached(vehicle, mark) == [0, 0, 1, 2]


def test_jumps_in_a_circle_end_the_mission_instead_of_hanging_the_vehicle() -> None:
    plan = (item(C.DO_JUMP, p1=2.0, p2=-1.0), item(C.WAYPOINT, A), item(C.DO_JUMP, p1=0.0, p2=-1.0))
    vehicle = flown(plan, 5.0, hovering())
    assert "mission ended: it jumps in circles" in texts(vehicle.events)
    assert vehicle.commander.mode is Mode.HOLD
    assert place(vehicle) == pytest.approx(UP, abs=0.1)


# changes while flying


def test_a_plan_replaced_in_flight_is_flown_from_its_first_item() -> None:
    vehicle = hovering()
    vehicle.mission.replace((item(C.WAYPOINT, A), item(C.WAYPOINT, B)))
    vehicle.commander.start_mission()
    after(vehicle, 2.0)
    mark = vehicle.events.next_number
    vehicle.mission.replace((item(C.WAYPOINT, (-3.0, 0.0, -3.0)), item(C.WAYPOINT, (-3.0, -3.0, -3.0))))
    after(vehicle, 0.1)
    assert (vehicle.mission.state, vehicle.mission.current) == (MissionState.ACTIVE, 0)
    wait(vehicle, lambda v: v.commander.mode is Mode.HOLD, 40.0)
    assert reached(vehicle, mark) == [0, 1]
    assert place(vehicle) == pytest.approx((-3.0, -3.0, -3.0), abs=0.1)


def test_a_plan_cleared_in_flight_leads_to_hold() -> None:
    vehicle = hovering()
    vehicle.mission.replace((item(C.WAYPOINT, A),))
    vehicle.commander.start_mission()
    after(vehicle, 2.0)
    assert vehicle.mission.clear() is None
    after(vehicle, 0.1)
    assert (vehicle.commander.mode, vehicle.mission.state) == (Mode.HOLD, MissionState.NO_MISSION)
    assert vehicle.mission.current == 0
    after(vehicle, 5.0)
    assert vehicle.commander.armed


def test_another_item_can_be_made_current_in_flight_and_from_the_start() -> None:
    vehicle = hovering()
    vehicle.mission.replace((item(C.WAYPOINT, A), item(C.LOITER_TIME, B, p1=60.0), item(C.WAYPOINT, UP)))
    assert vehicle.commander.start_mission(1).ok
    wait(vehicle, lambda v: reached(v) == [1], 30.0)
    assert vehicle.mission.set_current(2).ok
    wait(vehicle, lambda v: v.commander.mode is Mode.HOLD, 30.0)
    assert reached(vehicle) == [1, 2]
    assert not vehicle.commander.start_mission(3).ok


def test_an_item_without_autocontinue_waits_for_someone_to_go_on() -> None:
    vehicle = hovering()
    vehicle.mission.replace((item(C.WAYPOINT, A, autocontinue=0), item(C.WAYPOINT, B)))
    vehicle.commander.start_mission()
    after(vehicle, 30.0)
    assert (reached(vehicle), vehicle.mission.current) == ([0], 0)
    vehicle.mission.set_current(1)
    wait(vehicle, lambda v: v.commander.mode is Mode.HOLD, 30.0)


# items beyond the plain ones


def test_loiter_to_altitude_goes_to_its_place_and_height_and_keeps_the_heading() -> None:
    vehicle = hovering()
    flown((item(C.LOITER_TO_ALT, (4.0, 3.0, -6.0), p1=1.0, p4=1.0),), vehicle=vehicle)
    assert place(vehicle) == pytest.approx((4.0, 3.0, -6.0), abs=0.3)
    assert heading_of(vehicle) == pytest.approx(0.0, abs=0.02)


def heading_of(vehicle: Vehicle) -> float:
    n = vehicle.snapshot().nav
    return heading(n.qw, n.qx, n.qy, n.qz)


def test_the_exit_flag_of_a_loiter_is_no_heading() -> None:
    vehicle = hovering()
    flown((item(C.LOITER_TIME, (2.0, 0.0, -3.0), p1=1.0, p4=1.0),), vehicle=vehicle)
    assert heading_of(vehicle) == pytest.approx(0.0, abs=0.01)


def flown_corner(command: C) -> tuple[float, float]:
    """Least speed near the corner of a right angle, and how far from it the vehicle passes."""
    plan = (item(command, (10.0, 0.0, -3.0)), item(C.WAYPOINT, (10.0, 10.0, -3.0)))
    vehicle = hovering()
    assert vehicle.mission.replace(plan) is None
    assert vehicle.commander.start_mission().ok
    slowest, nearest = math.inf, math.inf

    def watch(v: Vehicle) -> None:
        nonlocal slowest, nearest
        n, e, _ = place(v)
        nearest = min(nearest, math.hypot(n - 10.0, e))
        if math.hypot(n - 10.0, e) < 2.0:
            s = v.snapshot().nav
            slowest = min(slowest, math.hypot(s.v_north_m_s, s.v_east_m_s))

    after(vehicle, 25.0, watch)
    assert place(vehicle)[:2] == pytest.approx((10.0, 10.0), abs=0.3)
    return slowest, nearest


def test_a_spline_takes_a_corner_at_speed_where_straight_legs_all_but_stop() -> None:
    straight, spline = flown_corner(C.WAYPOINT), flown_corner(C.SPLINE_WAYPOINT)
    assert straight[0] < 0.6
    assert spline[0] > 1.0
    assert spline[1] < 0.5


def test_a_turn_item_goes_its_way_at_its_rate() -> None:
    vehicle = hovering()
    plan = (item(C.CONDITION_YAW, p1=90.0, p2=30.0, p3=-1.0, p4=0.0), item(C.DELAY, p1=1.0))
    assert vehicle.mission.replace(plan) is None
    assert vehicle.commander.start_mission().ok
    turned, last = 0.0, heading_of(vehicle)

    def watch(v: Vehicle) -> None:
        nonlocal turned, last
        turned, last = turned + wrap_pi(heading_of(v) - last), heading_of(v)
        assert abs(v.snapshot().reference.heading_rate_rad_s) < math.radians(31.5)

    after(vehicle, 19.0, watch)
    assert math.degrees(turned) == pytest.approx(-270.0, abs=2.0)


def test_a_transition_to_forward_flight_is_refused_and_says_that_there_is_none() -> None:
    fault = standing().mission.replace((item(C.DO_VTOL_TRANSITION, p1=4.0),))
    assert (fault.index, fault.field) == (0, "param1")
    assert "no forward flight" in fault.reason


@pytest.mark.parametrize("mode", [1.0, 2.0, 4.0])
def test_only_a_location_can_be_faced(mode: float) -> None:
    fault = standing().mission.replace((item(C.DO_SET_ROI, (1.0, 1.0, -1.0), p1=mode, p4=0.0),))
    assert (fault.index, fault.field) == (0, "param1")
