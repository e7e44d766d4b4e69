"""What the commander allows, and what it does when something ends a mode."""

import math

import pytest
from onboard_flights import NAN, SPECS, after, hovering, item, of_kind, place, standing, stream, texts, wait

from sitl.control.guidance import Effort
from sitl.frames import heading, wrap_pi
from sitl.geodesy import GeoPoint, to_global
from sitl.onboard import arming
from sitl.onboard.commander import AFTER, ENTRY, Happening
from sitl.onboard.gaze import Look
from sitl.onboard.mission import MissionState
from sitl.onboard.mission_items import ItemCommand as C
from sitl.onboard.modes import EventKind, Landed, Mode, Verdict
from sitl.onboard.offboard import OffboardTarget
from sitl.onboard.transitions import Choice
from sitl.vehicle import Vehicle

HERE = OffboardTarget(None, position_N=(0.0, 0.0, -3.0))
PLAN = (item(C.TAKEOFF, (0.0, 0.0, -3.0)), item(C.WAYPOINT, (6.0, 0.0, -3.0)), item(C.WAYPOINT, (6.0, 6.0, -3.0)))


def brought_into(vehicle: Vehicle, mode: Mode) -> None:
    """A hovering vehicle in any mode."""
    c = vehicle.commander
    if mode is Mode.MISSION:
        assert vehicle.mission.replace(PLAN[1:]) is None
    if mode is Mode.OFFBOARD:
        stream(vehicle, HERE, 1.2)
    if mode is Mode.ORBIT:
        assert c.guided.orbit((3.0, 0.0, -3.0), 3.0, None, Look.POINT, 6.0).ok
    if mode is Mode.TAKEOFF:
        assert c.takeoff(c.origin.alt_amsl_m + 8.0).ok
    else:
        assert c.set_mode(mode).ok
    vehicle.advance(vehicle.now_us + 100_000)
    assert c.mode is mode


# entry


@pytest.mark.parametrize("mode", [mode for mode, conditions in ENTRY.items() if not conditions])
def test_a_mode_without_conditions_is_entered_on_request(mode: Mode) -> None:
    vehicle = standing()
    assert vehicle.commander.set_mode(mode).ok
    assert vehicle.commander.mode is mode


@pytest.mark.parametrize(
    ("mode", "verdict", "reason"),
    [
        (Mode.MISSION, Verdict.TEMPORARILY_REJECTED, "there is no mission"),
        (Mode.OFFBOARD, Verdict.DENIED, "no target in the last 0.5 s"),
    ],
)
def test_a_mode_whose_condition_fails_is_refused_for_that_reason(mode: Mode, verdict: Verdict, reason: str) -> None:
    vehicle = standing()
    assert ENTRY[mode]
    outcome = vehicle.commander.set_mode(mode)
    assert (outcome.verdict, outcome.reason) == (verdict, reason)
    assert vehicle.commander.mode is Mode.HOLD
    assert texts(vehicle.events)[-1] == f"{mode.value} refused: {reason}"


@pytest.mark.parametrize("mode", [mode for mode, conditions in ENTRY.items() if conditions])
def test_a_mode_whose_conditions_hold_is_entered(mode: Mode) -> None:
    brought_into(hovering(), mode)


def test_every_mode_has_its_row_in_the_entry_table() -> None:
    assert set(ENTRY) == set(Mode)


# what follows


def provoke(vehicle: Vehicle, mode: Mode, happening: Happening) -> None:
    """Make something happen to a vehicle that hovers in a mode."""
    c = vehicle.commander
    if happening is Happening.STATIONS_LOST:
        c.link_lost(True)
    elif happening is Happening.TARGETS_LOST:
        after(vehicle, 0.7)
    elif happening is Happening.STICKS_LOST:
        c.manual(0.5, 0.0, 0.0, 0.0)
        after(vehicle, 0.7)
    elif happening is Happening.DISARMED:
        c.disarm(force=True)
    elif happening is Happening.HEIGHT_REACHED:
        wait(vehicle, lambda v: c.mode is not mode, 20.0)
    elif happening is Happening.MISSION_COMPLETE:
        vehicle.mission.set_current(1)
        wait(vehicle, lambda v: c.mode is not mode, 30.0)
    elif happening is Happening.RETURN_ITEM:
        vehicle.mission.replace((item(C.RETURN_TO_LAUNCH),))
        after(vehicle, 0.1)
    elif happening is Happening.ORBIT_COMPLETE:
        wait(vehicle, lambda v: c.mode is not mode, 60.0)
    elif happening is Happening.MISSION_OUTSIDE:
        assert vehicle.parameters.set("GF_MAX_HOR_DIST", 5.0) is None
        after(vehicle, 0.1)
    elif happening is Happening.FENCE_BREACHED:
        assert vehicle.parameters.set("GF_MAX_VER_DIST", 1.0) is None
        after(vehicle, 0.1)
    elif happening is Happening.BATTERY_CRITICAL:
        assert vehicle.parameters.set("BAT_CRIT_THR", 1.0) is None
        after(vehicle, 0.1)
    elif happening is Happening.BATTERY_EMERGENCY:
        assert vehicle.parameters.set("BAT_EMERGEN_THR", 1.0) is None
        after(vehicle, 0.1)


FIXED = [(mode, happening, follows) for (mode, happening), follows in AFTER.items() if isinstance(follows, Mode)]
CHOSEN = [
    (mode, happening, choice.parameter, number, chosen)
    for (mode, happening), choice in AFTER.items()
    if isinstance(choice, Choice)
    for number, chosen in choice.modes.items()
]


@pytest.mark.parametrize(("mode", "happening", "follows"), FIXED)
def test_what_ends_a_mode_leads_where_the_table_points(mode: Mode, happening: Happening, follows: Mode) -> None:
    vehicle = hovering()
    brought_into(vehicle, mode)
    provoke(vehicle, mode, happening)
    assert vehicle.commander.mode is follows
    told = texts(vehicle.events)
    assert any(text.startswith(happening.value) and text.endswith(f": {follows.value}") for text in told), told


@pytest.mark.parametrize(("mode", "happening", "parameter", "number", "follows"), CHOSEN)
def test_what_is_lost_leads_where_the_parameter_points(
    mode: Mode, happening: Happening, parameter: str, number: int, follows: Mode
) -> None:
    vehicle = hovering(overrides={parameter: number})
    brought_into(vehicle, mode)
    provoke(vehicle, mode, happening)
    assert vehicle.commander.mode is follows
    assert vehicle.commander.failsafe == happening.value


def test_the_actions_are_those_that_the_parameters_declare() -> None:
    vehicle = standing()
    for choice in {id(c): c for c in AFTER.values() if isinstance(c, Choice)}.values():
        values = dict(vehicle.parameters.declaration(choice.parameter).values)
        for number, text in values.items():
            assert (text.lower() in ("none", "warning", "terminate")) == (number not in choice.modes)
            assert number not in choice.modes or choice.modes[number].value in text.lower()


@pytest.mark.parametrize("mode", [Mode.LAND, Mode.RETURN])
def test_a_vehicle_on_its_way_down_goes_on_when_the_stations_fall_silent(mode: Mode) -> None:
    vehicle = hovering(overrides={"NAV_DLL_ACT": 1})
    brought_into(vehicle, mode)
    vehicle.commander.link_lost(True)
    assert vehicle.commander.mode is mode


def test_without_an_action_silent_stations_change_nothing_and_a_station_that_is_back_ends_the_failsafe() -> None:
    vehicle = hovering()
    vehicle.commander.link_lost(True)
    assert (vehicle.commander.mode, vehicle.commander.failsafe) == (Mode.HOLD, "")
    vehicle = hovering(overrides={"NAV_DLL_ACT": 3})
    vehicle.commander.link_lost(True)
    assert vehicle.commander.failsafe == "ground stations lost"
    vehicle.commander.link_lost(False)
    assert vehicle.commander.failsafe == ""
    assert vehicle.commander.mode is Mode.LAND


# arming


@pytest.mark.parametrize(
    ("condition", "reason"),
    [
        (arming.Condition(False, True, False, False, True), "the mode is to land or to return: choose another"),
        (arming.Condition(False, True, False, True), "flight was terminated: reboot first"),
        (arming.Condition(True, True, False, False), "the vehicle has tipped over"),
        (arming.Condition(False, True, True, False), "the vehicle is moving"),
        (arming.Condition(False, False, False, False), "the vehicle does not stand on its feet"),
    ],
)
def test_each_prearm_check_refuses_with_its_own_reason(condition: arming.Condition, reason: str) -> None:
    outcome = arming.check(condition)
    assert (outcome.verdict, outcome.reason) == (Verdict.TEMPORARILY_REJECTED, reason)


def test_a_standing_vehicle_arms_idles_and_disarms() -> None:
    vehicle = standing()
    c = vehicle.commander
    assert c.arm().ok
    assert c.arm().ok
    after(vehicle, 0.1)
    assert (c.armed, c.guidance.effort, c.landed) == (True, Effort.IDLE, Landed.ON_GROUND)
    assert c.disarm().ok
    assert c.disarm().ok
    after(vehicle, 0.1)
    assert c.guidance.effort == Effort.OFF
    assert [e.value for e in of_kind(vehicle, EventKind.ARMED)] == [1, 0]


def test_disarming_in_the_air_is_refused_unless_forced() -> None:
    vehicle = hovering()
    outcome = vehicle.commander.disarm()
    assert (outcome.verdict, outcome.reason) == (Verdict.TEMPORARILY_REJECTED, "disarming refused: in the air")
    assert vehicle.commander.armed
    assert vehicle.commander.disarm(force=True).ok
    assert not vehicle.commander.armed
    after(vehicle, 3.0)
    assert vehicle.commander.landed is Landed.ON_GROUND


def test_termination_stops_the_motors_for_good_until_a_restart() -> None:
    vehicle = hovering()
    c = vehicle.commander
    vehicle.mission.replace(PLAN)
    c.set_mode(Mode.MISSION)
    assert c.terminate().ok
    assert not c.armed
    assert c.failsafe == "flight terminated"
    after(vehicle, 3.0)
    for force in (False, True):
        assert c.arm(force).reason == "flight was terminated: reboot first"
    assert c.reboot().ok
    vehicle.reset()
    assert c.arm().ok


def test_a_vehicle_that_falls_over_says_so_stops_and_cannot_be_armed() -> None:
    vehicle = hovering(1.0)
    c = vehicle.commander
    c.disarm(force=True)
    tilted = vehicle.loop.state._replace(q_rad_s=3.0, v_north_m_s=1.0)
    vehicle.loop = vehicle.loop._replace(state=tilted)
    after(vehicle, 6.0)
    assert c.tipped_over
    assert "the vehicle has tipped over: motors stopped" in texts(vehicle.events)
    assert c.ready_to_arm().reason == "the vehicle has tipped over"
    assert not c.arm().ok


def test_a_reboot_is_refused_while_armed() -> None:
    vehicle = standing()
    assert vehicle.commander.reboot().ok
    vehicle.commander.arm()
    assert vehicle.commander.reboot().reason == "reboot refused: armed"


@pytest.mark.parametrize("seed", [1, 2])
def test_a_noisy_vehicle_stands_armed_for_two_minutes_without_lifting_off(seed: int) -> None:
    vehicle = standing("yawsitter-real", seed=seed)
    assert vehicle.commander.arm().ok
    after(vehicle, 120.0)
    assert vehicle.commander.armed
    assert vehicle.commander.landed is Landed.ON_GROUND
    assert [e.text for e in of_kind(vehicle, EventKind.LANDED)] == []


# taking off, landing, returning


def test_a_take_off_may_be_asked_for_before_arming() -> None:
    vehicle = standing()
    c = vehicle.commander
    assert c.takeoff(heading_rad=1.0).ok
    assert c.arm().ok
    wait(vehicle, lambda v: c.mode is Mode.HOLD, 20.0)
    after(vehicle, 2.0)
    assert place(vehicle)[2] == pytest.approx(-2.5, abs=0.05)
    t = vehicle.snapshot().truth
    assert heading(t.qw, t.qx, t.qy, t.qz) == pytest.approx(1.0, abs=0.02)
    landed = [e.text for e in of_kind(vehicle, EventKind.LANDED)]
    assert landed == ["taking off", "in air"]


@pytest.mark.parametrize("height_m", [0.1, -5.0, 1001.0])
def test_a_take_off_to_no_sensible_height_is_denied(height_m: float) -> None:
    vehicle = standing()
    outcome = vehicle.commander.takeoff(vehicle.commander.origin.alt_amsl_m + height_m)
    assert outcome.verdict is Verdict.DENIED
    assert "AMSL is outside" in outcome.reason
    assert vehicle.commander.mode is Mode.HOLD


def test_a_take_off_climbs_even_where_home_lies_lower_than_the_vehicle() -> None:
    vehicle = standing()
    c = vehicle.commander
    assert c.set_home(c.origin._replace(alt_amsl_m=c.origin.alt_amsl_m - 50.0)).ok
    c.takeoff()
    c.arm()
    wait(vehicle, lambda v: c.mode is Mode.HOLD, 20.0)
    assert place(vehicle)[2] == pytest.approx(-0.5, abs=0.05)


@pytest.mark.parametrize("name", sorted(SPECS))
def test_a_landing_ends_disarmed_in_hold_and_stays_there(name: str) -> None:
    vehicle = hovering(name=name)
    c = vehicle.commander
    assert c.land().ok
    wait(vehicle, lambda v: c.landed is Landed.ON_GROUND, 30.0)
    touched = vehicle.now_us
    assert c.armed
    wait(vehicle, lambda v: not c.armed, 5.0)
    assert (vehicle.now_us - touched) * 1e-6 == pytest.approx(2.0, abs=0.2)
    after(vehicle, 20.0)
    assert (c.mode, c.armed, c.landed) == (Mode.HOLD, False, Landed.ON_GROUND)
    assert len(of_kind(vehicle, EventKind.ARMED)) == 2


@pytest.mark.parametrize("mode", [Mode.LAND, Mode.RETURN])
def test_a_landing_begun_while_standing_only_disarms_in_its_time(mode: Mode) -> None:
    vehicle = standing("yawsitter-real")
    c = vehicle.commander
    c.arm()
    after(vehicle, 10.0)
    assert c.set_mode(mode).ok
    after(vehicle, 1.5)
    assert c.armed
    after(vehicle, 1.0)
    assert (c.mode, c.armed) == (Mode.HOLD, False)
    assert of_kind(vehicle, EventKind.LANDED) == []


def test_a_return_climbs_crosses_and_lands_at_home() -> None:
    vehicle = hovering()
    c = vehicle.commander
    c.guided.reposition((12.0, 5.0, NAN))
    after(vehicle, 15.0)
    highest = []
    c.return_home()
    after(vehicle, 40.0, lambda v: highest.append(place(v)[2]))
    assert min(highest) == pytest.approx(-5.0, abs=0.1)
    assert not c.armed
    assert math.hypot(*place(vehicle)[:2]) < 0.1


def test_a_return_from_close_by_still_lands_on_home_itself_without_climbing() -> None:
    vehicle = hovering()
    vehicle.commander.guided.reposition((0.8, 0.0, NAN))
    after(vehicle, 6.0)
    highest = []
    vehicle.commander.return_home()
    after(vehicle, 25.0, lambda v: highest.append(place(v)[2]))
    assert min(highest) > -3.1
    assert not vehicle.commander.armed
    assert math.hypot(*place(vehicle)[:2]) < 0.1


def test_a_landing_begun_at_speed_brakes_on_the_way_down() -> None:
    vehicle = hovering(8.0)
    vehicle.commander.guided.reposition((40.0, 0.0, NAN))
    after(vehicle, 9.0)
    begun = place(vehicle)[0]
    furthest = []
    vehicle.commander.land()
    after(vehicle, 30.0, lambda v: furthest.append(place(v)[0]))
    assert not vehicle.commander.armed
    assert max(furthest) - begun < 6.0
    assert place(vehicle)[0] == pytest.approx(max(furthest), abs=0.1)


# reposition, speed, home, sticks


def test_a_reposition_keeps_what_is_not_given_and_turns_the_short_way() -> None:
    vehicle = hovering()
    c = vehicle.commander
    assert c.guided.reposition((NAN, 4.0, NAN), heading_rad=-3.0).ok
    after(vehicle, 15.0)
    assert place(vehicle) == pytest.approx((0.0, 4.0, -3.0), abs=0.05)
    assert c.guided.reposition((NAN, NAN, NAN), heading_rad=3.0).ok
    headings = []
    after(vehicle, 5.0, lambda v: headings.append(heading(*v.snapshot().truth[6:10])))
    assert min(abs(h) for h in headings) > 2.9
    assert wrap_pi(headings[-1] - 3.0) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(("down_m", "reason"), [(-0.1, "lower than 0.2 m"), (2.0, "lower"), (-2e5, "100 km")])
def test_a_reposition_into_the_ground_or_out_of_sight_is_denied(down_m: float, reason: str) -> None:
    vehicle = hovering()
    outcome = vehicle.commander.guided.reposition((0.0, 0.0, down_m))
    assert outcome.verdict is Verdict.DENIED
    assert reason in outcome.reason


def test_a_reposition_needs_a_flying_vehicle() -> None:
    vehicle = standing()
    assert vehicle.commander.guided.reposition((1.0, 0.0, -3.0)).verdict is Verdict.TEMPORARILY_REJECTED


@pytest.mark.parametrize("speed", [0.0, -1.0, 100.0, NAN, math.inf])
def test_a_speed_that_cannot_be_flown_is_denied(speed: float) -> None:
    assert hovering().commander.change_speed(speed).verdict is Verdict.DENIED


def test_a_changed_speed_holds_until_the_mode_is_left() -> None:
    vehicle = hovering()
    c, speeds = vehicle.commander, []
    vehicle.mission.replace((item(C.WAYPOINT, (0.0, 12.0, -3.0)),))
    c.set_mode(Mode.MISSION)
    assert c.change_speed(1.0).ok
    c.set_mode(Mode.MISSION)
    after(vehicle, 25.0, lambda v: speeds.append(math.hypot(*v.snapshot().truth[3:5])))
    assert max(speeds) == pytest.approx(1.0, abs=0.1)
    speeds.clear()
    c.guided.reposition((0.0, 0.0, NAN))
    after(vehicle, 15.0, lambda v: speeds.append(math.hypot(*v.snapshot().truth[3:5])))
    assert max(speeds) > 1.8


def test_home_moves_here_or_to_a_point_and_not_off_the_earth() -> None:
    vehicle = hovering()
    c = vehicle.commander
    assert c.set_home(None).ok
    assert c.home_N == pytest.approx((0.0, 0.0, -3.0), abs=0.1)
    lat, lon = to_global(c.origin, 30.0, -20.0)
    assert c.set_home(GeoPoint(lat, lon, c.origin.alt_amsl_m + 4.0), heading_rad=0.5).ok
    assert c.home_N == pytest.approx((30.0, -20.0, -4.0), abs=1e-3)
    assert c.home_heading_rad == 0.5
    assert len(of_kind(vehicle, EventKind.HOME)) == 2
    for bad in (
        GeoPoint(91.0, 0.0, 0.0),
        GeoPoint(NAN, 0.0, 0.0),
        GeoPoint(0.0, 0.0, 0.0),
        GeoPoint(lat, lon, math.inf),
    ):
        assert c.set_home(bad).verdict is Verdict.DENIED
    assert c.home_N == pytest.approx((30.0, -20.0, -4.0), abs=1e-3)


def test_sticks_fly_in_position_mode_and_centred_sticks_halt() -> None:
    vehicle = hovering()
    c = vehicle.commander
    c.set_mode(Mode.POSITION)

    def held(x: float, y: float, z: float, r: float, seconds: float) -> None:
        until = vehicle.now_us + round(seconds * 1e6)
        while vehicle.now_us < until:
            c.manual(x, y, z, r)
            vehicle.advance(vehicle.now_us + 100_000)

    held(0.5, 0.0, 0.5, 0.0, 4.0)
    held(0.0, 0.0, 0.0, 0.0, 5.0)
    north, east, down = place(vehicle)
    assert north > 3.0
    assert abs(east) < 0.1
    assert down < -5.0
    held(0.0, 0.0, 0.0, 1.0, 3.0)
    held(0.0, 0.0, 0.0, 0.0, 3.0)
    assert 1.5 < heading(*vehicle.snapshot().truth[6:10]) < 3.0
    assert place(vehicle) == pytest.approx((north, east, down), abs=0.1)


def test_sticks_lift_a_standing_vehicle_off_only_with_a_climb() -> None:
    vehicle = standing("yawsitter-real")
    c = vehicle.commander
    c.set_mode(Mode.POSITION)
    c.arm()
    for _ in range(50):
        c.manual(1.0, 0.0, -1.0, 0.5)
        vehicle.advance(vehicle.now_us + 100_000)
    assert c.landed is Landed.ON_GROUND
    for _ in range(20):
        c.manual(0.0, 0.0, 0.6, 0.0)
        vehicle.advance(vehicle.now_us + 100_000)
    assert c.landed is Landed.IN_AIR
    assert place(vehicle)[2] < -0.3


def test_sticks_that_fall_silent_lead_to_hold() -> None:
    vehicle = hovering()
    c = vehicle.commander
    c.set_mode(Mode.POSITION)
    after(vehicle, 5.0)
    assert c.mode is Mode.POSITION  # sticks that were never used can't be lost
    c.manual(0.5, 0.0, 0.0, 0.0)
    c.manual(NAN, 0.0, 0.0, 0.0)
    after(vehicle, 0.4)
    assert c.mode is Mode.POSITION
    after(vehicle, 0.3)
    assert (c.mode, c.failsafe) == (Mode.HOLD, "stick input lost")


def test_a_mission_that_is_left_pauses_and_one_that_is_taken_up_again_goes_on() -> None:
    vehicle = hovering()
    brought_into(vehicle, Mode.MISSION)
    wait(vehicle, lambda v: v.mission.current == 1, 20.0)
    vehicle.commander.hold()
    assert (vehicle.mission.state, vehicle.mission.current) == (MissionState.PAUSED, 1)
    after(vehicle, 2.0)
    assert vehicle.commander.set_mode(Mode.MISSION).ok
    assert vehicle.mission.state is MissionState.ACTIVE
    wait(vehicle, lambda v: v.commander.mode is Mode.HOLD, 30.0)
    assert vehicle.mission.state is MissionState.COMPLETE
    assert place(vehicle) == pytest.approx((6.0, 6.0, -3.0), abs=0.1)
