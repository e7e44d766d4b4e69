"""Rates, spreads and influences against what is known of them."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from sitl.campaign.statistics import influences, spread, wilson


@pytest.mark.parametrize(
    ("hits", "of", "low", "high"),
    [(0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0), (81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605)],
)  # the last two from Newcombe, Statistics in Medicine 17 (1998), table I, method 3
def test_the_interval_of_a_rate_is_wilsons(hits: int, of: int, low: float, high: float) -> None:
    assert wilson(hits, of)[2:] == pytest.approx((low, high), abs=1e-4)


def test_a_spread_leaves_out_what_is_not_finite() -> None:
    found = spread(np.array([1.0, 2.0, 3.0, np.nan]))
    assert (found["mean"], found["median"], found["least"], found["greatest"]) == (2.0, 2.0, 1.0, 3.0)
    assert spread(np.array([np.nan])) == {}


def test_influences_are_ranked_whatever_their_shape() -> None:
    dice = np.random.default_rng(1)
    slope, wave, nothing = dice.uniform(-1, 1, (3, 400))
    error = np.exp(0.3 * slope + np.sin(3.0 * np.pi * wave) + 0.05 * dice.standard_normal(400))
    found = influences({"nothing": nothing, "slope": slope, "wave": wave, "same": np.ones(400)}, error)
    by_name = {i.setting: i for i in found}
    assert [i.setting for i in found] == ["wave", "slope", "nothing"]
    assert by_name["slope"].rank == pytest.approx(spearmanr(slope, error).statistic)
    assert by_name["wave"].share > 0.7 > 0.2 > abs(by_name["wave"].partial) - 0.3
    assert by_name["slope"].partial > by_name["slope"].partial_noise
    assert by_name["nothing"].share < by_name["nothing"].share_noise < 0.1
    assert by_name["nothing"].partial_noise == pytest.approx(0.099, abs=0.001)


def test_a_setting_without_influence_stays_below_the_noise_19_times_of_20() -> None:
    dice = np.random.default_rng(2)
    found = [influences({"x": dice.uniform(size=200)}, dice.uniform(size=200))[0] for _ in range(300)]
    assert np.mean([i.share < i.share_noise for i in found]) == pytest.approx(0.95, abs=0.03)
    assert np.mean([abs(i.partial) < i.partial_noise for i in found]) == pytest.approx(0.95, abs=0.03)


def test_partial_correlation_takes_away_what_another_setting_explains() -> None:
    dice = np.random.default_rng(3)
    cause = dice.uniform(size=500)
    companion = cause + 0.1 * dice.uniform(size=500)
    by_name = {i.setting: i for i in influences({"cause": cause, "companion": companion}, cause**2)}
    assert by_name["companion"].rank > 0.95
    assert abs(by_name["companion"].partial) < 0.2 < by_name["cause"].partial


def test_too_few_flights_have_no_influence() -> None:
    assert influences({"x": np.arange(3.0)}, np.arange(3.0)) == []
    assert influences({"x": np.arange(9.0)}, np.ones(9)) == []
