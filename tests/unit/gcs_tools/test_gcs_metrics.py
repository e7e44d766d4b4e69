"""The paper's figures against closed forms."""

import math
from typing import Any

import numpy as np
import pytest

from gcs_tools.metrics import TooFewSamplesError, Track, evaluate, report

NONE = np.zeros((0, 4))


def track(t: Any, error: Any, height: float = 1.0, **series: Any) -> Track:
    """A flight whose reference moves north at 1 m/s at a height, followed with a given error (n, 3)."""
    t, error = np.asarray(t, dtype=float), np.asarray(error, dtype=float)
    reference = np.column_stack((t, np.zeros_like(t), np.full_like(t, -height)))
    empty = {"angles": NONE, "thrust": np.zeros((0, 2)), "flaps": np.zeros((0, 3))}
    return Track(t, reference, reference + error, **{**empty, **series})


def constant(t: np.ndarray, *values: float) -> np.ndarray:
    return np.tile(values, (t.size, 1))


def test_a_constant_error_is_its_own_mean_rms_maximum_and_end() -> None:
    t = np.linspace(-1, 12, 651)
    m = evaluate(track(t, constant(t, 0.1, -0.2, 0.0)), 10.0)
    assert m.mae == pytest.approx((0.1, 0.2, 0.0))
    assert m.rmse == pytest.approx((0.1, 0.2, 0.0))
    assert m.iae == pytest.approx((1.0, 2.0, 0.0))
    assert m.max_overshoot == pytest.approx((0.1, 0.2, 0.0))
    assert m.final_error == pytest.approx((0.1, 0.2, 0.0))


def test_a_sine_has_two_over_pi_and_one_over_root_two_of_its_amplitude() -> None:
    t = np.linspace(0, 10, 5001)
    e = np.column_stack((0.3 * np.sin(2 * math.pi * t / 5), 0 * t, 0 * t))
    m = evaluate(track(t, e), 10.0)
    assert m.mae[0] == pytest.approx(0.3 * 2 / math.pi, rel=1e-5)
    assert m.rmse[0] == pytest.approx(0.3 / math.sqrt(2), rel=1e-5)
    assert m.iae[0] == pytest.approx(10 * 0.3 * 2 / math.pi, rel=1e-5)
    assert m.max_overshoot[0] == pytest.approx(0.3, rel=1e-6)
    assert m.final_error[0] == pytest.approx(0.0, abs=1e-9)


def test_a_sample_weighs_the_time_it_stands_for() -> None:
    """A ramp of error from 0 to 1 m has a mean of a half, however the samples are crowded at one end."""
    t = np.concatenate((np.linspace(0, 1, 200, endpoint=False), np.linspace(1, 10, 10)))
    m = evaluate(track(t, np.column_stack((t / 10, 0 * t, 0 * t))), 10.0)
    assert m.mae[0] == pytest.approx(0.5)
    assert m.largest_gap_s == pytest.approx(1.0)


def test_only_the_flights_own_time_counts_and_its_ends_are_interpolated() -> None:
    t = np.array([-5.0, -0.5, 0.5, 9.5, 10.5, 20.0])
    e = np.column_stack((np.where((t < 0) | (t > 10), 0.0, 1.0), 0 * t, 0 * t))
    m = evaluate(track(t, e), 10.0)
    assert m.iae[0] == pytest.approx(0.5 * 0.75 + 9.0 + 0.5 * 0.75)
    assert m.final_error[0] == pytest.approx(0.5)


def test_an_error_at_a_key_time_is_signed_and_interpolated() -> None:
    t = np.array([0.0, 1.0, 2.0, 3.0])
    e = np.column_stack(([0, 0.1, -0.3, 0], [0, 0, 0, 0], [0, -0.2, -0.2, 0]))
    m = evaluate(track(t, e), 3.0, [(1.5, (7.0, 8.0, 9.0)), (2.0, None)])
    assert m.waypoints[0].target == (7, 8, 9)
    assert m.waypoints[0].error == pytest.approx((-0.1, 0, -0.2))
    assert m.waypoints[1].target == pytest.approx((2.0, 0.0, -1.0))
    assert m.waypoints[1].error == pytest.approx((-0.3, 0, -0.2))


def test_ranges_are_those_of_the_time_off_the_ground() -> None:
    t = np.linspace(0, 10, 101)
    down = np.where((t > 2) & (t < 8), -1.0, 0.0)
    reference = np.column_stack((0 * t, 0 * t, down))
    angles = np.column_stack((t, np.where(down < 0, 3.0, 50.0), 90 + t, -t))
    thrust = np.column_stack((t, np.where(down < 0, 10.0 + t, 1.0)))
    flaps = np.column_stack((t, -t, t))
    ranges = evaluate(Track(t, reference, reference, angles, thrust, flaps), 10.0).ranges
    assert ranges["roll_deg"] == [3.0, 3.0]
    assert ranges["pitch_deg"] == pytest.approx([92.1, 97.9])
    assert ranges["yaw_deg"] == pytest.approx([-7.9, -2.1])
    assert ranges["thrust_N"] == pytest.approx([12.1, 17.9])
    assert ranges["flap_deg"] == pytest.approx([-7.9, 7.9])


def test_a_series_never_heard_has_no_range() -> None:
    t = np.linspace(0, 10, 11)
    assert set(evaluate(track(t, constant(t, 0, 0, 0)), 10.0).ranges.values()) == {None}


def test_a_flight_without_samples_is_said_to_be_unmeasurable() -> None:
    with pytest.raises(TooFewSamplesError, match="too few position samples"):
        evaluate(track(np.array([-1.0, 20.0]), np.zeros((2, 3))), 10.0)


def test_the_report_has_exactly_the_documented_fields() -> None:
    t = np.linspace(0, 10, 11)
    m = evaluate(track(t, constant(t, 0.1, 0.2, 0.3)), 10.0, [(5.0, None)])
    result = report("hover", None, 10.0, m, 123.456)
    assert list(result) == [
        "mission",
        "vehicle",
        "duration_s",
        "mae",
        "rmse",
        "iae",
        "max_overshoot",
        "final_error",
        "waypoints",
        "ranges",
        "real_time_factor",
    ]
    assert list(result["waypoints"][0]) == ["t_s", "target", "error"]
    assert list(result["ranges"]) == ["roll_deg", "pitch_deg", "yaw_deg", "thrust_N", "flap_deg"]
    assert result["mae"] == [0.1, 0.2, 0.3]
    assert result["real_time_factor"] == 123.46
