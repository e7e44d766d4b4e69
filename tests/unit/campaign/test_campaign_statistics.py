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


def test_influences_are_ranked_and_what_hurts_to_both_sides_is_found() -> None:
    dice = np.random.default_rng(1)
    slope, valley, nothing = dice.uniform(-1, 1, (3, 400))
    error = np.exp(0.3 * slope + 2.0 * valley**2 + 0.05 * dice.standard_normal(400))
    found = influences({"nothing": nothing, "slope": slope, "valley": valley, "same": np.ones(400)}, error)
    by_name = {i.setting: i for i in found}
    assert [i.setting for i in found][2] == "nothing"
    assert set(by_name) == {"slope", "valley", "nothing"}
    assert by_name["slope"].rank == pytest.approx(spearmanr(slope, error).statistic)
    assert by_name["slope"].partial > 0.7 > by_name["slope"].rank
    assert by_name["valley"].middle_partial > 0.9 > abs(by_name["valley"].partial)
    assert by_name["nothing"].size < 2.0 * by_name["nothing"].noise
    assert by_name["nothing"].noise == pytest.approx(0.099, abs=0.001)


def test_too_few_flights_have_no_influence() -> None:
    assert influences({"x": np.arange(3.0)}, np.arange(3.0)) == []
    assert influences({"x": np.arange(9.0)}, np.ones(9)) == []
