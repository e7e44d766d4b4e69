"""One fixed step of the plant: classical fourth-order Runge-Kutta."""

import math

from sitl.jit import kernel
from sitl.model.airframe import Airframe, Gear
from sitl.model.derivative import ActuatorCommand, Actuators, derivative, loads, rates_of_change, total
from sitl.model.propulsion import rotor_speed
from sitl.model.rigid_body import State, moved
from sitl.quaternion import Vec3


@kernel
def apply_ideal_actuators(a: Airframe, lag: Actuators, s: State, command: ActuatorCommand) -> State:
    """The state with those actuators that have no lag already at their command."""
    left, right, flap_l, flap_r = s.rotor_left_rad_s, s.rotor_right_rad_s, s.flap_left_rad, s.flap_right_rad
    if lag.motor_tau_s <= 0.0:
        left, right = rotor_speed(a, command.thrust_left_N), rotor_speed(a, command.thrust_right_N)
    if lag.flap_tau_s <= 0.0:
        flap_l, flap_r = command.flap_left_rad, command.flap_right_rad
    return State(
        s.north_m, s.east_m, s.down_m, s.v_north_m_s, s.v_east_m_s, s.v_down_m_s,
        s.qw, s.qx, s.qy, s.qz, s.p_rad_s, s.q_rad_s, s.r_rad_s, left, right, flap_l, flap_r,
    )  # fmt: skip


@kernel
def normalised(s: State) -> State:
    """The state with its quaternion back at unit length."""
    k = 1.0 / math.sqrt(s.qw * s.qw + s.qx * s.qx + s.qy * s.qy + s.qz * s.qz)
    return State(
        s.north_m, s.east_m, s.down_m, s.v_north_m_s, s.v_east_m_s, s.v_down_m_s,
        k * s.qw, k * s.qx, k * s.qy, k * s.qz, s.p_rad_s, s.q_rad_s, s.r_rad_s,
        s.rotor_left_rad_s, s.rotor_right_rad_s, s.flap_left_rad, s.flap_right_rad,
    )  # fmt: skip


@kernel
def step(a: Airframe, g: Gear, lag: Actuators, s: State, command: ActuatorCommand, wind_N: Vec3, h_s: float) -> State:
    """The state `h_s` seconds later under a constant command and wind."""
    s = apply_ideal_actuators(a, lag, s, command)
    force, moment = total(loads(a, g, s, wind_N))
    return step_from(a, g, lag, s, command, wind_N, h_s, force, moment)


@kernel
def step_from(
    a: Airframe, g: Gear, lag: Actuators, s: State, command: ActuatorCommand, wind_N: Vec3, h_s: float,
    force_B: Vec3, moment_B: Vec3,
) -> State:  # fmt: skip
    """`step` where what acts in `s`, whose ideal actuators are at their command, is known: the `total` of its loads."""
    k1 = rates_of_change(a, lag, s, command, force_B, moment_B)
    k2 = derivative(a, g, lag, moved(s, 0.5 * h_s, k1), command, wind_N)
    k3 = derivative(a, g, lag, moved(s, 0.5 * h_s, k2), command, wind_N)
    k4 = derivative(a, g, lag, moved(s, h_s, k3), command, wind_N)
    s = moved(s, h_s / 6.0, k1)
    s = moved(s, h_s / 3.0, k2)
    s = moved(s, h_s / 3.0, k3)
    return normalised(moved(s, h_s / 6.0, k4))
