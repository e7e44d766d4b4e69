"""The linearisation against closed forms, and against the closed loop that it stands for."""

import math

import numpy as np
import pytest

from sitl.closed_loop import NOISE_COLUMNS, TRACE_COLUMNS, Controller, Plant, run, start
from sitl.frames import GRAVITY_M_S2
from sitl.model.rigid_body import State
from sitl.model.sensors import NOISELESS
from sitl.model.wind import Wind
from sitl.records import packed
from sitl.reproduce.linear import MEASURED, Design, Linear, deviation, guidance, hover, linearised, moved, read_as
from sitl.reproduce.loops import CASCADES, IDEAL, axis_margins, design, open_loop, poles, stable, unstable_zero
from sitl.vehicle import Vehicle, load_vehicle

NORTH, V_NORTH, V_EAST, V_DOWN, PITCH, LEAN, P, Q, R = 0, 3, 4, 5, 7, 8, 9, 10, 11


@pytest.fixture(scope="module")
def paper() -> Design:
    return design("yawsitter")


@pytest.fixture(scope="module")
def linear(paper: Design) -> Linear:
    return linearised(paper)


def wingless(d: Design) -> Design:
    """A rigid body with propellers and flaps, but for a wing too small to matter."""
    return d._replace(airframe=d.airframe._replace(wing_area_m2=1e-9, wing_moment_area_m2=1e-9, side_force_factor=0.0))


def test_without_a_wing_it_is_the_double_integrator_that_tilts_its_weight(paper: Design) -> None:
    d = wingless(paper)
    a, h = d.airframe, d.dt_s
    x = linearised(d)
    assert x.A[NORTH, V_NORTH] == pytest.approx(h, rel=1e-6)
    assert x.A[V_NORTH, V_NORTH] == pytest.approx(1.0, abs=1e-9)
    # nose back: thrust pushes south; right wing up: it pushes east
    assert x.A[V_NORTH, PITCH] == pytest.approx(-GRAVITY_M_S2 * h, rel=1e-5)
    assert x.A[NORTH, PITCH] == pytest.approx(-0.5 * GRAVITY_M_S2 * h * h, rel=1e-3)
    assert x.A[V_EAST, LEAN] == pytest.approx(GRAVITY_M_S2 * h, rel=1e-5)
    assert x.B[V_DOWN, :2] == pytest.approx([-h / a.mass_kg] * 2, rel=1e-6)
    assert x.B[R, :2] == pytest.approx([a.prop_arm_m * h / a.jzz_kg_m2, -a.prop_arm_m * h / a.jzz_kg_m2], rel=1e-6)
    assert x.B[LEAN, 0] == pytest.approx(0.5 * a.prop_arm_m * h * h / a.jzz_kg_m2, rel=1e-3)


def test_a_flap_turns_it_by_the_slipstreams_pressure(paper: Design) -> None:
    d = wingless(paper)
    a, h = d.airframe, d.dt_s
    pressure = 0.5 * a.mass_kg * GRAVITY_M_S2 / a.wake_area_m2 / 2.0  # q = ½ρV², V² = T / (ρ π R_s²)
    force = pressure * a.flap_area_m2
    x = linearised(d)
    assert x.B[Q, 2] == pytest.approx(force * a.chord_m * a.flap_moment_slope * h / a.jyy_kg_m2, rel=1e-4)
    assert x.B[P, 2] == pytest.approx(force * a.flap_roll_arm_m * a.flap_lift_slope * h / a.jxx_kg_m2, rel=1e-4)


def test_motors_and_flaps_lag_by_their_time_constants(paper: Design) -> None:
    lag = IDEAL._replace(motor_tau_s=0.04, flap_tau_s=0.03)
    x = linearised(paper._replace(actuators=lag), hover(paper))
    h = paper.dt_s
    assert np.diag(x.A)[12:] == pytest.approx([math.exp(-h / 0.04)] * 2 + [math.exp(-h / 0.03)] * 2, rel=1e-6)


def rate_gains(d: Design) -> list[float]:
    """From a measured rate to a moment: the attitude loop's derivative acts on it as well."""
    return [r.p * (1.0 + attitude.d) for r, attitude in zip(d.gains.rate, d.gains.attitude, strict=True)]


def inertia(d: Design) -> tuple[float, float, float]:
    return d.airframe.jxx_kg_m2, d.airframe.jyy_kg_m2, d.airframe.jzz_kg_m2


def test_the_rate_loop_has_the_pole_of_a_sampled_integrator(paper: Design, linear: Linear) -> None:
    z = np.exp(poles(linear, CASCADES[0]) * paper.dt_s)
    for gain, j in zip(rate_gains(paper), inertia(paper), strict=True):
        expected = 1.0 - gain * paper.dt_s / j
        assert np.abs(z - expected).min() < 0.01, (expected, z)


def test_the_open_rate_loop_is_that_integrator(paper: Design, linear: Linear) -> None:
    w = np.geomspace(1.0, 1000.0, 20)
    loop = open_loop(linear, paper.gains, CASCADES[0], 0, w)
    z = np.exp(1j * w * paper.dt_s)
    assert loop == pytest.approx(rate_gains(paper)[0] / paper.airframe.jxx_kg_m2 * paper.dt_s / (z - 1.0), rel=1e-3)


@pytest.mark.parametrize("name", ["yawsitter", "yawsitter-real"])
def test_the_matrices_fly_as_the_vehicle_does(name: str) -> None:
    d = design(name)
    at = hover(design(name, IDEAL))
    m = linearised(d, at).closed(np.ones(MEASURED))
    x = np.zeros(m.shape[0])
    x[[0, 1, 2, 4, PITCH, LEAN, P]] = 1e-4, -2e-4, 1.5e-4, 3e-4, 1e-4, -1e-4, 2e-4
    steps = 400
    trace = np.zeros((steps + 1, len(TRACE_COLUMNS)))
    plant = Plant(d.airframe, d.gear, d.actuators, NOISELESS, Wind(0.0, 0.0, 0.0, 0.0), 1)
    controller = Controller(d.airframe, d.gains, d.settings, 0.0, Vehicle(load_vehicle(name)).tuning())
    begin = start(controller, moved(at.state, x[:16]))._replace(memory=at.memory)
    noise = np.zeros((0, NOISE_COLUMNS))
    run(packed(plant), packed(controller), guidance(), begin, noise, 1_000_000, round(d.dt_s * 1e6), steps + 1, trace)
    for k in range(steps + 1):
        flown = deviation(at.state, State(*trace[k, 1:18].tolist()))
        # ideal actuators are at this step's command already, which the plant's state takes over one step later
        assert flown[:12] == pytest.approx(x[:12], abs=4e-6), k
        x = m @ x
    assert np.abs(x[:12]).max() > 1e-5  # there was something to compare


def test_the_reading_with_the_inverse_inertia_needs_the_rate_that_its_pole_says(paper: Design) -> None:
    d = paper._replace(gains=read_as(paper.gains, "J⁻¹ × bracket", paper.airframe))
    needed_hz = max(gain / (2.0 * j) for gain, j in zip(rate_gains(d), inertia(d), strict=True))
    for factor, expected in ((0.95, False), (1.05, True)):
        faster = d._replace(dt_s=1.0 / (factor * needed_hz))
        assert stable(poles(linearised(faster, hover(paper)), CASCADES[0])) is expected


def test_the_bracket_is_stable_with_both_gain_sets_and_the_other_readings_are_not() -> None:
    for name in ("yawsitter", "yawsitter-real"):
        d, at = design(name), hover(design(name, IDEAL))
        for reading, expected in (("bracket", True), ("J⁻¹ × bracket", False), ("J × bracket", False)):
            read = d._replace(gains=read_as(d.gains, reading, d.airframe))
            assert stable(poles(linearised(read, at), CASCADES[-1])) is expected, (name, reading)


def test_every_loop_of_the_bracket_has_margins_on_every_axis(paper: Design, linear: Linear) -> None:
    rows = axis_margins(linear, paper.gains)
    assert [loop for loop, _, _, _ in rows] == [c.loop for c in CASCADES for _ in range(3)]
    for _, _, ok, m in rows:
        assert ok
        assert m is not None
        assert m.phase_deg > 30.0
        assert m.crossover_rad_s > 0.0


def test_the_unstable_zero_is_where_weight_and_flaps_put_it(paper: Design) -> None:
    a = paper.airframe
    lever = a.chord_m * abs(a.flap_moment_slope) / a.flap_lift_slope
    assert unstable_zero() == pytest.approx(math.sqrt(a.mass_kg * GRAVITY_M_S2 * lever / a.jyy_kg_m2), rel=0.05)
