"""Sensors at the centre of mass: what an IMU, a satellite receiver, a barometer and a magnetometer read.

Each reading is the truth with a bias, white noise and, where it says so, a slow wander (first-order Gauss-Markov).
Sources of the numbers stand in `sitl/sensors/*.yaml`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.jit import kernel
from sitl.model.rigid_body import State
from sitl.navigation import NavState
from sitl.quaternion import Vec3, rotate_back

Array = NDArray[np.float64]
NOISES = 26  # standard normal numbers per control step
TURN_ON = 13  # and once when the sensors are switched on


class Sensors(NamedTuple):
    """Noise densities, turn-on biases (standard deviations), rates. All zero: the sensors read the truth."""

    gyro_noise_rad_s_rtHz: float
    gyro_walk_rad_s2_rtHz: float  # of the bias
    gyro_bias_rad_s: float
    accel_noise_m_s2_rtHz: float
    accel_walk_m_s3_rtHz: float
    accel_bias_m_s2: float
    gnss_rate_Hz: float
    gnss_level_m: float  # position, north and east
    gnss_height_m: float
    gnss_velocity_m_s: float
    gnss_wander_m: float
    gnss_wander_s: float
    baro_rate_Hz: float
    baro_m: float
    baro_wander_m: float
    baro_wander_s: float
    mag_rate_Hz: float
    mag: float  # of the field's strength
    mag_bias: float
    field_dip_rad: float  # of the Earth's field below the horizon; its level part points to north


class SensorState(NamedTuple):
    """Errors that change slowly, and the IMU's latest reading (specific force and rates in B)."""

    gyro_bias: Vec3
    accel_bias: Vec3
    mag_bias: Vec3
    gnss_wander: Vec3
    baro_wander: float
    gyro_rad_s: Vec3
    accel_m_s2: Vec3


class GnssFix(NamedTuple):
    position_N: Vec3
    velocity_N: Vec3


NOISELESS = Sensors(*[0.0] * len(Sensors._fields))
_ZERO = (0.0, 0.0, 0.0)
PERFECT = SensorState(_ZERO, _ZERO, _ZERO, _ZERO, 0.0, _ZERO, _ZERO)


@kernel
def fitted(p: Sensors) -> Sensors:
    """The sensors in numbers of a kernel's own, as `sitl.model.airframe.loaded` has the airframe."""
    return Sensors(
        p.gyro_noise_rad_s_rtHz, p.gyro_walk_rad_s2_rtHz, p.gyro_bias_rad_s, p.accel_noise_m_s2_rtHz,
        p.accel_walk_m_s3_rtHz, p.accel_bias_m_s2, p.gnss_rate_Hz, p.gnss_level_m, p.gnss_height_m,
        p.gnss_velocity_m_s, p.gnss_wander_m, p.gnss_wander_s, p.baro_rate_Hz, p.baro_m, p.baro_wander_m,
        p.baro_wander_s, p.mag_rate_Hz, p.mag, p.mag_bias, p.field_dip_rad,
    )  # fmt: skip


@kernel
def _scaled(k: float, a: float, b: float, c: float) -> Vec3:
    return k * a, k * b, k * c


@kernel
def _plus(v: Vec3, k: float, a: float, b: float, c: float) -> Vec3:
    return v[0] + k * a, v[1] + k * b, v[2] + k * c


@kernel
def _decay(tau_s: float, dt_s: float) -> float:
    return math.exp(-dt_s / tau_s) if tau_s > 0.0 else 0.0


@kernel
def _wandered(x: float, sigma: float, decay: float, noise: float) -> float:
    return decay * x + sigma * math.sqrt(1.0 - decay * decay) * noise


@kernel
def switched_on(p: Sensors, noise: Array) -> SensorState:
    """The sensors as they are after power-on, from TURN_ON standard normal numbers."""
    return SensorState(
        _scaled(p.gyro_bias_rad_s, noise[0], noise[1], noise[2]),
        _scaled(p.accel_bias_m_s2, noise[3], noise[4], noise[5]),
        _scaled(p.mag_bias, noise[6], noise[7], noise[8]),
        _scaled(p.gnss_wander_m, noise[9], noise[10], noise[11]),
        p.baro_wander_m * noise[12],
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
    )


@kernel
def step_sensors(p: Sensors, e: SensorState, rates_B: Vec3, force_B: Vec3, noise: Array, dt_s: float) -> SensorState:
    """Slow errors `dt_s` later, and the IMU's reading of the body rates [rad/s] and the specific force [m/s²]."""
    walk, drift = p.gyro_walk_rad_s2_rtHz * math.sqrt(dt_s), p.accel_walk_m_s3_rtHz * math.sqrt(dt_s)
    gyro_bias = _plus(e.gyro_bias, walk, noise[0], noise[1], noise[2])
    accel_bias = _plus(e.accel_bias, drift, noise[3], noise[4], noise[5])
    white = 1.0 / math.sqrt(dt_s)
    slow = _decay(p.gnss_wander_s, dt_s)
    gyro = _plus(rates_B, 1.0, gyro_bias[0], gyro_bias[1], gyro_bias[2])
    accel = _plus(force_B, 1.0, accel_bias[0], accel_bias[1], accel_bias[2])
    return SensorState(
        gyro_bias,
        accel_bias,
        e.mag_bias,
        (
            _wandered(e.gnss_wander[0], p.gnss_wander_m, slow, noise[12]),
            _wandered(e.gnss_wander[1], p.gnss_wander_m, slow, noise[13]),
            _wandered(e.gnss_wander[2], p.gnss_wander_m, slow, noise[14]),
        ),
        _wandered(e.baro_wander, p.baro_wander_m, _decay(p.baro_wander_s, dt_s), noise[15]),
        _plus(gyro, white * p.gyro_noise_rad_s_rtHz, noise[6], noise[7], noise[8]),
        _plus(accel, white * p.accel_noise_m_s2_rtHz, noise[9], noise[10], noise[11]),
    )


@kernel
def due(rate_Hz: float, now_us: int, dt_us: int) -> bool:
    """Whether a sensor of this rate gives a reading in the control step that ends at `now_us`."""
    if rate_Hz <= 0.0:
        return False
    period_us = max(int(1e6 / rate_Hz + 0.5), dt_us)
    return now_us % period_us < dt_us


@kernel
def gnss(p: Sensors, e: SensorState, s: State, noise: Array) -> GnssFix:
    """The receiver's position and velocity, in N."""
    level, velocity = p.gnss_level_m, p.gnss_velocity_m_s
    return GnssFix(
        (
            s.north_m + e.gnss_wander[0] + level * noise[16],
            s.east_m + e.gnss_wander[1] + level * noise[17],
            s.down_m + e.gnss_wander[2] + p.gnss_height_m * noise[18],
        ),
        (
            s.v_north_m_s + velocity * noise[19],
            s.v_east_m_s + velocity * noise[20],
            s.v_down_m_s + velocity * noise[21],
        ),
    )


@kernel
def baro(p: Sensors, e: SensorState, s: State, noise: Array) -> float:
    """Height above the start [m] by the air's pressure."""
    height: float = -s.down_m + e.baro_wander + p.baro_m * noise[22]
    return height


@kernel
def magnetometer(p: Sensors, e: SensorState, s: State, noise: Array) -> Vec3:
    """The magnetic field in B, in units of its strength."""
    field_N = (math.cos(p.field_dip_rad), 0.0, math.sin(p.field_dip_rad))
    x, y, z = rotate_back((s.qw, s.qx, s.qy, s.qz), field_N)
    return (
        x + e.mag_bias[0] + p.mag * noise[23],
        y + e.mag_bias[1] + p.mag * noise[24],
        z + e.mag_bias[2] + p.mag * noise[25],
    )


@kernel
def observe(p: Sensors, e: SensorState, s: State) -> NavState:
    """The true state as a navigation state, for a vehicle without an estimator; the rates are those of the gyro."""
    rates = (s.p_rad_s, s.q_rad_s, s.r_rad_s)
    if p.gyro_noise_rad_s_rtHz > 0.0:
        b, w = e.gyro_bias, e.gyro_rad_s
        rates = (w[0] - b[0], w[1] - b[1], w[2] - b[2])
    return NavState(
        s.north_m, s.east_m, s.down_m, s.v_north_m_s, s.v_east_m_s, s.v_down_m_s,
        s.qw, s.qx, s.qy, s.qz, rates[0], rates[1], rates[2],
    )  # fmt: skip
