"""From the plant's state to what the vehicle believes: the truth with the errors a navigation system leaves."""

import math
from typing import NamedTuple

from sitl.jit import kernel
from sitl.model.rigid_body import State
from sitl.navigation import NavState
from sitl.quaternion import Vec3, multiply

NOISES = 12  # standard normal numbers per control step


class Sensors(NamedTuple):
    """Standard deviations of the navigation errors; all zero: the vehicle knows its state exactly.

    Position, velocity and attitude errors wander with the given correlation time; the rate error is white.
    """

    position_noise_m: float
    velocity_noise_m_s: float
    attitude_noise_rad: float
    rate_noise_rad_s: float
    correlation_s: float


class SensorState(NamedTuple):
    """Present errors in units of their standard deviation."""

    position: Vec3
    velocity: Vec3
    attitude: Vec3
    rate: Vec3


PERFECT = SensorState((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@kernel
def _wander(x: Vec3, decay: float, n0: float, n1: float, n2: float) -> Vec3:
    k = math.sqrt(1.0 - decay * decay)
    return decay * x[0] + k * n0, decay * x[1] + k * n1, decay * x[2] + k * n2


@kernel
def step_sensors(p: Sensors, s: SensorState, noise: tuple[float, ...], dt_s: float) -> SensorState:
    """The errors `dt_s` later (first-order Gauss-Markov), driven by twelve standard normal numbers."""
    decay = math.exp(-dt_s / p.correlation_s) if p.correlation_s > 0.0 else 0.0
    return SensorState(
        _wander(s.position, decay, noise[0], noise[1], noise[2]),
        _wander(s.velocity, decay, noise[3], noise[4], noise[5]),
        _wander(s.attitude, decay, noise[6], noise[7], noise[8]),
        (noise[9], noise[10], noise[11]),
    )


@kernel
def observe(p: Sensors, e: SensorState, s: State) -> NavState:
    """The navigation state for the plant's state `s` under the errors `e`; exact where the noise is zero."""
    qw, qx, qy, qz = s.qw, s.qx, s.qy, s.qz
    half = 0.5 * p.attitude_noise_rad
    if half > 0.0:
        qw, qx, qy, qz = multiply(
            (qw, qx, qy, qz), (1.0, half * e.attitude[0], half * e.attitude[1], half * e.attitude[2])
        )
        k = 1.0 / math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
        qw, qx, qy, qz = k * qw, k * qx, k * qy, k * qz
    return NavState(
        s.north_m + p.position_noise_m * e.position[0],
        s.east_m + p.position_noise_m * e.position[1],
        s.down_m + p.position_noise_m * e.position[2],
        s.v_north_m_s + p.velocity_noise_m_s * e.velocity[0],
        s.v_east_m_s + p.velocity_noise_m_s * e.velocity[1],
        s.v_down_m_s + p.velocity_noise_m_s * e.velocity[2],
        qw,
        qx,
        qy,
        qz,
        s.p_rad_s + p.rate_noise_rad_s * e.rate[0],
        s.q_rad_s + p.rate_noise_rad_s * e.rate[1],
        s.r_rad_s + p.rate_noise_rad_s * e.rate[2],
    )
