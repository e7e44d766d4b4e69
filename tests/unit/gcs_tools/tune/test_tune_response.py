"""Step figures and frequency responses, against second-order systems in closed form."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs_tools.tune.frequency import Record, closed_loop, estimate, evenly
from gcs_tools.tune.response import TooFewSamplesError, effort, step_figures

DT_S = 0.002


def second_order(t: np.ndarray, wn: float, zeta: float) -> np.ndarray:
    """Unit step response of ω² / (s² + 2ζω s + ω²), ζ < 1; 0 before t = 0."""
    wd, sigma = wn * math.sqrt(1.0 - zeta * zeta), zeta * wn
    y = 1.0 - np.exp(-sigma * t) * (np.cos(wd * t) + sigma / wd * np.sin(wd * t))
    return np.where(t < 0.0, 0.0, y)


damping = st.floats(0.2, 0.95)
frequency = st.floats(0.5, 20.0)


def time_of(wn: float, zeta: float, first_s: float = 0.0) -> np.ndarray:
    return np.arange(first_s, 12.0 / (zeta * wn), min(DT_S, 0.01 / wn))


@settings(max_examples=25)
@given(frequency, damping, st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 0.01), st.floats(-10.0, 10.0))
def test_overshoot_and_its_time_are_those_of_the_closed_form(wn: float, zeta: float, size: float, start: float) -> None:
    t = time_of(wn, zeta)
    f = step_figures(t, start + size * second_order(t, wn, zeta), start, size)
    root = math.sqrt(1.0 - zeta * zeta)
    assert f.overshoot == pytest.approx(math.exp(-math.pi * zeta / root), rel=1e-3, abs=1e-6)
    assert f.peak_s == pytest.approx(math.pi / (wn * root), rel=0.02)


@settings(max_examples=25)
@given(frequency, damping)
def test_settling_is_within_the_envelope_and_near_it(wn: float, zeta: float) -> None:
    """The error's envelope is exp(−ζωt)/√(1−ζ²); the last crossing comes at most half a period before its own."""
    t = time_of(wn, zeta)
    f = step_figures(t, second_order(t, wn, zeta), 0.0, 1.0, band=0.02)
    root = math.sqrt(1.0 - zeta * zeta)
    envelope_s = -math.log(0.02 * root) / (zeta * wn)
    assert envelope_s - math.pi / (wn * root) <= f.settling_s <= envelope_s + DT_S


@settings(max_examples=25)
@given(frequency, damping)
def test_integrals_of_the_error_are_those_of_the_closed_form(wn: float, zeta: float) -> None:
    """∫e dt = 2ζ/ω where e never changes sign, and less than ∫|e| dt elsewhere; critically damped it is all of it."""
    t = time_of(wn, zeta)
    y = second_order(t, wn, zeta)
    f = step_figures(t, y, 0.0, 1.0)
    assert f.iae >= 2.0 * zeta / wn - 1e-4
    wd, sigma, root = wn * math.sqrt(1.0 - zeta**2), zeta * wn, math.sqrt(1.0 - zeta**2)
    first_zero = (math.pi - math.acos(zeta)) / wd  # where the error changes sign first; then every π/wd
    decay = math.exp(-sigma * math.pi / wd)
    # F(t) = ∫ₜ^∞ e; the lobes between zeros alternate and shrink by `decay`
    tail = -math.exp(-sigma * first_zero) / wn  # ∫ from the first zero on: e^{-σt}·(−1/ω) at e = 0, ė < 0
    total = 2.0 * zeta / wn
    assert root > 0.0
    lobes = abs(tail) * (1.0 + decay) / (1.0 - decay)
    assert f.iae == pytest.approx((total - tail) + lobes, rel=2e-3)


def test_the_rise_of_a_first_order_lag_is_ln_9_of_its_time_constant() -> None:
    t = np.arange(0.0, 5.0, DT_S)
    f = step_figures(t, 2.0 - np.exp(-t / 0.4), 1.0, 1.0)
    assert f.rise_s == pytest.approx(0.4 * math.log(9.0), rel=1e-4)
    assert f.overshoot == 0.0
    assert f.settling_s == pytest.approx(0.4 * math.log(50.0), rel=1e-4)
    assert f.iae == pytest.approx(0.4, rel=1e-3)
    assert f.itae == pytest.approx(0.16, rel=1e-3)
    assert f.steady_error == pytest.approx(0.0, abs=1e-4)


def test_what_is_never_reached_is_not_told() -> None:
    t = np.arange(0.0, 2.0, DT_S)
    f = step_figures(t, 0.8 * np.ones_like(t), 0.0, 1.0)
    assert math.isnan(f.rise_s)
    assert math.isnan(f.settling_s)
    assert f.steady_error == pytest.approx(0.2)
    with pytest.raises(TooFewSamplesError):
        step_figures(t[:2], t[:2], 0.0, 1.0)


def test_effort_counts_what_is_held_and_what_is_moved() -> None:
    t = np.linspace(0.0, 2.0, 1001)
    u = np.column_stack((0.5 + 0.1 * np.sin(2.0 * math.pi * 5.0 * t), np.full_like(t, -0.2)))
    e = effort(t, u, np.array([0.5, 0.0]))
    assert e.energy_s == pytest.approx(2.0 * (0.5 * 0.01 + 0.04), rel=1e-3)
    assert e.travel_1_s == pytest.approx(5.0 * 4.0 * 0.1, rel=1e-2)


def stepped(t: np.ndarray, edges: list[tuple[float, float]], wn: float, zeta: float) -> Record:
    """Record of (time, change) edges."""
    reference, output = np.zeros_like(t), np.zeros_like(t)
    for at, change in edges:
        reference = reference + change * (t >= at - 1e-9)
        output = output + change * second_order(t - at, wn, zeta)
    return Record(t, reference, output)


def exact(w: np.ndarray, wn: float, zeta: float) -> np.ndarray:
    return wn**2 / (wn**2 - w**2 + 2j * zeta * wn * w)


@settings(max_examples=25)
@given(st.floats(1.0, 10.0), st.floats(0.4, 0.95))
def test_the_frequency_response_of_a_step_is_that_of_the_closed_form(wn: float, zeta: float) -> None:
    t = np.arange(-1.0, 40.0 / wn, DT_S)
    f = estimate([stepped(t, [(0.0, 2.0)], wn, zeta)])
    below = f.frequency_rad_s < 4.0 * wn
    expected = exact(f.frequency_rad_s, wn, zeta)
    assert np.count_nonzero(below) > 25
    assert np.abs(f.response - expected)[below].max() < 0.02


@pytest.mark.parametrize("hold_s", [0.7, 3.0])
def test_so_is_that_of_a_doublet(hold_s: float) -> None:
    t = np.arange(-1.0, 12.0, DT_S)
    f = estimate([stepped(t, [(0.0, 1.0), (hold_s, -2.0), (2.0 * hold_s, 1.0)], 5.0, 0.6)])
    assert f.frequency_rad_s.size > 20
    assert np.abs(f.response - exact(f.frequency_rad_s, 5.0, 0.6)).max() < 0.03


@settings(max_examples=25)
@given(st.floats(1.0, 10.0), st.floats(0.3, 0.9))
def test_bandwidth_peak_and_margins_are_those_of_the_closed_form(wn: float, zeta: float) -> None:
    t = np.arange(-1.0, 60.0 / wn, DT_S)
    c = closed_loop(estimate([stepped(t, [(0.0, 1.0)], wn, zeta)]))
    k = 1.0 - 2.0 * zeta**2
    assert c.bandwidth_rad_s == pytest.approx(wn * math.sqrt(k + math.sqrt(k * k + 1.0)), rel=0.02)
    peak = 1.0 / (2.0 * zeta * math.sqrt(1.0 - zeta**2)) if zeta < math.sqrt(0.5) else 1.0
    assert c.peak_dB == pytest.approx(20.0 * math.log10(peak), abs=0.15)
    root = math.sqrt(math.sqrt(1.0 + 4.0 * zeta**4) - 2.0 * zeta**2)
    assert c.phase_margin_deg == pytest.approx(math.degrees(math.atan(2.0 * zeta / root)), abs=1.5)
    assert c.crossover_rad_s == pytest.approx(wn * root, rel=0.03)


def test_noise_ends_the_frequencies_told_but_does_not_bend_them() -> None:
    random = np.random.default_rng(1)
    t = np.arange(-1.0, 10.0, DT_S)
    clean = [stepped(t, [(0.0, sign)], 5.0, 0.7) for sign in (1.0, -1.0, 1.0, -1.0)]
    noisy = [r._replace(output=r.output + 0.002 * random.standard_normal(t.size)) for r in clean]
    f = estimate(noisy)
    assert 10.0 < f.frequency_rad_s[-1] < 100.0 < estimate(clean[:1]).frequency_rad_s[-1] * 4.0
    assert closed_loop(f).bandwidth_rad_s == pytest.approx(closed_loop(estimate(clean)).bandwidth_rad_s, rel=0.03)


def test_samples_that_are_missing_are_filled_in() -> None:
    t = np.arange(-1.0, 8.0, DT_S)
    whole = stepped(t, [(0.0, 1.0)], 3.0, 0.7)
    kept = np.random.default_rng(2).random(t.size) > 0.1
    again = evenly(whole.t_s[kept], whole.reference[kept], whole.output[kept])
    assert np.diff(again.t_s).max() == pytest.approx(DT_S)
    assert closed_loop(estimate([again])).bandwidth_rad_s == pytest.approx(
        closed_loop(estimate([whole])).bandwidth_rad_s, rel=0.01
    )
