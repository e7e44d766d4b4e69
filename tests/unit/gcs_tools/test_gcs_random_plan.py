"""Missions made up from a seed: smooth, within their limits, and the same for the same words."""

import math

import pytest

from gcs_tools import plan as plans
from gcs_tools.plan import Streamed
from gcs_tools.random_plan import Limits, words
from sitl.strict_yaml import ConfigError

WIDE = "random:5,duration_s=90.0,extent_m=4.0,height_m=6.0,speed_m_s=1.5,acceleration_m_s2=1.0,heading_deg=30.0"


def made(text: str) -> Streamed:
    plan = plans.load(text)
    assert isinstance(plan, Streamed)
    return plan


def instants(plan: Streamed) -> list[float]:
    return [k * 0.02 for k in range(round(plan.duration_s / 0.02) + 1)]


@pytest.mark.parametrize("text", ["random:1", "random:2", WIDE, "random:0,duration_s=30"])
def test_it_keeps_within_its_limits_from_the_ground_to_the_ground(text: str) -> None:
    plan = made(text)
    limits = Limits(*(float(dict(w.split("=") for w in text.split(",")[1:]).get(n, d)) for n, d in
                      Limits._field_defaults.items()))  # fmt: skip
    at = [plan.reference.at(t) for t in instants(plan)]
    assert at[0].position_m == at[-1].position_m == (0.0, 0.0, 0.0)
    assert max(math.hypot(*a.velocity_m_s) for a in at) <= max(limits.speed_m_s, 1.876) + 1e-3
    assert max(math.hypot(*a.acceleration_m_s2) for a in at) <= max(limits.acceleration_m_s2, 1.5) + 1e-3
    assert max(abs(x) for a in at for x in a.position_m[:2]) <= limits.extent_m + 1e-3
    assert min(a.position_m[2] for a in at) >= -1.5 * limits.height_m - 1e-3
    assert max(abs(a.position_m[0]) for a in at) > 0.3
    assert plan.duration_s == limits.duration_s


def test_velocity_and_acceleration_are_the_derivatives_of_its_position_everywhere() -> None:
    reference, h = made("random:3").reference, 1e-4
    for t in instants(made("random:3"))[5::37]:
        before, at, after = (reference.at(t + d) for d in (-h, 0.0, h))
        for k in range(3):
            slope = (after.position_m[k] - before.position_m[k]) / (2 * h)
            assert at.velocity_m_s[k] == pytest.approx(slope, abs=1e-6)
            slope = (after.velocity_m_s[k] - before.velocity_m_s[k]) / (2 * h)
            assert at.acceleration_m_s2[k] == pytest.approx(slope, abs=1e-3)


def test_the_same_words_are_the_same_flight_and_other_seeds_another() -> None:
    one, again, other = (made(text).reference.at(30.0) for text in ("random:3", "random:3", "random:4"))
    assert one == again != other
    assert made(WIDE).source == WIDE
    assert words(3, Limits()) == "random:3"
    assert made(WIDE).heading_rad == pytest.approx(math.radians(30.0))
    assert made("random:3").heading_rad is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("random:", "'' is not a seed"),
        ("random:-1", "'-1' is not a seed"),
        ("random:1,sped=3", "'sped' is not one of duration_s, extent_m"),
        ("random:1,speed_m_s=fast", "speed_m_s: 'fast' is not a number"),
        ("random:1,speed_m_s=nan", "speed_m_s: nan is outside 0.2 … 10"),
    ],
)
def test_words_that_mean_no_flight_are_refused(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        plans.load(text)
