"""All forces and moments of the plant, by cause, and the state's rates that follow from them."""

from typing import NamedTuple

from sitl.frames import GRAVITY_M_S2
from sitl.jit import kernel
from sitl.model.aerodynamics import flap_loads, wing_loads
from sitl.model.airframe import Airframe, Gear
from sitl.model.ground import ground_loads
from sitl.model.propulsion import rotor_speed, side_force, thrust, thrust_loads, wake_speed
from sitl.model.rigid_body import State, accelerations
from sitl.quaternion import Vec3, rotate_back


class Actuators(NamedTuple):
    """First-order lags of motor speed and flap angle [s]; 0: ideal, the command is followed at once."""

    motor_tau_s: float
    flap_tau_s: float


class ActuatorCommand(NamedTuple):
    thrust_left_N: float
    thrust_right_N: float
    flap_left_rad: float
    flap_right_rad: float


class Loads(NamedTuple):
    """Forces [N] and moments [N·m] about the CM, in B, by cause."""

    gravity_force: Vec3
    thrust_force: Vec3
    thrust_moment: Vec3
    side_force: Vec3
    wing_force: Vec3
    wing_moment: Vec3
    flap_force: Vec3
    flap_moment: Vec3
    drag_force: Vec3
    ground_force: Vec3
    ground_moment: Vec3
    feet_down: int


class Load(NamedTuple):
    """One cause's force [N] and moment about the CM [N·m], in B."""

    force_B: Vec3
    moment_B: Vec3


def by_cause(x: Loads) -> dict[str, Load]:
    """The loads one by one, under the names that people see."""
    zero = (0.0, 0.0, 0.0)
    return {
        "gravity": Load(x.gravity_force, zero),
        "thrust": Load(x.thrust_force, x.thrust_moment),
        "side_force": Load(x.side_force, zero),
        "aero": Load(x.wing_force, x.wing_moment),
        "flaps": Load(x.flap_force, x.flap_moment),
        "drag": Load(x.drag_force, zero),
        "ground": Load(x.ground_force, x.ground_moment),
    }


@kernel
def airspeed(s: State, wind_N: Vec3) -> Vec3:
    """(u, v, w) [m/s]: the CM's velocity relative to the air, in B."""
    return rotate_back(
        (s.qw, s.qx, s.qy, s.qz),
        (s.v_north_m_s - wind_N[0], s.v_east_m_s - wind_N[1], s.v_down_m_s - wind_N[2]),
    )


@kernel
def loads(a: Airframe, g: Gear, s: State, wind_N: Vec3) -> Loads:
    """Everything that acts on the vehicle in state `s` and the given wind (the air's own motion in N, m/s)."""
    u, v, w = airspeed(s, wind_N)
    wake_left = wake_speed(a, thrust(a, s.rotor_left_rad_s), u)
    wake_right = wake_speed(a, thrust(a, s.rotor_right_rad_s), u)
    thrust_f, thrust_m = thrust_loads(a, s.rotor_left_rad_s, s.rotor_right_rad_s)
    wing_f, wing_m = wing_loads(a, u, w, wake_left, wake_right)
    flap_f, flap_m = flap_loads(a, w, wake_left, wake_right, s.flap_left_rad, s.flap_right_rad)
    ground_f, ground_m, feet = ground_loads(g, s)
    weight = a.mass_kg * GRAVITY_M_S2
    # optional drag accelerations K_v v + K_t v |v| of the paper's parameter table
    drag_u = -a.mass_kg * (a.drag_linear_1_s + a.drag_quadratic_1_m * abs(u)) * u
    drag_v = -a.mass_kg * (a.drag_linear_1_s + a.drag_quadratic_1_m * abs(v)) * v
    drag_w = -a.mass_kg * (a.drag_linear_1_s + a.drag_quadratic_1_m * abs(w)) * w
    return Loads(
        rotate_back((s.qw, s.qx, s.qy, s.qz), (0.0, 0.0, weight)),
        thrust_f,
        thrust_m,
        (0.0, side_force(a, s.rotor_left_rad_s, s.rotor_right_rad_s), 0.0),
        wing_f,
        wing_m,
        flap_f,
        flap_m,
        (drag_u, drag_v, drag_w),
        ground_f,
        ground_m,
        feet,
    )


@kernel
def total(x: Loads) -> tuple[Vec3, Vec3]:
    """Sum of all forces but gravity, and of all moments, in B."""
    return (
        (
            x.thrust_force[0] + x.wing_force[0] + x.drag_force[0] + x.ground_force[0],
            x.side_force[1] + x.drag_force[1] + x.ground_force[1],
            x.wing_force[2] + x.flap_force[2] + x.drag_force[2] + x.ground_force[2],
        ),
        (
            x.thrust_moment[0] + x.wing_moment[0] + x.flap_moment[0] + x.ground_moment[0],
            x.wing_moment[1] + x.flap_moment[1] + x.ground_moment[1],
            x.thrust_moment[2] + x.wing_moment[2] + x.ground_moment[2],
        ),
    )


@kernel
def derivative(a: Airframe, g: Gear, lag: Actuators, s: State, command: ActuatorCommand, wind_N: Vec3) -> State:
    """d/dt of the state (as a State whose fields are rates)."""
    force, moment = total(loads(a, g, s, wind_N))
    return rates_of_change(a, lag, s, command, force, moment)


@kernel
def rates_of_change(
    a: Airframe, lag: Actuators, s: State, command: ActuatorCommand, force_B: Vec3, moment_B: Vec3
) -> State:
    """`derivative` where all forces but gravity and all moments are known; q̇ = ½ q ⊗ ω."""
    linear, angular = accelerations(a, s, force_B, moment_B)
    p, q, r = s.p_rad_s, s.q_rad_s, s.r_rad_s
    rotor_rate = 1.0 / lag.motor_tau_s if lag.motor_tau_s > 0.0 else 0.0
    flap_rate = 1.0 / lag.flap_tau_s if lag.flap_tau_s > 0.0 else 0.0
    return State(
        s.v_north_m_s,
        s.v_east_m_s,
        s.v_down_m_s,
        linear[0],
        linear[1],
        linear[2],
        0.5 * (-s.qx * p - s.qy * q - s.qz * r),
        0.5 * (s.qw * p + s.qy * r - s.qz * q),
        0.5 * (s.qw * q + s.qz * p - s.qx * r),
        0.5 * (s.qw * r + s.qx * q - s.qy * p),
        angular[0],
        angular[1],
        angular[2],
        (rotor_speed(a, command.thrust_left_N) - s.rotor_left_rad_s) * rotor_rate,
        (rotor_speed(a, command.thrust_right_N) - s.rotor_right_rad_s) * rotor_rate,
        (command.flap_left_rad - s.flap_left_rad) * flap_rate,
        (command.flap_right_rad - s.flap_right_rad) * flap_rate,
    )
