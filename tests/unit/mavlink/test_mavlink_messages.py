"""What the streamed messages say, against a snapshot made up for it."""

import math
from typing import Any

import pytest

from sitl.control.cascade import Command
from sitl.control.reference import Reference
from sitl.frames import standing
from sitl.geodesy import GeoPoint
from sitl.mavlink.codec import Encoder, Parser
from sitl.mavlink.streams import STREAMS
from sitl.mavlink.view import Craft, View
from sitl.model.rigid_body import State
from sitl.navigation import NavState
from sitl.onboard.circles import Circle
from sitl.onboard.guided import Orbiting
from sitl.onboard.mission import MissionState
from sitl.onboard.modes import Landed, Mode
from sitl.snapshot import Battery, Snapshot

ORIGIN = GeoPoint(47.0, 8.0, 500.0)
HEADING = math.radians(30.0)
Q = standing(HEADING, math.pi / 2)
NAV = NavState(100.0, 50.0, -20.0, 3.0, 4.0, -1.0, *Q, 0.1, 0.2, 0.3)
SNAPSHOT = Snapshot(
    now_us=12_345_678,
    truth=State(*NAV, 800.0, 810.0, math.radians(5.0), math.radians(7.0)),
    nav=NAV,
    acceleration_B=(9.8, 0.0, 0.1),
    acceleration_N=(0.0, 0.0, 0.0),
    wind_N=(1.0, -2.0, 0.5),
    reference=Reference(101.0, 51.0, -21.0, 1.0, 2.0, -3.0, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.7, 0.05),
    command=Command(*Q, 0.4, 0.5, 0.6, 5.5, 2.75, 0.3, -0.3, 0.0, 0.0, 0.0, 0.0),
    feet_down=0,
    mode=Mode.MISSION,
    armed=True,
    landed=Landed.IN_AIR,
    tipped_over=False,
    failsafe="",
    ready_to_arm=True,
    origin=ORIGIN,
    home=GeoPoint(47.0, 8.0, 498.0),
    home_N=(0.0, 0.0, 2.0),
    home_heading_rad=HEADING,
    mission_state=MissionState.ACTIVE,
    mission_current=3,
    mission_total=7,
    plan_id=0xDEADBEEF,
    battery=Battery(12.1, 8.25, 0.876, 123.4),
)
CRAFT = Craft(11.0, 0.6, 1.225)


def said(name: str, **changes: Any) -> Any:
    """The message of a stream as a client reads it; the last one, where several share an id."""
    return all_said(name, **changes)[-1]


def all_said(name: str, **changes: Any) -> list[Any]:
    view = View(SNAPSHOT._replace(**changes), CRAFT)
    encoder = Encoder(1, 1)
    data = b"".join(encoder.frame(s.definition, s.payload(view)) for s in STREAMS if s.definition.name == name)
    return [frame.message for frame in Parser().feed(data)]


def test_attitude_is_the_multicopters() -> None:
    m = said("ATTITUDE")
    assert (m.roll, m.pitch, m.yaw) == pytest.approx((0.0, 0.0, HEADING), abs=1e-6)
    assert (m.rollspeed, m.pitchspeed, m.yawspeed) == pytest.approx((0.3, 0.2, -0.1))
    assert m.time_boot_ms == 12_345
    q = said("ATTITUDE_QUATERNION")
    assert (q.q1, q.q2, q.q3, q.q4) == pytest.approx((math.cos(HEADING / 2), 0, 0, math.sin(HEADING / 2)), abs=1e-6)
    assert q.repr_offset_q == (1.0, 0.0, 0.0, 0.0)


def test_positions_agree_in_the_local_and_the_global_frame() -> None:
    local, place = said("LOCAL_POSITION_NED"), said("GLOBAL_POSITION_INT")
    assert (local.x, local.y, local.z, local.vx, local.vy, local.vz) == (100.0, 50.0, -20.0, 3.0, 4.0, -1.0)
    assert (place.lat - 470000000) * 1e-7 * math.radians(1) * 6371000 == pytest.approx(100.0, abs=0.02)
    assert (place.alt, place.relative_alt) == (520_000, 22_000)
    assert (place.vx, place.vy, place.vz, place.hdg) == (300, 400, -100, 3000)
    gps = said("GPS_RAW_INT")
    assert (gps.lat, gps.lon, gps.alt, gps.vel, gps.fix_type) == (place.lat, place.lon, 520_000, 500, 3)
    assert gps.cog == round(math.degrees(math.atan2(4, 3)) * 100)


def test_targets_echo_the_reference_and_the_commanded_attitude() -> None:
    m = said("POSITION_TARGET_LOCAL_NED")
    values = (m.x, m.y, m.z, m.vx, m.vy, m.vz, m.afx, m.afy, m.afz, m.yaw, m.yaw_rate)
    assert values == pytest.approx((101.0, 51.0, -21.0, 1.0, 2.0, -3.0, 0.1, 0.2, 0.3, 0.7, 0.05))
    assert (m.coordinate_frame, m.type_mask) == (1, 0)
    assert said("POSITION_TARGET_GLOBAL_INT").alt == pytest.approx(521.0)
    target = said("ATTITUDE_TARGET")
    assert target.q == pytest.approx((math.cos(HEADING / 2), 0, 0, math.sin(HEADING / 2)), abs=1e-6)
    rates = (target.body_roll_rate, target.body_pitch_rate, target.body_yaw_rate)
    assert rates == pytest.approx((0.6, 0.5, -0.4))
    assert target.thrust == pytest.approx(0.375)


def test_outputs_scale_motors_from_idle_to_full_and_flaps_about_the_centre() -> None:
    m = said("SERVO_OUTPUT_RAW")
    assert (m.servo1_raw, m.servo2_raw, m.servo3_raw, m.servo4_raw) == (1500, 1250, 1750, 1250)
    status = said("ACTUATOR_OUTPUT_STATUS")
    assert status.actuator[:5] == pytest.approx((0.5, 0.25, 0.5, -0.5, 0.0))


def test_debug_vectors_carry_the_papers_angles_thrusts_and_flaps() -> None:
    angles, thrust, flap = all_said("DEBUG_VECT")
    assert (angles.name, thrust.name, flap.name) == ("YXZ_DEG", "THRUST_N", "FLAP_DEG")
    assert angles.y == pytest.approx(90.0, abs=0.01)
    assert (thrust.x, thrust.y, thrust.z) == (5.5, 2.75, 8.25)
    assert (flap.x, flap.y, flap.z) == pytest.approx((5.0, 7.0, 6.0))


def test_named_values_carry_the_papers_angles_too() -> None:
    named = {m.name: m.value for m in all_said("NAMED_VALUE_FLOAT")}
    assert named == pytest.approx({"PHI_DEG": -30.0, "THETA_DEG": 90.0, "PSI_DEG": 0.0}, abs=0.01)


def test_odometry_tells_velocity_along_the_multicopters_body() -> None:
    m = said("ODOMETRY")
    assert (m.frame_id, m.child_frame_id, m.estimator_type) == (1, 12, 8)
    assert (m.x, m.y, m.z) == (100.0, 50.0, -20.0)
    forward = 3.0 * math.cos(HEADING) + 4.0 * math.sin(HEADING)  # 30° east of north
    assert (m.vx, m.vz) == pytest.approx((forward, -1.0), abs=1e-5)
    assert (m.rollspeed, m.pitchspeed, m.yawspeed) == pytest.approx((0.3, 0.2, -0.1))
    assert math.isnan(m.pose_covariance[0])
    assert math.isnan(m.velocity_covariance[20])


@pytest.mark.parametrize("name", ["HIL_STATE_QUATERNION", "SIM_STATE"])
def test_viewers_and_analysts_get_the_true_state_not_the_estimate(name: str) -> None:
    lost = said(name, nav=NAV._replace(north_m=0.0, down_m=0.0, v_north_m_s=0.0, qw=1.0, qx=0.0, qy=0.0, qz=0.0))
    assert lost == said(name)
    if name == "SIM_STATE":
        assert math.degrees(lost.yaw) == pytest.approx(30.0)
        assert (lost.vn, lost.ve, lost.vd, lost.alt) == (3.0, 4.0, -1.0, 520.0)
    else:
        assert lost.attitude_quaternion == pytest.approx((math.cos(HEADING / 2), 0, 0, math.sin(HEADING / 2)))
        assert (lost.vx, lost.vy, lost.vz, lost.alt) == (300, 400, -100, 520_000)


def test_the_inertial_sensor_reads_in_the_multicopter_frame() -> None:
    m = said("HIGHRES_IMU")
    assert (m.xacc, m.yacc, m.zacc) == pytest.approx((0.1, 0.0, -9.8))
    assert (m.xgyro, m.ygyro, m.zgyro) == pytest.approx((0.3, 0.2, -0.1))
    assert math.degrees(math.atan2(-m.ymag, m.xmag)) == pytest.approx(30.0)  # a compass finds the heading
    assert m.abs_pressure == pytest.approx(952.3, abs=0.5)  # standard atmosphere at 520 m


def test_speeds_are_over_ground_and_through_the_moving_air() -> None:
    m = said("VFR_HUD")
    assert m.groundspeed == pytest.approx(5.0)
    assert m.airspeed == pytest.approx(math.hypot(2.0, 6.0, -1.5))
    assert (m.heading, m.throttle, m.climb) == (30, 38, 1.0)
    wind = said("WIND_COV")
    assert (wind.wind_x, wind.wind_y, wind.wind_z) == (1.0, -2.0, 0.5)


def test_battery_figures_agree_in_both_messages() -> None:
    status, battery = said("SYS_STATUS"), said("BATTERY_STATUS")
    assert (status.voltage_battery, status.current_battery, status.battery_remaining) == (12_100, 825, 88)
    assert (battery.voltages[0], battery.voltages[1], battery.current_battery) == (12_100, 65_535, 825)
    assert (battery.battery_remaining, battery.current_consumed) == (88, 123)


HEALTH_OF_MAVSDK = 0x01 | 0x02 | 0x04 | 0x20 | 0x10000000


def test_a_ready_vehicle_shows_all_the_health_bits_that_clients_wait_for() -> None:
    m = said("SYS_STATUS", armed=False)
    for field in ("present", "enabled", "health"):
        assert getattr(m, f"onboard_control_sensors_{field}") & HEALTH_OF_MAVSDK == HEALTH_OF_MAVSDK


def test_health_bits_fall_with_what_they_stand_for() -> None:
    prearm, control, battery, sensors = 0x10000000, 0x400, 0x2000000, 0x27

    def health(**changes: Any) -> int:
        return int(said("SYS_STATUS", **changes).onboard_control_sensors_health)

    assert not health(armed=False, ready_to_arm=False) & prearm
    assert not health(tipped_over=True) & control
    assert not health(battery=SNAPSHOT.battery._replace(remaining=0.0)) & battery
    assert not health(nav=NAV._replace(qw=math.nan)) & sensors


@pytest.mark.parametrize(
    ("landed", "number"),
    [(Landed.ON_GROUND, 1), (Landed.IN_AIR, 2), (Landed.TAKING_OFF, 3), (Landed.LANDING, 4)],
)
def test_extended_state_tells_the_ground_contact_and_hover(landed: Landed, number: int) -> None:
    m = said("EXTENDED_SYS_STATE", landed=landed)
    assert (m.landed_state, m.vtol_state) == (number, 3)


def test_mission_current_tells_item_total_state_and_plan_id() -> None:
    m = said("MISSION_CURRENT")
    assert (m.seq, m.total, m.mission_state, m.mission_mode, m.mission_id) == (3, 7, 3, 1, 0xDEADBEEF)
    none = said("MISSION_CURRENT", mission_total=0, mission_current=0, mode=Mode.HOLD)
    assert (none.total, none.mission_mode) == (65_535, 2)


def test_home_and_origin_are_told_in_both_frames() -> None:
    home = said("HOME_POSITION")
    assert (home.latitude, home.longitude, home.altitude, home.z) == (470000000, 80000000, 498_000, 2.0)
    assert home.q == pytest.approx((math.cos(HEADING / 2), 0, 0, math.sin(HEADING / 2)))
    assert said("GPS_GLOBAL_ORIGIN").altitude == 500_000


def test_the_intended_mode_is_unknown_in_a_failsafe() -> None:
    assert said("CURRENT_MODE").intended_custom_mode == said("CURRENT_MODE").custom_mode == 67371008
    assert said("CURRENT_MODE", failsafe="offboard targets lost").intended_custom_mode == 0


def test_every_stream_can_be_packed_from_any_finite_state() -> None:
    wild = NAV._replace(north_m=-8e6, down_m=5e5, v_north_m_s=1e4, v_down_m_s=-1e4)
    orbiting = Orbiting(Circle((5.0, 6.0, -7.0), 3.0), clockwise=False)
    for snapshot in (SNAPSHOT._replace(orbiting=orbiting), SNAPSHOT._replace(nav=wild, orbiting=orbiting)):
        view = View(snapshot, CRAFT)
        for stream in STREAMS:
            assert stream.payload(view), stream.definition.name
