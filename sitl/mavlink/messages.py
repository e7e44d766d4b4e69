"""What each streamed message says of the vehicle: functions from a View to the message's values in wire order.

Wire order is that of codec.Definition.fields: largest types first, not the order in which the MAVLink guide lists the
fields; text is bytes, arrays are spread out. Attitudes are the multicopter's (see wire.py).
"""

import math
from typing import Any

from sitl.frames import wire_quaternion, wire_rates
from sitl.geodesy import to_global
from sitl.mavlink.codec import mav
from sitl.mavlink.identity import MODE_CODES
from sitl.mavlink.view import View
from sitl.mavlink.wire import cdeg, clamped, cm_s, degE7, int16, mm, uint16
from sitl.onboard.modes import Landed, Mode
from sitl.quaternion import rotate_back

Values = tuple[Any, ...]

_LANDED = {
    Landed.ON_GROUND: mav.MAV_LANDED_STATE_ON_GROUND,
    Landed.TAKING_OFF: mav.MAV_LANDED_STATE_TAKEOFF,
    Landed.IN_AIR: mav.MAV_LANDED_STATE_IN_AIR,
    Landed.LANDING: mav.MAV_LANDED_STATE_LANDING,
}

_SENSORS = (
    mav.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mav.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mav.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mav.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mav.MAV_SYS_STATUS_SENSOR_GPS
    | mav.MAV_SYS_STATUS_AHRS
)
_CONTROL = (
    mav.MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL
    | mav.MAV_SYS_STATUS_SENSOR_ATTITUDE_STABILIZATION
    | mav.MAV_SYS_STATUS_SENSOR_YAW_POSITION
    | mav.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
    | mav.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
    | mav.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
)
_BATTERY = mav.MAV_SYS_STATUS_SENSOR_BATTERY
_FENCE = mav.MAV_SYS_STATUS_GEOFENCE
_PREARM = mav.MAV_SYS_STATUS_PREARM_CHECK

_ESTIMATOR = 1 | 2 | 4 | 8 | 16 | 32 | 64 | 256 | 512  # ESTIMATOR_STATUS_FLAGS: all that is good, nothing that is wrong
_IMU_FIELDS = 0x1FFF  # HIGHRES_IMU_UPDATED_FLAGS: all thirteen
_UNKNOWN_U16 = 0xFFFF


def sys_status(v: View) -> Values:
    s = v.s
    healthy = _SENSORS if v.nav_is_finite else 0
    if not s.gnss_heard:
        healthy &= ~mav.MAV_SYS_STATUS_SENSOR_GPS
    if not s.tipped_over:
        healthy |= _CONTROL
    if s.battery.remaining > 0.0:
        healthy |= _BATTERY
    if s.ready_to_arm or s.armed:
        healthy |= _PREARM
    if not s.breach.outside:
        healthy |= _FENCE
    present = _SENSORS | _CONTROL | _BATTERY | _PREARM | (_FENCE if s.fenced else 0)
    enabled = present if s.armed else present & ~_CONTROL
    voltage, current = uint16(s.battery.voltage_V * 1e3), int16(s.battery.current_A * 100.0)
    percent = clamped(s.battery.remaining * 100.0, 0, 100)
    return present, enabled, healthy, 0, voltage, current, 0, 0, 0, 0, 0, 0, percent, 0, 0, 0


def system_time(v: View) -> Values:
    return 0, v.boot_ms  # the simulated world has no calendar


def gps_raw_int(v: View) -> Values:
    nav = v.s.nav
    lat, lon = v.place
    speed = v.groundspeed_m_s
    course = cdeg(math.atan2(nav.v_east_m_s, nav.v_north_m_s)) if speed > 0.1 else _UNKNOWN_U16
    altitude = mm(v.alt_amsl_m)
    fix, satellites = (mav.GPS_FIX_TYPE_3D_FIX, 12) if v.s.gnss_heard else (mav.GPS_FIX_TYPE_NO_FIX, 0)
    return (
        v.s.now_us,
        degE7(lat),
        degE7(lon),
        altitude,
        70,  # HDOP and VDOP × 100, and satellites, of a good sky
        100,
        uint16(speed * 100.0),
        course,
        fix,
        satellites,
        altitude,
        0,
        0,
        0,
        0,
        0,
    )


def scaled_pressure(v: View) -> Values:
    return v.boot_ms, v.pressure_hPa, v.dynamic_pressure_hPa, int16(v.temperature_C * 100.0), 0


def attitude(v: View) -> Values:
    a = v.attitude
    return v.boot_ms, a.roll, a.pitch, a.yaw, a.rollspeed, a.pitchspeed, a.yawspeed


def attitude_quaternion(v: View) -> Values:
    a = v.attitude
    return v.boot_ms, *a.q, a.rollspeed, a.pitchspeed, a.yawspeed, 1.0, 0.0, 0.0, 0.0


def local_position_ned(v: View) -> Values:
    nav = v.s.nav
    return v.boot_ms, nav.north_m, nav.east_m, nav.down_m, nav.v_north_m_s, nav.v_east_m_s, nav.v_down_m_s


def global_position_int(v: View) -> Values:
    nav = v.s.nav
    lat, lon = v.place
    return (
        v.boot_ms,
        degE7(lat),
        degE7(lon),
        mm(v.alt_amsl_m),
        mm(v.alt_above_home_m),
        cm_s(nav.v_north_m_s),
        cm_s(nav.v_east_m_s),
        cm_s(nav.v_down_m_s),
        cdeg(v.attitude.yaw),
    )


def servo_output_raw(v: View) -> Values:
    """Outputs 1, 2: left and right motor (1000 … 2000 µs); 3, 4: left and right flap (1500 ± 500 µs)."""
    motors = [clamped(1000.0 + 1000.0 * share, 1000, 2000) for share in v.motors]
    flaps = [clamped(1500.0 + 500.0 * share, 1000, 2000) for share in v.flaps]
    return (v.s.now_us & 0xFFFFFFFF, *motors, *flaps, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


def actuator_output_status(v: View) -> Values:
    """As SERVO_OUTPUT_RAW, motors 0 … 1 and flaps −1 … 1."""
    return (v.s.now_us, 0b1111, *v.motors, *v.flaps, *_ACTUATORS_REST)


_ACTUATORS_REST = (0.0,) * 28


def vfr_hud(v: View) -> Values:
    heading = round(math.degrees(v.attitude.yaw)) % 360 if math.isfinite(v.attitude.yaw) else 0
    throttle = clamped(100.0 * v.throttle, 0, 100)
    return v.airspeed_m_s, v.groundspeed_m_s, v.alt_amsl_m, -v.s.nav.v_down_m_s, heading, throttle


def position_target_local_ned(v: View) -> Values:
    r = v.s.reference
    return (v.boot_ms, *r[:9], r.heading_rad, r.heading_rate_rad_s, 0, mav.MAV_FRAME_LOCAL_NED)


def position_target_global_int(v: View) -> Values:
    r = v.s.reference
    lat, lon = to_global(v.s.origin, r.north_m, r.east_m)
    altitude = v.s.origin.alt_amsl_m - r.down_m
    frame = mav.MAV_FRAME_GLOBAL_INT
    return (v.boot_ms, degE7(lat), degE7(lon), altitude, *r[3:9], r.heading_rad, r.heading_rate_rad_s, 0, frame)


def attitude_target(v: View) -> Values:
    c = v.s.command
    return (v.boot_ms, *wire_quaternion(*v.target_q), *wire_rates(c.p_rad_s, c.q_rad_s, c.r_rad_s), v.throttle, 0)


def highres_imu(v: View) -> Values:
    a = v.attitude
    return (
        v.s.now_us,
        *v.specific_force,
        a.rollspeed,
        a.pitchspeed,
        a.yawspeed,
        *v.magnetic_field,
        v.pressure_hPa,
        v.dynamic_pressure_hPa,
        v.alt_amsl_m,
        v.temperature_C,
        _IMU_FIELDS,
        0,
    )


def altitude(v: View) -> Values:
    above_ground = -v.s.nav.down_m
    amsl = v.alt_amsl_m
    return v.s.now_us, amsl, amsl, above_ground, v.alt_above_home_m, above_ground, above_ground


def battery_status(v: View) -> Values:
    b = v.s.battery
    percent = clamped(b.remaining * 100.0, 0, 100)
    charge = mav.MAV_BATTERY_CHARGE_STATE_OK if b.remaining > 0.15 else mav.MAV_BATTERY_CHARGE_STATE_LOW
    used, current = clamped(b.used_mAh, 0, 2**31 - 1), int16(b.current_A * 100.0)
    voltages = (uint16(b.voltage_V * 1e3), *_NO_CELLS)
    function, kind = mav.MAV_BATTERY_FUNCTION_ALL, mav.MAV_BATTERY_TYPE_LIPO
    return (used, -1, 32767, *voltages, current, 0, function, kind, percent, 0, charge, 0, 0, 0, 0, 0, 0)


_NO_CELLS = (_UNKNOWN_U16,) * 9


def estimator_status(v: View) -> Values:
    """Accuracies are the filter's own; zero where the vehicle knows its state."""
    flags = _ESTIMATOR if v.nav_is_finite else 0
    return v.s.now_us, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *v.s.nav_accuracy_m, flags


def wind_cov(v: View) -> Values:
    return v.s.now_us, *v.s.wind_N, 0.0, 0.0, v.alt_amsl_m, 0.0, 0.0


def vibration(v: View) -> Values:
    return v.s.now_us, 0.0, 0.0, 0.0, 0, 0, 0


def home_position(v: View) -> Values:
    h, s = v.s.home, v.s
    half = 0.5 * s.home_heading_rad
    place = degE7(h.lat_deg), degE7(h.lon_deg), mm(h.alt_amsl_m)
    return (*place, *s.home_N, math.cos(half), 0.0, 0.0, math.sin(half), 0.0, 0.0, 0.0, s.now_us)


def gps_global_origin(v: View) -> Values:
    o = v.s.origin
    return degE7(o.lat_deg), degE7(o.lon_deg), mm(o.alt_amsl_m), v.s.now_us


def extended_sys_state(v: View) -> Values:
    return mav.MAV_VTOL_STATE_MC, _LANDED[v.s.landed]


def mission_current(v: View) -> Values:
    """`total` is 65535 where no mission is stored."""
    s = v.s
    total = s.mission_total or _UNKNOWN_U16
    in_mission = 1 if s.mode is Mode.MISSION else 2
    return s.mission_current, total, int(s.mission_state), in_mission, s.plan_id, s.fence_id, s.rally_id


def fence_status(v: View) -> Values:
    b = v.s.breach
    return b.since_us // 1000 & 0xFFFFFFFF, b.times & 0xFFFF, int(b.outside), int(b.kind), mav.FENCE_MITIGATE_NONE


def orbit_execution_status(v: View) -> Values | None:
    """Only while orbiting. The radius is positive clockwise."""
    orbiting = v.s.orbiting
    if orbiting is None:
        return None
    north, east, down = orbiting.circle.centre_N
    lat, lon = to_global(v.s.origin, north, east)
    radius = orbiting.circle.radius_m if orbiting.clockwise else -orbiting.circle.radius_m
    return v.s.now_us, radius, degE7(lat), degE7(lon), v.s.origin.alt_amsl_m - down, mav.MAV_FRAME_GLOBAL_INT


def current_mode(v: View) -> Values:
    """The intended mode is not known where a failsafe has chosen another."""
    code = MODE_CODES[v.s.mode]
    return code.custom_mode, 0 if v.s.failsafe else code.custom_mode, code.standard


def utm_global_position(v: View) -> Values:
    """Without calendar time and vehicle id, and flagged so."""
    nav = v.s.nav
    lat, lon = v.place
    flight = 2 if v.s.landed is Landed.ON_GROUND else 3  # UTM_FLIGHT_STATE: ground, airborne
    flags = 4 | 8 | 16 | 32 | 64  # UTM_DATA_AVAIL_FLAGS: position, altitudes, velocities
    where = degE7(lat), degE7(lon), mm(v.alt_amsl_m), mm(v.alt_above_home_m)
    speed = cm_s(nav.v_north_m_s), cm_s(nav.v_east_m_s), cm_s(nav.v_down_m_s)
    return (0, *where, 0, 0, 0, *speed, 0, 0, 0, 0, *_NO_UAS_ID, flight, flags)


_NO_UAS_ID = (0,) * 18


def odometry(v: View) -> Values:
    """Position and attitude in world N; velocity and rates in the multicopter's body."""
    nav, a = v.s.nav, v.attitude
    speed = rotate_back(a.q, (nav.v_north_m_s, nav.v_east_m_s, nav.v_down_m_s))
    where = nav.north_m, nav.east_m, nav.down_m, *a.q
    frames = mav.MAV_FRAME_LOCAL_NED, mav.MAV_FRAME_BODY_FRD
    motion = *speed, a.rollspeed, a.pitchspeed, a.yawspeed
    return v.s.now_us, *where, *motion, *_NO_COVARIANCE, *frames, 0, mav.MAV_ESTIMATOR_TYPE_AUTOPILOT, 0


_NO_COVARIANCE = (math.nan,) * 42


def hil_state_quaternion(v: View) -> Values:
    """The true state, as PX4's simulation in hardware shows it to viewers."""
    x, a = v.s.truth, v.true_attitude
    lat, lon = v.true_place
    speed = cm_s(x.v_north_m_s), cm_s(x.v_east_m_s), cm_s(x.v_down_m_s)
    air = uint16(v.true_airspeed_m_s * 100.0)
    force = (int16(f / 9.80665 * 1e3) for f in v.specific_force)  # mG
    where = degE7(lat), degE7(lon), mm(v.true_alt_amsl_m)
    return (v.s.now_us, *a.q, a.rollspeed, a.pitchspeed, a.yawspeed, *where, *speed, air, air, *force)


def sim_state(v: View) -> Values:
    """The true state, in full."""
    x, a = v.s.truth, v.true_attitude
    lat, lon = v.true_place
    motion = *v.specific_force, a.rollspeed, a.pitchspeed, a.yawspeed
    where = lat, lon, v.true_alt_amsl_m, 0.0, 0.0
    speed = x.v_north_m_s, x.v_east_m_s, x.v_down_m_s
    return *a.q, a.roll, a.pitch, a.yaw, *motion, *where, *speed, degE7(lat), degE7(lon)


def paper_angles(v: View) -> Values:
    """The paper's φ, θ, ψ in degrees."""
    phi, theta, psi = v.paper_angles
    return v.s.now_us, math.degrees(phi), math.degrees(theta), math.degrees(psi), b"YXZ_DEG"


def paper_phi(v: View) -> Values:
    return v.boot_ms, math.degrees(v.paper_angles[0]), b"PHI_DEG"


def paper_theta(v: View) -> Values:
    return v.boot_ms, math.degrees(v.paper_angles[1]), b"THETA_DEG"


def paper_psi(v: View) -> Values:
    return v.boot_ms, math.degrees(v.paper_angles[2]), b"PSI_DEG"


def thrusts(v: View) -> Values:
    """Commanded thrust in newtons: left, right, total."""
    left, right = v.s.command.thrust_left_N, v.s.command.thrust_right_N
    return v.s.now_us, left, right, left + right, b"THRUST_N"


def flaps(v: View) -> Values:
    """Where the flaps are, in degrees: left, right, mean."""
    left, right = math.degrees(v.s.truth.flap_left_rad), math.degrees(v.s.truth.flap_right_rad)
    return v.s.now_us, left, right, 0.5 * (left + right), b"FLAP_DEG"
