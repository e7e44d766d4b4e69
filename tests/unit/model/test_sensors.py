import numpy as np
import pytest

from sitl.model.rigid_body import State
from sitl.model.sensors import NOISES, PERFECT, Sensors, observe, step_sensors

STATE = State(1.0, 2.0, -3.0, 0.1, 0.2, 0.3, 0.5, 0.5, 0.5, 0.5, 0.01, 0.02, 0.03, 700.0, 710.0, 0.1, -0.1)


def test_without_noise_the_vehicle_knows_its_state_exactly() -> None:
    assert observe(Sensors(0.0, 0.0, 0.0, 0.0, 0.0), PERFECT, STATE) == STATE[:13]


def test_errors_have_the_declared_size() -> None:
    sensors = Sensors(0.01, 0.02, 0.003, 0.005, 0.1)
    rng, errors, seen = np.random.default_rng(1), PERFECT, []
    for noise in rng.standard_normal((4000, NOISES)):
        errors = step_sensors(sensors, errors, tuple(noise), 0.05)
        seen.append(observe(sensors, errors, STATE))
    spread = np.array(seen).std(axis=0)
    assert spread[:3] == pytest.approx(np.full(3, 0.01), rel=0.15)
    assert spread[3:6] == pytest.approx(np.full(3, 0.02), rel=0.15)
    assert spread[10:13] == pytest.approx(np.full(3, 0.005), rel=0.1)
    assert np.linalg.norm(np.array(seen)[:, 6:10], axis=1) == pytest.approx(np.ones(4000))


def test_position_errors_wander_over_the_correlation_time() -> None:
    sensors = Sensors(1.0, 0.0, 0.0, 0.0, 1.0)
    rng, errors, north = np.random.default_rng(2), PERFECT, []
    for noise in rng.standard_normal((5000, NOISES)):
        errors = step_sensors(sensors, errors, tuple(noise), 0.1)
        north.append(errors.position[0])
    lag_one = np.corrcoef(north[:-10], north[10:])[0, 1]  # one correlation time
    assert lag_one == pytest.approx(np.exp(-1.0), abs=0.1)
