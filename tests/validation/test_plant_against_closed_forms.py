"""The plant against results that can be written down without it."""

import math

import numpy as np
import pytest

from sitl.frames import GRAVITY_M_S2, standing
from sitl.model.aerodynamics import coefficients, panel, separated
from sitl.model.derivative import ActuatorCommand, Actuators, derivative, loads, total
from sitl.model.integrate import step
from sitl.model.propulsion import rotor_speed, wake_speed
from sitl.model.rigid_body import State
from sitl.quaternion import rotate
from sitl.vehicle_spec import load_vehicle

IDEAL = Actuators(0.0, 0.0)
STILL = (0.0, 0.0, 0.0)
OFF = ActuatorCommand(0.0, 0.0, 0.0, 0.0)
SPEC = load_vehicle("yawsitter")
A, G = SPEC.airframe.airframe, SPEC.airframe.gear
VACUUM = A._replace(air_density_kg_m3=1e-12)


def high_up(**fields: float) -> State:
    zero = dict.fromkeys(State._fields, 0.0)
    return State(**{**zero, "qw": 1.0, "down_m": -1000.0, **fields})


def flown(s: State, seconds: float, airframe=A, lag=IDEAL, command=OFF, wind=STILL, h=0.002) -> State:
    for _ in range(round(seconds / h)):
        s = step(airframe, G, lag, s, command, wind, h)
    return s


def angular_momentum_N(s: State) -> np.ndarray:
    body = (A.jxx_kg_m2 * s.p_rad_s, A.jyy_kg_m2 * s.q_rad_s, A.jzz_kg_m2 * s.r_rad_s)
    return np.array(rotate((s.qw, s.qx, s.qy, s.qz), body))


def spin_energy(s: State) -> float:
    return 0.5 * (A.jxx_kg_m2 * s.p_rad_s**2 + A.jyy_kg_m2 * s.q_rad_s**2 + A.jzz_kg_m2 * s.r_rad_s**2)


def test_a_body_in_vacuum_falls_by_half_g_t_squared() -> None:
    s = flown(high_up(), 3.0, VACUUM)
    assert s.down_m + 1000.0 == pytest.approx(0.5 * GRAVITY_M_S2 * 9.0, abs=1e-8)
    assert s.v_down_m_s == pytest.approx(GRAVITY_M_S2 * 3.0, abs=1e-9)


def test_torque_free_spin_keeps_angular_momentum_in_the_world_and_energy() -> None:
    s0 = high_up(p_rad_s=1.0, q_rad_s=2.0, r_rad_s=-3.0)
    s1 = flown(s0, 10.0, VACUUM)
    assert angular_momentum_N(s1) == pytest.approx(angular_momentum_N(s0), abs=1e-9)
    assert spin_energy(s1) == pytest.approx(spin_energy(s0), rel=1e-9)
    assert (s1.p_rad_s, s1.q_rad_s) != pytest.approx((1.0, 2.0), abs=0.1)  # it does nutate


@pytest.mark.parametrize(
    ("rates", "axis", "inertia"),
    [
        ((0.0, 1.0, 1.0), "p_rad_s", (A.jyy_kg_m2 - A.jzz_kg_m2) / A.jxx_kg_m2),
        ((1.0, 0.0, 1.0), "q_rad_s", (A.jzz_kg_m2 - A.jxx_kg_m2) / A.jyy_kg_m2),
        ((1.0, 1.0, 0.0), "r_rad_s", (A.jxx_kg_m2 - A.jyy_kg_m2) / A.jzz_kg_m2),
    ],
)
def test_gyroscopic_coupling_has_eulers_sign_on_each_axis(rates, axis: str, inertia: float) -> None:
    p, q, r = rates
    k = derivative(VACUUM, G, IDEAL, high_up(p_rad_s=p, q_rad_s=q, r_rad_s=r), OFF, STILL)
    assert getattr(k, axis) == pytest.approx(inertia, abs=1e-9)


def test_belly_first_fall_ends_at_the_flat_plates_terminal_velocity() -> None:
    heavy = A._replace(jyy_kg_m2=1e9)  # keeps it level, so that the flow stays at 90 degrees
    s = flown(high_up(), 30.0, heavy)
    drag_area = A.wing_area_m2 * (A.plate_drag + A.drag_at_zero)
    expected = math.sqrt(2 * A.mass_kg * GRAVITY_M_S2 / (A.air_density_kg_m3 * drag_area))
    assert s.v_down_m_s == pytest.approx(expected, rel=1e-3)


def test_the_wing_at_90_degrees_is_a_flat_plate() -> None:
    lift, drag, moment = coefficients(A, math.pi / 2, 0.0, 1.0)
    assert lift == pytest.approx(0.0, abs=1e-9)
    assert drag == pytest.approx(A.plate_drag + A.drag_at_zero, rel=1e-9)
    assert moment == pytest.approx(-A.plate_drag / 4, rel=1e-9)  # pressed at half chord, a quarter behind the AC


def test_attached_flow_follows_the_papers_linear_coefficients() -> None:
    alpha = math.radians(4.0)
    lift, drag, moment = coefficients(A, alpha, math.cos(alpha), math.sin(alpha))
    expected = -0.2477 + 4.4 * alpha
    assert lift == pytest.approx(expected, abs=2e-3)
    assert drag == pytest.approx(0.05 + expected**2 / (math.pi * 0.8 * 4.5), abs=2e-3)
    assert moment == pytest.approx(-0.0390 - 0.2 * alpha, abs=2e-3)


def test_half_of_the_lift_is_gone_at_the_stall_angle_on_both_sides() -> None:
    for alpha in (A.stall_angle_rad, -A.stall_angle_rad):
        assert separated(A, alpha) == pytest.approx(0.5, abs=1e-4)
    assert separated(A, 0.0) < 1e-4
    assert separated(A, math.pi) == pytest.approx(1.0)


def test_coefficients_are_continuous_across_reversed_flow() -> None:
    just_below = coefficients(A, math.pi - 1e-9, -1.0, 1e-9)
    just_above = coefficients(A, -math.pi + 1e-9, -1.0, -1e-9)
    assert just_below == pytest.approx(just_above, abs=1e-6)


def test_wake_speed_solves_the_papers_momentum_equation() -> None:
    for u in (0.0, 3.0, 15.0):
        wake = wake_speed(A, 5.37, u)
        induced = wake - u
        assert A.air_density_kg_m3 * A.wake_area_m2 * induced * (induced + u) == pytest.approx(5.37, rel=1e-12)
    assert wake_speed(A, A.mass_kg * GRAVITY_M_S2 / 2, 0.0) == pytest.approx(14.5, abs=0.1)


def test_wake_speed_is_smooth_through_hover() -> None:
    h = 1e-4
    below = (wake_speed(A, 5.0, 0.0) - wake_speed(A, 5.0, -h)) / h
    above = (wake_speed(A, 5.0, h) - wake_speed(A, 5.0, 0.0)) / h
    assert below == pytest.approx(above, rel=1e-3)


def mirrored(s: State) -> State:
    """The state seen in a mirror in the plane of north and down (body: forward and down)."""
    return s._replace(
        east_m=-s.east_m, v_east_m_s=-s.v_east_m_s, qx=-s.qx, qz=-s.qz, p_rad_s=-s.p_rad_s, r_rad_s=-s.r_rad_s,
        rotor_left_rad_s=s.rotor_right_rad_s, rotor_right_rad_s=s.rotor_left_rad_s,
        flap_left_rad=s.flap_right_rad, flap_right_rad=s.flap_left_rad,
    )  # fmt: skip


def test_left_and_right_are_mirror_images() -> None:
    rng = np.random.default_rng(7)
    for _ in range(200):
        x = rng.normal(size=17)
        q = x[6:10] / np.linalg.norm(x[6:10])
        rotors = 700 + 100 * x[13:15]
        s = State(0.0, 0.0, -50.0, *(5 * x[3:6]), *q, *x[10:13], *rotors, *(0.2 * x[15:17]))
        wind = (1.0, 2.0, -0.5)
        force, moment = total(loads(A, G, s, wind))
        m_force, m_moment = total(loads(A, G, mirrored(s), (1.0, -2.0, -0.5)))
        assert m_force == pytest.approx((force[0], -force[1], force[2]), abs=1e-9)
        assert m_moment == pytest.approx((-moment[0], moment[1], -moment[2]), abs=1e-9)


def test_more_thrust_on_the_left_yaws_to_the_right_and_pushes_to_the_right() -> None:
    left, right = rotor_speed(A, 6.0), rotor_speed(A, 5.0)
    x = loads(A, G, high_up(rotor_left_rad_s=left, rotor_right_rad_s=right), STILL)
    assert x.thrust_moment[2] == pytest.approx(A.prop_arm_m * 1.0)
    assert x.side_force[1] == pytest.approx(A.side_force_factor * 1.0)
    assert x.thrust_force[0] == pytest.approx(11.0)


def test_unequal_slipstreams_roll_and_yaw_the_wing_by_their_lever_alone() -> None:
    left, right = rotor_speed(A, 6.0), rotor_speed(A, 5.0)
    uneven = high_up(rotor_left_rad_s=left, rotor_right_rad_s=right)
    each = [loads(A, G, high_up(rotor_left_rad_s=w, rotor_right_rad_s=w), STILL).wing_force for w in (left, right)]
    x = loads(A, G, uneven, STILL)
    assert x.wing_moment[0] == pytest.approx(A.wake_arm_m * 0.5 * (each[1][2] - each[0][2]))
    assert x.wing_moment[2] == pytest.approx(A.wake_arm_m * 0.5 * (each[0][0] - each[1][0]))
    assert abs(x.wing_moment[0]) > 0.01
    without = loads(A._replace(wake_arm_m=0.0), G, uneven, STILL)
    assert (without.wing_moment[0], without.wing_moment[2]) == (0.0, 0.0)
    assert without.wing_force == x.wing_force


def test_trailing_edges_down_pitch_the_nose_down_and_lift() -> None:
    rotors = {"rotor_left_rad_s": 800.0, "rotor_right_rad_s": 800.0}
    x = loads(A, G, high_up(**rotors, flap_left_rad=0.1, flap_right_rad=0.1), STILL)
    assert x.flap_moment[1] < 0.0
    assert x.flap_force[2] < 0.0


def test_runge_kutta_converges_at_fourth_order() -> None:
    hover = ActuatorCommand(5.5, 5.2, 0.05, -0.02)
    s0 = high_up(qw=math.cos(0.8), qy=math.sin(0.8), v_north_m_s=2.0)

    def at(h: float) -> np.ndarray:
        return np.array(flown(s0, 0.4, command=hover, h=h))

    exact = at(0.0005)
    coarse, fine = np.abs(at(0.02) - exact).max(), np.abs(at(0.01) - exact).max()
    assert coarse / fine > 10.0  # 16 in the limit


def test_a_lagging_motor_and_flap_approach_their_command_exponentially() -> None:
    lag = Actuators(0.04, 0.03)
    s = flown(high_up(), 0.06, lag=lag, command=ActuatorCommand(5.0, 5.0, 0.2, -0.1))
    assert s.rotor_left_rad_s == pytest.approx(rotor_speed(A, 5.0) * (1 - math.exp(-1.5)), rel=1e-5)
    assert s.flap_left_rad == pytest.approx(0.2 * (1 - math.exp(-2.0)), rel=1e-5)


def test_energy_is_only_lost_in_gliding_flight() -> None:
    s = high_up(v_north_m_s=12.0, qw=math.cos(0.05), qy=math.sin(0.05))

    def energy(s: State) -> float:
        speed2 = s.v_north_m_s**2 + s.v_east_m_s**2 + s.v_down_m_s**2
        return 0.5 * A.mass_kg * speed2 - A.mass_kg * GRAVITY_M_S2 * s.down_m

    held = A._replace(jyy_kg_m2=1e9)
    before = energy(s)
    for _ in range(50):
        s = flown(s, 0.1, held)
        assert energy(s) < before
        before = energy(s)


def test_an_empty_flow_makes_no_force() -> None:
    assert panel(A, 0.0, 0.0, 1.0) == (0.0, 0.0, 0.0)


def test_it_stands_on_its_tail_without_creeping() -> None:
    q = standing(0.3, G.standing_pitch_rad)
    s = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *q, *([0.0] * 7))
    s = flown(s, 20.0)
    assert math.hypot(s.north_m, s.east_m) < 1e-3
    assert abs(s.down_m) < 1e-3
    assert loads(A, G, s, STILL).feet_down == 4


def test_dropped_at_an_angle_it_tips_over_and_comes_to_rest_lying() -> None:
    q = standing(0.0, G.standing_pitch_rad - 1.0)
    s = State(0.0, 0.0, -0.3, 0.0, 0.0, 0.0, *q, *([0.0] * 7))
    s = flown(s, 10.0)
    nose_down_component = rotate((s.qw, s.qx, s.qy, s.qz), (1.0, 0.0, 0.0))[2]
    assert nose_down_component > -0.5  # the nose no longer points up
    assert math.hypot(s.v_north_m_s, s.v_east_m_s, s.v_down_m_s) < 0.05
