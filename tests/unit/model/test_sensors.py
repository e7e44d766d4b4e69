import math

import numpy as np
import pytest

from sitl.model.rigid_body import State
from sitl.model.sensors import (
    NOISES,
    PERFECT,
    TURN_ON,
    Sensors,
    baro,
    due,
    gnss,
    magnetometer,
    observe,
    step_sensors,
    switched_on,
)
from sitl.quaternion import rotate
from sitl.vehicle_spec import load_vehicle

STATE = State(1.0, 2.0, -3.0, 0.1, 0.2, 0.3, 0.5, 0.5, 0.5, 0.5, 0.01, 0.02, 0.03, 700.0, 710.0, 0.1, -0.1)
RATES, FORCE = (0.01, 0.02, 0.03), (9.0, 0.1, -1.0)
NONE, RTK = load_vehicle("yawsitter").sensors, load_vehicle("yawsitter-real").sensors
QUIET = np.zeros(NOISES)


def only(**values: float) -> Sensors:
    return NONE._replace(**values)


def readings(sensors: Sensors, n: int, dt_s: float = 0.002):
    """Sensor states, one after the other."""
    errors = PERFECT
    for noise in np.random.default_rng(1).standard_normal((n, NOISES)):
        errors = step_sensors(sensors, errors, RATES, FORCE, noise, dt_s)
        yield errors, noise


def test_perfect_sensors_read_the_truth() -> None:
    errors = step_sensors(NONE, PERFECT, RATES, FORCE, np.ones(NOISES), 0.002)
    assert (errors.gyro_rad_s, errors.accel_m_s2) == (RATES, FORCE)
    assert gnss(NONE, errors, STATE, np.ones(NOISES)) == (STATE[:3], STATE[3:6])
    assert baro(NONE, errors, STATE, np.ones(NOISES)) == 3.0
    assert observe(NONE, errors, STATE) == STATE[:13]


def test_the_imus_white_noise_has_its_density_at_any_rate() -> None:
    sensors = only(gyro_noise_rad_s_rtHz=1e-3, accel_noise_m_s2_rtHz=0.01)
    for dt_s in (0.002, 0.01):
        seen = np.array([(*e.gyro_rad_s, *e.accel_m_s2) for e, _ in readings(sensors, 4000, dt_s)])
        white = 1.0 / math.sqrt(dt_s)
        assert seen.mean(axis=0) == pytest.approx((*RATES, *FORCE), abs=0.02)
        assert seen.std(axis=0) == pytest.approx([1e-3 * white] * 3 + [0.01 * white] * 3, rel=0.06)


def test_a_bias_is_drawn_at_power_on_and_walks_from_there() -> None:
    sensors = only(gyro_bias_rad_s=0.01, gyro_walk_rad_s2_rtHz=0.001)
    drawn = [switched_on(sensors, n).gyro_bias for n in np.random.default_rng(2).standard_normal((2000, TURN_ON))]
    assert np.std(drawn) == pytest.approx(0.01, rel=0.05)
    ends = []
    for seed in range(300):
        errors = PERFECT
        for noise in np.random.default_rng(seed).standard_normal((20, NOISES)):
            errors = step_sensors(sensors, errors, RATES, FORCE, noise, 0.05)
        ends.append(errors.gyro_bias)
    assert np.std(ends) == pytest.approx(0.001, rel=0.1)  # density times √(1 s)


def test_satellite_positions_have_white_noise_around_a_slow_wander() -> None:
    sensors = only(gnss_level_m=0.01, gnss_height_m=0.02, gnss_velocity_m_s=0.05, gnss_wander_m=0.1, gnss_wander_s=1.0)
    white, slow = [], []
    for errors, noise in readings(sensors, 6000, 0.1):
        fix = gnss(sensors, errors, STATE, noise)
        white.append((*np.subtract(fix.position_N, STATE[:3]) - errors.gnss_wander, *np.subtract(fix[1], STATE[3:6])))
        slow.append(errors.gnss_wander[0])
    assert np.std(white, axis=0) == pytest.approx([0.01, 0.01, 0.02, 0.05, 0.05, 0.05], rel=0.06)
    assert np.std(slow) == pytest.approx(0.1, rel=0.15)
    assert np.corrcoef(slow[:-10], slow[10:])[0, 1] == pytest.approx(math.exp(-1.0), abs=0.1)


def test_the_field_points_to_north_and_down_by_its_dip() -> None:
    north, east, down = rotate(STATE[6:10], magnetometer(RTK._replace(mag=0.0), PERFECT, STATE, QUIET))
    assert east == pytest.approx(0.0, abs=1e-12)
    assert math.atan2(down, north) == pytest.approx(RTK.field_dip_rad)


def test_a_sensor_reads_as_often_as_its_rate_says() -> None:
    for dt_us in (2_000, 10_000):
        steps = range(dt_us, 2_000_000 + dt_us, dt_us)
        assert sum(due(10.0, now_us, dt_us) for now_us in steps) == 20
        assert not any(due(0.0, now_us, dt_us) for now_us in steps)


def test_without_a_filter_the_rates_are_the_gyros_and_all_else_the_truth() -> None:
    errors, _ = next(readings(RTK, 1))
    nav = observe(RTK, errors, STATE)
    assert nav[:10] == STATE[:10]
    assert nav[10:] == pytest.approx(np.subtract(errors.gyro_rad_s, errors.gyro_bias))
    assert nav[10:] != STATE[10:13]
