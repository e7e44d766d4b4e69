"""The messages: every value in its unit, and the conversions that the documentation gives to viewers."""

import json
import math
from typing import NamedTuple

import numpy as np
import pytest

from sitl.control.cascade import Command
from sitl.control.reference import Reference
from sitl.frames import quaternion_from_yxz, standing
from sitl.geodesy import GeoPoint
from sitl.model.rigid_body import State
from sitl.navigation import NavState
from sitl.onboard.fence import FenceCommand
from sitl.onboard.mission import MissionState
from sitl.onboard.mission_items import ItemCommand
from sitl.onboard.modes import Event, EventKind, Landed, Mode, Severity
from sitl.onboard.plan import Frame, MissionItem
from sitl.onboard.plans import Plans
from sitl.quaternion import rotate
from sitl.snapshot import Battery, Snapshot
from sitl.telemetry import keys, messages
from sitl.vehicle import Vehicle, load_vehicle

PHI, THETA, PSI = math.radians(10.0), math.radians(95.0), math.radians(-5.0)
Q = quaternion_from_yxz(PHI, THETA, PSI)


class Load(NamedTuple):
    force_B: tuple[float, float, float]
    moment_B: tuple[float, float, float]


@pytest.fixture
def snapshot() -> Snapshot:
    return Snapshot(
        now_us=1_234_000,
        truth=State(1.0, 2.0, -3.0, 0.1, 0.2, -0.3, *Q, 0.4, 0.5, 0.6, 600.0, -610.0, 0.1, -0.2),
        nav=NavState(1.1, 2.1, -3.1, 0.11, 0.21, -0.31, 1.0, 0.0, 0.0, 0.0, 0.41, 0.51, 0.61),
        acceleration_B=(9.8, 0.0, 0.1),
        acceleration_N=(0.01, 0.02, 0.03),
        wind_N=(1.0, -1.0, 0.0),
        reference=Reference(5.0, 6.0, -7.0, 0.5, 0.6, 0.7, 0.05, 0.06, 0.07, 0.0, 0.0, 0.0, math.pi / 2, 0.1),
        command=Command(*Q, 0.01, 0.02, 0.03, 5.5, 5.6, 0.3, -0.4, 0.7, 0.8, 0.9, 1.0),
        feet_down=2,
        mode=Mode.OFFBOARD,
        armed=True,
        landed=Landed.IN_AIR,
        tipped_over=False,
        failsafe="",
        ready_to_arm=True,
        origin=GeoPoint(47.0, 8.0, 400.0),
        home=GeoPoint(47.0, 8.0, 401.0),
        home_N=(0.0, 0.0, -1.0),
        home_heading_rad=math.pi,
        mission_state=MissionState.NOT_STARTED,
        mission_current=1,
        mission_total=4,
        plan_id=99,
        battery=Battery(12.0, 3.0, 0.9, 200.0),
    )


def test_state_is_the_truth_and_the_belief_beside_it(snapshot) -> None:
    m = messages.state(snapshot)
    assert m.position_N_m == (1.0, 2.0, -3.0)
    assert m.nav_position_N_m == (1.1, 2.1, -3.1)
    assert m.velocity_N_m_s == (0.1, 0.2, -0.3)
    assert m.wind_N_m_s == (1.0, -1.0, 0.0)
    assert m.alt_amsl_m == pytest.approx(403.0)
    assert (m.lat_deg - 47.0) * math.radians(1.0) * 6_371_000.0 == pytest.approx(1.0, abs=1e-6)
    assert m.lon_deg > 8.0


def test_attitude_is_in_the_paper_s_angles_in_degrees(snapshot) -> None:
    m = messages.attitude(snapshot)
    assert (m.phi_deg, m.theta_deg, m.psi_deg) == pytest.approx((10.0, 95.0, -5.0))
    assert m.q_NB == Q
    assert m.rates_B_rad_s == (0.4, 0.5, 0.6)
    assert m.nav_q_NB == (1.0, 0.0, 0.0, 0.0)


def test_heading_is_where_the_belly_faces(snapshot) -> None:
    east = standing(math.pi / 2, math.pi / 2)
    truth = snapshot.truth._replace(qw=east[0], qx=east[1], qy=east[2], qz=east[3])
    assert messages.attitude(snapshot._replace(truth=truth)).heading_deg == pytest.approx(90.0)


def test_setpoint_holds_reference_and_inner_targets(snapshot) -> None:
    m = messages.setpoint(snapshot)
    assert m.position_N_m == (5.0, 6.0, -7.0)
    assert m.acceleration_N_m_s2 == (0.05, 0.06, 0.07)
    assert m.heading_deg == pytest.approx(90.0)
    assert m.heading_rate_deg_s == pytest.approx(math.degrees(0.1))
    assert m.velocity_command_N_m_s == (0.7, 0.8, 0.9)
    assert (m.phi_command_deg, m.theta_command_deg, m.psi_command_deg) == pytest.approx((10.0, 95.0, -5.0))
    assert m.saturated is True


def test_actuators_are_in_newton_rpm_and_degrees(snapshot) -> None:
    m = messages.actuators(snapshot)
    assert (m.thrust_left_command_N, m.thrust_right_command_N) == (5.5, 5.6)
    assert m.rotor_left_rpm == pytest.approx(600.0 * 30.0 / math.pi)
    assert m.rotor_right_rpm == pytest.approx(-610.0 * 30.0 / math.pi)
    assert (m.flap_left_deg, m.flap_right_deg) == pytest.approx((math.degrees(0.1), math.degrees(-0.2)))
    assert m.flap_left_command_deg == pytest.approx(math.degrees(0.3))


def test_loads_are_kept_by_cause_and_summed() -> None:
    causes = {"thrust": Load((10.0, 0.0, 0.0), (0.0, 0.0, 0.1)), "aero": Load((-1.0, 0.5, 2.0), (0.0, 0.2, 0.0))}
    m = messages.loads(7, causes)
    assert m.causes["aero"].moment_B_N_m == (0.0, 0.2, 0.0)
    assert m.total.force_B_N == (9.0, 0.5, 2.0)
    assert m.total.moment_B_N_m == (0.0, 0.2, 0.1)


def test_mode_is_in_plain_words(snapshot) -> None:
    m = messages.mode(snapshot, 10.0, False)
    assert (m.mode, m.landed, m.mission_state) == ("offboard", "in air", "not started")
    assert (m.speed_factor, m.paused) == (10.0, False)
    assert m.home_heading_deg == pytest.approx(180.0)


def test_an_event_keeps_its_number(snapshot) -> None:
    m = messages.event(Event(5, 10, EventKind.ARMED, Severity.NOTICE, "armed", 1))
    assert json.loads(messages.encode(m)) == {
        "number": 5, "now_us": 10, "kind": "armed", "severity": 5, "text": "armed", "value": 1,
    }  # fmt: skip


@pytest.mark.parametrize("build", [messages.state, messages.attitude, messages.setpoint, messages.actuators])
def test_every_message_is_json_with_the_simulation_time(snapshot, build) -> None:
    assert json.loads(messages.encode(build(snapshot)))["now_us"] == 1_234_000


def test_a_number_that_does_not_exist_is_null_on_the_wire(snapshot) -> None:
    lost = snapshot._replace(wind_N=(math.nan, math.inf, 0.0))
    assert json.loads(messages.encode(messages.state(lost)))["wind_N_m_s"] == [None, None, 0.0]


def test_any_change_of_standing_triggers_the_mode_message_and_motion_does_not(snapshot) -> None:
    trigger = messages.mode_trigger(snapshot)
    assert messages.mode_trigger(snapshot._replace(now_us=2, wind_N=(9.0, 9.0, 9.0), feet_down=0)) == trigger
    for change in ({"armed": False}, {"mode": Mode.LAND}, {"failsafe": "link"}, {"mission_current": 2}):
        assert messages.mode_trigger(snapshot._replace(**change)) != trigger


def test_the_description_names_every_topic() -> None:
    m = messages.description({"name": "x"}, 3, 50.0)
    assert set(m["topics"]) == {topic.name for topic in keys.TOPICS}
    assert m["vehicle"] == {"name": "x"}
    json.loads(messages.encode(m))


# the conversions of docs/telemetry.md, checked on rotated vectors: converting a rotated vector must give the same as
# rotating the converted vector by the converted quaternion


def _rotated(q_xyzw, v):
    """v turned by a quaternion in Unity's and three.js' formula, which is the same for both hands."""
    x, y, z, w = q_xyzw
    r = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    return r @ np.array(v)


def test_the_documented_conversion_to_unity_keeps_rotations() -> None:
    def vector(v):
        return v[1], -v[2], v[0]

    w, x, y, z = Q
    for v in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.3, -0.7, 2.0)):
        assert _rotated((-y, z, -x, w), vector(v)) == pytest.approx(vector(rotate(Q, v)))


def test_the_documented_conversion_to_three_js_keeps_rotations() -> None:
    def vector(v):
        return v[1], -v[2], -v[0]

    w, x, y, z = Q
    for v in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.3, -0.7, 2.0)):
        assert _rotated((y, -z, -x, w), vector(v)) == pytest.approx(vector(rotate(Q, v)))


def stored_plans() -> Plans:
    """Of a vehicle that has none yet."""
    return Vehicle(load_vehicle("yawsitter"), home=GeoPoint(55.0, 37.0, 190.0)).plans


def test_the_fences_areas_and_the_rally_points_are_told_with_the_mission_whatever_frame_they_came_in() -> None:
    plans = stored_plans()
    rest = 0, 1, 3.0, 1.0, 0.0, 0.0
    triangle = [(550001000, 370000000), (549999000, 370003000), (549999000, 369997000)]
    areas = [MissionItem(Frame.GLOBAL_INT, FenceCommand.POLYGON_INCLUSION, *rest, x, y, 0.0, 1) for x, y in triangle]
    areas.append(MissionItem(Frame.LOCAL_NED, FenceCommand.CIRCLE_EXCLUSION, *rest, 80_000, -60_000, 0.0, 1))
    assert plans.fence.replace(areas) is None
    rally = MissionItem(Frame.GLOBAL_RELATIVE_ALT_INT, 5100, 0, 1, 0.0, 0.0, 0.0, 0.0, 550001000, 370000000, 20.0, 2)
    assert plans.rally.replace([rally]) is None
    told = json.loads(messages.encode(messages.mission(7, plans)))
    polygon, circle = told["fence"]
    assert (polygon["item"], polygon["inclusion"], polygon["group"], polygon["radius_m"]) == (0, True, 1, None)
    assert polygon["corners_N_m"][0] == pytest.approx([11.1, 0.0], abs=0.1)
    assert len(polygon["corners_N_m"]) == 3
    assert circle == {"item": 3, "inclusion": False, "group": 1, "corners_N_m": [[8.0, -6.0]], "radius_m": 3.0}
    [point] = told["rally_N_m"]
    assert point == pytest.approx([11.1, 0.0, -20.0], abs=0.1)


def test_the_mission_tells_where_its_items_are_whatever_frame_they_came_in() -> None:
    plans = stored_plans()
    mission = plans.mission
    flat = (0, 1, 0.0, 0.0, 0.0, math.nan)
    items = [
        MissionItem(Frame.LOCAL_NED, ItemCommand.TAKEOFF, *flat, 0, 0, -5.0),
        MissionItem(Frame.GLOBAL_RELATIVE_ALT_INT, ItemCommand.WAYPOINT, *flat, 550001000, 370000000, 20.0),
        MissionItem(Frame.MISSION, ItemCommand.RETURN_TO_LAUNCH, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0),
    ]
    assert mission.replace(items) is None
    told = json.loads(messages.encode(messages.mission(7, plans)))
    assert (told["now_us"], told["plan_id"], told["total"]) == (7, mission.plan_id, 3)
    assert [item["command"] for item in told["items"]] == ["takeoff", "waypoint", "return to launch"]
    assert told["items"][0]["position_N_m"] == [0.0, 0.0, -5.0]
    assert told["items"][1]["position_N_m"] == pytest.approx([11.1, 0.0, -20.0], abs=0.1)
    assert told["items"][2]["position_N_m"] is None


def test_of_a_very_long_mission_only_the_first_items_are_told() -> None:
    plans = stored_plans()
    mission = plans.mission
    item = MissionItem(Frame.LOCAL_NED, ItemCommand.WAYPOINT, 0, 1, 0.0, 0.0, 0.0, math.nan, 0, 0, -5.0)
    assert mission.replace([item] * (messages.ITEMS_MAX + 1)) is None
    told = messages.mission(0, plans)
    assert (told.total, len(told.items)) == (messages.ITEMS_MAX + 1, messages.ITEMS_MAX)
