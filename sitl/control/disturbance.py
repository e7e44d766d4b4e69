"""Disturbance observer: what acts on the vehicle beside the forces and moments that the controller knows of.

Wind, gusts and errors of the model all show as a difference between the acceleration that the navigation state has
and the one that the force laws give for the actuators as they stand. Its low-passed value is taken off the demands
(W.-H. Chen, Disturbance observer based control for nonlinear systems, 2004).
"""

import math
from typing import NamedTuple

from sitl.control.flow import Flow
from sitl.frames import GRAVITY_M_S2
from sitl.jit import kernel
from sitl.model.aerodynamics import flap_loads
from sitl.model.airframe import Airframe
from sitl.navigation import NavState
from sitl.quaternion import Vec3, rotate

_FORCE_MAX = 6.0  # m/s²
_MOMENT_MAX = 20.0  # rad/s²
_FORGET_S = 0.1  # on the ground, which carries what it is asked to


class Disturbance(NamedTuple):
    """Unexplained acceleration in N [m/s²] and angular acceleration in B [rad/s²], and the motion last seen."""

    acceleration_N: Vec3
    angular_B: Vec3
    velocity_N: Vec3
    rates_B: Vec3
    observing: float  # 0: no motion has been seen yet, or none that would tell


class Flaps(NamedTuple):
    """As they stand now, after their lag [rad]."""

    left_rad: float
    right_rad: float


class Bandwidth(NamedTuple):
    """Of the observers of forces and of moments [rad/s]; 0: off."""

    force_rad_s: float
    moment_rad_s: float


@kernel
def none() -> Disturbance:
    zero = (0.0, 0.0, 0.0)
    return Disturbance(zero, zero, zero, zero, 0.0)


@kernel
def modelled(a: Airframe, nav: NavState, x: Flow, flaps: Flaps) -> tuple[Vec3, Vec3]:
    """Acceleration in N [m/s²] and angular acceleration in B [rad/s²] by the controller's own force laws."""
    flap_f, flap_m = flap_loads(a, x.w, x.wake_left, x.wake_right, flaps.left_rad, flaps.right_rad)
    difference = x.thrust_left_N - x.thrust_right_N
    torque = a.torque_coefficient / a.thrust_coefficient * difference
    an, ae, ad = rotate(
        (nav.qw, nav.qx, nav.qy, nav.qz),
        (
            (x.thrust_left_N + x.thrust_right_N + x.wing_force[0]) / a.mass_kg,
            a.side_force_factor * difference / a.mass_kg,
            (x.wing_force[2] + flap_f[2]) / a.mass_kg,
        ),
    )
    p, q, r = nav.p_rad_s, nav.q_rad_s, nav.r_rad_s
    return (an, ae, ad + GRAVITY_M_S2), (
        (torque + x.wing_moment[0] + flap_m[0] - (a.jzz_kg_m2 - a.jyy_kg_m2) * q * r) / a.jxx_kg_m2,
        (x.wing_moment[1] + flap_m[1] - (a.jxx_kg_m2 - a.jzz_kg_m2) * r * p) / a.jyy_kg_m2,
        (a.prop_arm_m * difference + x.wing_moment[2] - (a.jyy_kg_m2 - a.jxx_kg_m2) * p * q) / a.jzz_kg_m2,
    )


@kernel
def _tracked(d: Vec3, before: Vec3, now: Vec3, model: Vec3, rad_s: float, limit: float, dt_s: float) -> Vec3:
    """ḋ = L ((v̇ − model) − d), each axis within ±limit."""
    k = 1.0 - math.exp(-rad_s * dt_s)
    x = d[0] + k * ((now[0] - before[0]) / dt_s - model[0] - d[0])
    y = d[1] + k * ((now[1] - before[1]) / dt_s - model[1] - d[1])
    z = d[2] + k * ((now[2] - before[2]) / dt_s - model[2] - d[2])
    return max(-limit, min(limit, x)), max(-limit, min(limit, y)), max(-limit, min(limit, z))


@kernel
def _faded(d: Vec3, dt_s: float) -> Vec3:
    k = math.exp(-dt_s / _FORGET_S)
    return k * d[0], k * d[1], k * d[2]


@kernel
def observed(
    a: Airframe, d: Disturbance, nav: NavState, flow: Flow, flaps: Flaps, bandwidth: Bandwidth, aloft: bool, dt_s: float
) -> Disturbance:
    """The disturbance `dt_s` later. Not aloft it fades: the ground's reaction is nothing to be learned."""
    velocity = (nav.v_north_m_s, nav.v_east_m_s, nav.v_down_m_s)
    rates = (nav.p_rad_s, nav.q_rad_s, nav.r_rad_s)
    acceleration, angular = d.acceleration_N, d.angular_B
    if not aloft:
        acceleration, angular = _faded(acceleration, dt_s), _faded(angular, dt_s)
    elif d.observing > 0.0:
        linear, turning = modelled(a, nav, flow, flaps)
        acceleration = _tracked(acceleration, d.velocity_N, velocity, linear, bandwidth.force_rad_s, _FORCE_MAX, dt_s)
        angular = _tracked(angular, d.rates_B, rates, turning, bandwidth.moment_rad_s, _MOMENT_MAX, dt_s)
    return Disturbance(acceleration, angular, velocity, rates, 1.0)
