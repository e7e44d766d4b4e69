"""The cascade: position → velocity → pitch, lean and thrust → attitude → rate → allocation (paper section IV)."""

import math
from typing import NamedTuple

from sitl.control.allocation import allocate
from sitl.control.attitude import (
    attitude_of,
    braked,
    braked_together,
    error_quaternion,
    error_yxz,
    rate_command,
)
from sitl.control.disturbance import Disturbance, Flaps, none, observed
from sitl.control.feedforward import Course, Trim, heading_frame, invert, reference_needs, refined
from sitl.control.flow import flow_at
from sitl.control.gains import Gains, Settings
from sitl.control.guidance import Actuation, Guidance
from sitl.control.pid import integrated, smoothed
from sitl.control.position import velocity_command
from sitl.control.rate import moment
from sitl.control.reference import Reference, sample
from sitl.control.velocity import specific_force
from sitl.frames import GRAVITY_M_S2
from sitl.jit import kernel
from sitl.model.airframe import Airframe
from sitl.navigation import NavState
from sitl.quaternion import Quat, Vec3, rotate_back

_NEAR_COSINE = 0.7  # of the angle between the nose and its target
_POSITION_INTEGRAL_MAX = 5.0  # m s
_VELOCITY_INTEGRAL_MAX = 10.0  # m
_LIFT_OFF, _SLIDE_M_S = 1.15, 0.1  # least lift over weight where feet that touch the ground slide so fast
_LEARN_BELOW_M_S = 2.0  # velocity errors above it are not integrated
_ANGLE_INTEGRAL_MAX = 1.0  # rad s
_RATE_INTEGRAL_MAX = 2.0  # rad


class Memory(NamedTuple):
    """All that the cascade remembers from one control step to the next."""

    position_integral: Vec3
    velocity_integral: Vec3
    attitude_integral: Vec3
    rate_integral: Vec3
    velocity_error_smoothed: Vec3
    rate_error_smoothed: Vec3
    reference_trims: Course  # of the reference, where the next inversion starts
    command_trim: Trim
    flow_left_N: float  # thrust as it shapes the slipstream, after the motors' lag
    flow_right_N: float
    flaps: Flaps  # after the flaps' lag
    disturbance: Disturbance
    thrust_short: float
    roll_short: float
    pitch_short: float
    yaw_short: float


class Command(NamedTuple):
    """What the cascade asks of actuators, and its inner targets (SI, radians; attitude target q_NB, rates in B)."""

    qw: float
    qx: float
    qy: float
    qz: float
    p_rad_s: float
    q_rad_s: float
    r_rad_s: float
    thrust_left_N: float
    thrust_right_N: float
    flap_left_rad: float
    flap_right_rad: float
    v_north_m_s: float
    v_east_m_s: float
    v_down_m_s: float
    saturated: float


@kernel
def at_rest(a: Airframe, thrust_each_N: float) -> Memory:
    """The memory of a cascade that has not flown yet, at the given thrust of each motor."""
    zero = (0.0, 0.0, 0.0)
    weight = a.mass_kg * GRAVITY_M_S2
    hover = invert(a, (0.0, 0.0, -weight), zero, 0.0, 0.5 * math.pi, weight, 8)
    course, t = Course(hover, hover, hover), thrust_each_N
    return Memory(zero, zero, zero, zero, zero, zero, course, hover, t, t, Flaps(0.0, 0.0), none(), 0.0, 0.0, 0.0, 0.0)


@kernel
def standing_command(nav: NavState, thrust_each_N: float) -> Command:
    """Motors at a given thrust, flaps centred: the vehicle stands, disarmed or idling."""
    t = thrust_each_N
    return Command(nav.qw, nav.qx, nav.qy, nav.qz, 0.0, 0.0, 0.0, t, t, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def direct_command(a: Airframe, nav: NavState, x: Actuation) -> Command:
    """What was asked of the actuators, within their limits; there are no inner targets."""
    left = min(max(x.thrust_left_N, a.thrust_min_N), a.thrust_max_N)
    right = min(max(x.thrust_right_N, a.thrust_min_N), a.thrust_max_N)
    flap_left = min(max(x.flap_left_rad, -a.flap_max_rad), a.flap_max_rad)
    flap_right = min(max(x.flap_right_rad, -a.flap_max_rad), a.flap_max_rad)
    return Command(
        nav.qw, nav.qx, nav.qy, nav.qz, 0.0, 0.0, 0.0, left, right, flap_left, flap_right, 0.0, 0.0, 0.0, 0.0
    )


@kernel
def _difference(x: Vec3, y: Vec3) -> Vec3:
    return x[0] - y[0], x[1] - y[1], x[2] - y[2]


@kernel
def _integrated(integral: Vec3, error: Vec3, dt_s: float, limit: float, held: tuple[bool, bool, bool]) -> Vec3:
    return (
        integrated(integral[0], error[0], dt_s, limit, held[0]),
        integrated(integral[1], error[1], dt_s, limit, held[1]),
        integrated(integral[2], error[2], dt_s, limit, held[2]),
    )


@kernel
def _filtered_rate(smoothed_error: Vec3, error: Vec3, dt_s: float, tau_s: float) -> tuple[Vec3, Vec3]:
    """(smoothed error, its rate): the derivative of `error` behind a first-order filter; tau 0: no derivative."""
    if tau_s <= 0.0:
        return error, (0.0, 0.0, 0.0)
    new = (
        smoothed(smoothed_error[0], error[0], dt_s, tau_s),
        smoothed(smoothed_error[1], error[1], dt_s, tau_s),
        smoothed(smoothed_error[2], error[2], dt_s, tau_s),
    )
    return new, (
        (error[0] - new[0]) / tau_s,
        (error[1] - new[1]) / tau_s,
        (error[2] - new[2]) / tau_s,
    )


@kernel
def _approach(dt_s: float, tau_s: float) -> float:
    """How much of the way to its command a first-order actuator goes in a step."""
    return 1.0 - math.exp(-dt_s / tau_s) if tau_s > 0.0 else 1.0


@kernel
def _spun_up(thrust_N: float, command_N: float, gain: float) -> float:
    """A propeller's thrust one step later: the rotor's speed, thus the thrust's root, approaches its command."""
    root = math.sqrt(thrust_N)
    root += gain * (math.sqrt(max(command_N, 0.0)) - root)
    return root * root


@kernel
def cascade(
    a: Airframe, gains: Gains, s: Settings, guidance: Guidance, m: Memory, nav: NavState, t_s: float, dt_s: float
) -> tuple[Command, Memory, Reference]:
    """One control step at simulation time t_s: actuator commands from the navigation state and the reference.

    a: the airframe as the controller believes it to be.
    """
    q_NB: Quat = (nav.qw, nav.qx, nav.qy, nav.qz)
    velocity = (nav.v_north_m_s, nav.v_east_m_s, nav.v_down_m_s)
    rates = (nav.p_rad_s, nav.q_rad_s, nav.r_rad_s)
    ref = sample(guidance.trajectory, t_s)
    thrust_held = m.thrust_short > 0.0
    tilt_held = m.pitch_short > 0.0 or m.yaw_short > 0.0

    # what acts now, and what of it the force laws don't explain
    u, _, w = rotate_back(q_NB, velocity)
    flow = flow_at(a, u, w, m.flow_left_N, m.flow_right_N)
    disturbance = observed(a, m.disturbance, nav, flow, m.flaps, s.disturbance, guidance.aloft > 0.0, dt_s)
    unexplained, turning = disturbance.acceleration_N, disturbance.angular_B

    # position
    fp = (guidance.follow_position_north, guidance.follow_position_east, guidance.follow_position_down)
    position_error = (
        fp[0] * (ref.north_m - nav.north_m),
        fp[1] * (ref.east_m - nav.east_m),
        fp[2] * (ref.down_m - nav.down_m),
    )
    reference_velocity = (ref.v_north_m_s, ref.v_east_m_s, ref.v_down_m_s)
    lag = _difference(reference_velocity, velocity)  # the error's own rate, which the printed derivative acts on
    position_integral = _integrated(
        m.position_integral, position_error, dt_s, _POSITION_INTEGRAL_MAX, (tilt_held, tilt_held, thrust_held)
    )
    k = s.feedforward_velocity
    v_ff = (
        reference_velocity[0] if fp[0] == 0.0 else k * reference_velocity[0],
        reference_velocity[1] if fp[1] == 0.0 else k * reference_velocity[1],
        reference_velocity[2] if fp[2] == 0.0 else k * reference_velocity[2],
    )
    v_command = velocity_command(
        gains.position,
        position_error,
        position_integral,
        (fp[0] * lag[0], fp[1] * lag[1], fp[2] * lag[2]),
        v_ff,
        s.velocity_max_m_s,
    )

    # velocity
    fv = (guidance.follow_velocity_north, guidance.follow_velocity_east, guidance.follow_velocity_down)
    e = _difference(v_command, velocity)
    velocity_error = (fv[0] * e[0], fv[1] * e[1], fv[2] * e[2])
    # an error of this size is a manoeuvre, not an offset to be learned
    far = e[0] * e[0] + e[1] * e[1] + e[2] * e[2] > _LEARN_BELOW_M_S * _LEARN_BELOW_M_S
    tilt_held, thrust_held = tilt_held or far, thrust_held or far
    velocity_integral = _integrated(
        m.velocity_integral, velocity_error, dt_s, _VELOCITY_INTEGRAL_MAX, (tilt_held, tilt_held, thrust_held)
    )
    velocity_smoothed, velocity_error_rate = _filtered_rate(
        m.velocity_error_smoothed, velocity_error, dt_s, s.velocity_d_tau_s
    )
    k = s.feedforward_acceleration
    f = specific_force(
        gains.velocity,
        velocity_error,
        velocity_integral,
        velocity_error_rate,
        (
            (ref.a_north_m_s2 if fv[0] == 0.0 else k * ref.a_north_m_s2) - unexplained[0],
            (ref.a_east_m_s2 if fv[1] == 0.0 else k * ref.a_east_m_s2) - unexplained[1],
            (ref.a_down_m_s2 if fv[2] == 0.0 else k * ref.a_down_m_s2) - unexplained[2],
        ),
        s.acceleration_max_m_s2,
        s.lean_max_rad,
    )
    if guidance.aloft == 0.0 and math.hypot(velocity[0], velocity[1]) > _SLIDE_M_S:
        f = (f[0], f[1], min(f[2], -_LIFT_OFF * GRAVITY_M_S2))  # light on its feet it slides before the wind: up
    force_N = (a.mass_kg * f[0], a.mass_kg * f[1], a.mass_kg * f[2])

    # body rates and moment that the reference itself needs
    steering = guidance.steering
    ahead = s.feedforward_inverse > 0.0 and steering.steered == 0.0
    course, rates_ff, moment_ff = reference_needs(a, ref, m.reference_trims, ahead)
    if steering.steered > 0.0:
        rates_ff = (steering.p_rad_s, steering.q_rad_s, steering.r_rad_s)
    moment_ff = (
        moment_ff[0] - a.jxx_kg_m2 * turning[0],
        moment_ff[1] - a.jyy_kg_m2 * turning[1],
        moment_ff[2] - a.jzz_kg_m2 * turning[2],
    )

    # pitch and lean: the attitude whose trim gives the wanted force at the present velocity
    trim = refined(
        a,
        heading_frame(ref.heading_rad, force_N[0], force_N[1], force_N[2]),
        heading_frame(ref.heading_rad, velocity[0], velocity[1], velocity[2]),
        moment_ff[1],
        m.command_trim,
        math.nan,
    )
    target = attitude_of(ref.heading_rad, trim.pitch_rad, trim.lean_rad)
    along_nose_N = rotate_back(q_NB, force_N)[0]

    # an attitude or body rates in place of the trajectory
    if steering.steered > 0.0:
        target = (steering.qw, steering.qx, steering.qy, steering.qz) if steering.steered < 2.0 else q_NB
        along_nose_N = steering.thrust_N

    # attitude
    error, nose = error_quaternion(q_NB, target)
    if s.quaternion_error == 0.0:
        error = error_yxz(q_NB, target)
    k = braked_together(
        error[1], error[2], gains.attitude.y.p, gains.attitude.z.p, s.braking_rad_s2.y, s.braking_rad_s2.z
    )
    error = (braked(error[0], gains.attitude.x.p, s.braking_rad_s2.x), k * error[1], k * error[2])
    roll_held, pitch_held, yaw_held = m.roll_short > 0.0, m.pitch_short > 0.0, m.yaw_short > 0.0
    held = (roll_held, pitch_held, yaw_held)
    attitude_integral = _integrated(m.attitude_integral, error, dt_s, _ANGLE_INTEGRAL_MAX, held)
    rate_target = rate_command(gains.attitude, error, attitude_integral, rates, rates_ff)
    if steering.steered > 1.0:
        rate_target = rates_ff

    # rate
    rate_error = _difference(rate_target, rates)
    rate_integral = _integrated(m.rate_integral, rate_error, dt_s, _RATE_INTEGRAL_MAX, held)
    rate_smoothed, rate_error_rate = _filtered_rate(m.rate_error_smoothed, rate_error, dt_s, s.rate_d_tau_s)
    demand = moment(gains.rate, rate_error, rate_integral, rate_error_rate, moment_ff)

    # allocation
    # thrust makes the flaps work: more of it while the nose is further than 45° off its target
    off = max(0.0, min(1.0, 1.0 - nose / _NEAR_COSINE))
    floor_N = s.thrust_floor_N + off * max(0.0, s.thrust_recover_N - s.thrust_floor_N)
    x = allocate(a, along_nose_N, demand, flow, 0.5 * s.slipstream_floor_N, floor_N)
    command = Command(
        target[0], target[1], target[2], target[3],
        rate_target[0], rate_target[1], rate_target[2],
        x.thrust_left_N, x.thrust_right_N, x.flap_left_rad, x.flap_right_rad,
        v_command[0], v_command[1], v_command[2],
        max(max(x.thrust_short, x.roll_short), max(x.pitch_short, x.yaw_short)),
    )  # fmt: skip
    motor_gain, flap_gain = _approach(dt_s, s.motor_tau_s), _approach(dt_s, s.flap_tau_s)
    memory = Memory(
        position_integral,
        velocity_integral,
        attitude_integral,
        rate_integral,
        velocity_smoothed,
        rate_smoothed,
        course,
        trim,
        _spun_up(m.flow_left_N, x.thrust_left_N, motor_gain),
        _spun_up(m.flow_right_N, x.thrust_right_N, motor_gain),
        Flaps(
            m.flaps.left_rad + flap_gain * (x.flap_left_rad - m.flaps.left_rad),
            m.flaps.right_rad + flap_gain * (x.flap_right_rad - m.flaps.right_rad),
        ),
        disturbance,
        x.thrust_short,
        x.roll_short,
        x.pitch_short,
        x.yaw_short,
    )
    return command, memory, ref
