"""The margin function against loops whose margins are known in closed form."""

import math

import numpy as np
import pytest

from sitl.margins import margins, response

W = np.geomspace(1e-3, 1e4, 20_000)


@pytest.mark.parametrize("damping", [0.2, 0.5, 0.7, 1.0])
def test_a_second_order_loop_has_the_crossover_and_phase_margin_of_the_textbook(damping: float) -> None:
    natural = 3.0
    m = margins(W, natural**2 / (1j * W * (1j * W + 2.0 * damping * natural)))
    root = math.sqrt(math.sqrt(1.0 + 4.0 * damping**4) - 2.0 * damping**2)
    assert m.crossover_rad_s == pytest.approx(natural * root, rel=1e-4)
    assert m.phase_deg == pytest.approx(math.degrees(math.atan(2.0 * damping / root)), abs=0.01)
    assert m.gain_up == math.inf
    assert m.gain_down == 0.0


@pytest.mark.parametrize("damping", [0.5, 0.7, 1.0])
def test_the_bandwidth_is_where_the_closed_second_order_loop_has_lost_3_db(damping: float) -> None:
    m = margins(W, 9.0 / (1j * W * (1j * W + 6.0 * damping)))
    x = 1.0 - 2.0 * damping**2
    assert m.bandwidth_rad_s == pytest.approx(3.0 * math.sqrt(x + math.sqrt(x * x + 1.0)), rel=1e-3)


def test_an_integrator_with_dead_time_has_the_gain_margin_of_the_textbook() -> None:
    gain, dead_s = 4.0, 0.05
    m = margins(W, gain / (1j * W) * np.exp(-1j * W * dead_s))
    assert m.gain_up == pytest.approx(math.pi / (2.0 * gain * dead_s), rel=1e-3)
    assert m.phase_deg == pytest.approx(90.0 - math.degrees(gain * dead_s), abs=0.01)


def test_a_loop_around_an_unstable_plant_has_a_least_gain_as_well() -> None:
    m = margins(W, 5.0 * (1j * W + 1.0) / (1j * W * (1j * W - 1.0)))
    assert m.gain_down == pytest.approx(0.2, rel=1e-3)  # closed loop s² + (k − 1) s + k with k = 5: stable for k > 1
    assert m.gain_up == math.inf


def test_the_sensitivity_peak_of_a_pure_integrator_is_one() -> None:
    assert margins(W, 5.0 / (1j * W)).sensitivity == pytest.approx(1.0, abs=1e-6)


def test_a_discrete_integrator_answers_as_its_closed_form() -> None:
    dt = 0.01
    w = np.geomspace(0.1, 300.0, 50)
    got = response(np.array([[1.0]]), np.array([2.0]), np.array([3.0]), dt, w)
    assert got == pytest.approx(6.0 / (np.exp(1j * w * dt) - 1.0))
