import numpy as np
import pytest

from sitl.model.wind import CALM, Wind, step_gusts, wind_velocity


def blown(wind: Wind, seed: int, seconds: float, height_m: float = 10.0, dt_s: float = 0.01) -> np.ndarray:
    rng, gusts, out = np.random.default_rng(seed), CALM, []
    for noise in rng.standard_normal((round(seconds / dt_s), 3)):
        gusts = step_gusts(wind, gusts, height_m, 5.0, tuple(noise), dt_s)
        out.append(wind_velocity(wind, gusts, height_m))
    return np.array(out)


def test_without_gusts_the_wind_is_steady() -> None:
    assert blown(Wind(3.0, -1.0, 0.5, 0.0), 1, 1.0) == pytest.approx(np.tile((3.0, -1.0, 0.5), (100, 1)))


@pytest.mark.compiled
def test_gusts_have_the_asked_standard_deviation_and_less_of_it_vertically() -> None:
    samples = np.concatenate([blown(Wind(0.0, 0.0, 0.0, 1.0), seed, 1500.0, dt_s=0.05) for seed in range(6)])
    north, east, down = samples.std(axis=0)
    assert north == pytest.approx(1.0, rel=0.12)
    assert east == pytest.approx(1.0, rel=0.12)
    assert down == pytest.approx((0.177 + 0.000823 * 10 / 0.3048) ** 0.4, rel=0.12)
    assert np.abs(samples.mean(axis=0)) == pytest.approx(np.zeros(3), abs=0.15)


def test_the_same_noise_gives_the_same_gusts() -> None:
    wind = Wind(1.0, 0.0, 0.0, 0.5)
    assert (blown(wind, 3, 1.0) == blown(wind, 3, 1.0)).all()
    assert (blown(wind, 3, 1.0) != blown(wind, 4, 1.0)).any()
