"""The closed loop over arrays that stay where they are: the way the vehicle crosses into compiled code.

Numba takes nested tuples apart and builds them again on every call, 13 µs for the guidance, the loop's state and what
is observed of it: as much as six control steps. Here all three live in flat arrays between calls, and become tuples
inside.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sitl.calm_array import passes
from sitl.closed_loop import Controller, LoopState, Observed, Plant, run_on
from sitl.control.cascade import Command, Memory
from sitl.control.disturbance import Disturbance, Flaps
from sitl.control.feedforward import Course, Trim
from sitl.control.guidance import Actuation, Guidance, Steering
from sitl.control.reference import DEGREE, Reference, Trajectory
from sitl.estimation.error_state import ERRORS, Estimate
from sitl.jit import kernel
from sitl.model.rigid_body import State
from sitl.model.sensors import SensorState
from sitl.model.wind import GustState
from sitl.navigation import NavState
from sitl.quaternion import Vec3
from sitl.tally import TICK_US, sample

Array = NDArray[np.float64]
_GUSTS, _SENSORS, _ESTIMATE, _COVARIANCE, _MEMORY = 17, 22, 41, 64, 64 + ERRORS * ERRORS  # the state begins at 0
LOOP_SIZE = _MEMORY + 63
OBSERVED_SIZE = 52
_PIECES = 22  # of a guidance's array: where its trajectory's segments begin
_NAV, _COMMAND, _REFERENCE = slice(0, 13), slice(13, 28), slice(28, 42)


@kernel
def _vec(x: Array, i: int) -> Vec3:
    return x[i], x[i + 1], x[i + 2]


@kernel
def _trim(x: Array, i: int) -> Trim:
    return Trim(x[i], x[i + 1], x[i + 2], x[i + 3], x[i + 4], x[i + 5])


@kernel
def _sensors(x: Array, i: int) -> SensorState:
    return SensorState(
        _vec(x, i), _vec(x, i + 3), _vec(x, i + 6), _vec(x, i + 9), x[i + 12], _vec(x, i + 13), _vec(x, i + 16)
    )


@kernel
def _estimate(x: Array, i: int) -> Estimate:
    return Estimate(
        _vec(x, i), _vec(x, i + 3), (x[i + 6], x[i + 7], x[i + 8], x[i + 9]), _vec(x, i + 10), _vec(x, i + 13),
        x[i + 16], _vec(x, i + 17), _vec(x, i + 20), x[_COVARIANCE:_MEMORY].reshape((ERRORS, ERRORS)),
    )  # fmt: skip


@kernel
def _memory(x: Array, i: int) -> Memory:
    return Memory(
        _vec(x, i), _vec(x, i + 3), _vec(x, i + 6), _vec(x, i + 9), _vec(x, i + 12), _vec(x, i + 15),
        Course(_trim(x, i + 18), _trim(x, i + 24), _trim(x, i + 30)), _trim(x, i + 36), x[i + 42], x[i + 43],
        Flaps(x[i + 44], x[i + 45]),
        Disturbance(_vec(x, i + 46), _vec(x, i + 49), _vec(x, i + 52), _vec(x, i + 55), x[i + 58]),
        x[i + 59], x[i + 60], x[i + 61], x[i + 62],
    )  # fmt: skip


@kernel
def loop_of(x: Array) -> LoopState:
    """The loop's state from its array, whose part with the covariance it shares."""
    return LoopState(
        State(
            x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13], x[14], x[15], x[16]
        ),
        GustState(x[17], x[18], x[19], x[20], x[21]),
        _sensors(x, _SENSORS),
        _estimate(x, _ESTIMATE),
        _memory(x, _MEMORY),
    )


@kernel
def _put3(x: Array, i: int, v: Vec3) -> None:
    x[i], x[i + 1], x[i + 2] = v[0], v[1], v[2]


@kernel
def _put_sensors(x: Array, i: int, e: SensorState) -> None:
    _put3(x, i, e.gyro_bias)
    _put3(x, i + 3, e.accel_bias)
    _put3(x, i + 6, e.mag_bias)
    _put3(x, i + 9, e.gnss_wander)
    x[i + 12] = e.baro_wander
    _put3(x, i + 13, e.gyro_rad_s)
    _put3(x, i + 16, e.accel_m_s2)


@kernel
def _put_estimate(x: Array, i: int, e: Estimate) -> None:
    _put3(x, i, e.position_N)
    _put3(x, i + 3, e.velocity_N)
    x[i + 6], x[i + 7], x[i + 8], x[i + 9] = e.q_NB[0], e.q_NB[1], e.q_NB[2], e.q_NB[3]
    _put3(x, i + 10, e.gyro_bias)
    _put3(x, i + 13, e.accel_bias)
    x[i + 16] = e.baro_offset_m
    _put3(x, i + 17, e.rates_B)
    _put3(x, i + 20, e.force_B)


@kernel
def _put_memory(x: Array, i: int, m: Memory) -> None:
    _put3(x, i, m.position_integral)
    _put3(x, i + 3, m.velocity_integral)
    _put3(x, i + 6, m.attitude_integral)
    _put3(x, i + 9, m.rate_integral)
    _put3(x, i + 12, m.velocity_error_smoothed)
    _put3(x, i + 15, m.rate_error_smoothed)
    for k in range(6):
        x[i + 18 + k] = m.reference_trims.before[k]
        x[i + 24 + k] = m.reference_trims.now[k]
        x[i + 30 + k] = m.reference_trims.after[k]
        x[i + 36 + k] = m.command_trim[k]
    x[i + 42], x[i + 43], x[i + 44], x[i + 45] = m.flow_left_N, m.flow_right_N, m.flaps.left_rad, m.flaps.right_rad
    d = m.disturbance
    _put3(x, i + 46, d.acceleration_N)
    _put3(x, i + 49, d.angular_B)
    _put3(x, i + 52, d.velocity_N)
    _put3(x, i + 55, d.rates_B)
    x[i + 58] = d.observing
    x[i + 59], x[i + 60], x[i + 61], x[i + 62] = m.thrust_short, m.roll_short, m.pitch_short, m.yaw_short


@kernel
def put_loop(x: Array, loop: LoopState) -> None:
    """The loop's state into its array."""
    _put_motion(x, loop)
    for j in range(ERRORS):
        for k in range(ERRORS):
            x[_COVARIANCE + ERRORS * j + k] = loop.estimate.covariance[j, k]


@kernel
def _put_motion(x: Array, loop: LoopState) -> None:
    """All of it but the covariance."""
    for i in range(17):
        x[i] = loop.state[i]
    for i in range(5):
        x[_GUSTS + i] = loop.gusts[i]
    _put_sensors(x, _SENSORS, loop.sensors)
    _put_estimate(x, _ESTIMATE, loop.estimate)
    _put_memory(x, _MEMORY, loop.memory)


def guidance_array(g: Guidance) -> Array:
    """The guidance as one flat array, the trajectory's segments at its end: what `run_in_place` takes.

    Build it where the guidance changes, not where it is used.
    """
    trajectory = g.trajectory
    n = trajectory.start_s.shape[0]
    x = np.empty(_PIECES + n + trajectory.coefficients.size)
    put_guidance(x, g)
    x[_PIECES : _PIECES + n] = trajectory.start_s
    x[_PIECES + n :] = trajectory.coefficients.ravel()
    return x


def put_guidance(x: Array, g: Guidance) -> None:
    """A guidance with the array's own trajectory into it."""
    x[:_PIECES] = (g.effort, *g[2:9], *g.steering, *g.actuation, g.trajectory.end_s)


@kernel
def guidance_of(x: Array) -> Guidance:
    """The guidance from its array, with which it shares the trajectory."""
    axis = DEGREE + 1
    n = (x.shape[0] - _PIECES) // (1 + 4 * axis)
    middle = _PIECES + n
    return Guidance(
        int(x[0]), Trajectory(x[_PIECES:middle], x[middle:].reshape((n, 4, axis)), x[_PIECES - 1]),
        x[1], x[2], x[3], x[4], x[5], x[6], x[7],
        Steering(x[8], x[9], x[10], x[11], x[12], x[13], x[14], x[15], x[16]),
        Actuation(x[17], x[18], x[19], x[20]),
    )  # fmt: skip


@kernel
def run_in_place(
    plants: Sequence[Plant],
    controllers: Sequence[Controller],
    guidance: Array,
    loop: Array,
    noise: Array,
    start_us: int,
    dt_us: int,
    steps: int,
    trace: Array,
    observed: Array,
    calm: Array,
    tally: Array,
    wanted: Array,
) -> int:
    """`closed_loop.run` with the state in `loop` (LOOP_SIZE) and what is seen in `observed` (OBSERVED_SIZE).

    guidance: as `guidance_array` makes it. calm: as `calm_array` does; where the vehicle comes to a tick that it does
    not pass over, the run ends before its last step. tally, wanted: see `tally.sample`. Returns the steps run.
    """
    flown, state = guidance_of(guidance), loop_of(loop)
    torque, now_us, done = plants[0].airframe.torque_coefficient, start_us, 0
    while True:
        to_tick_us = TICK_US - now_us % TICK_US
        n = min(steps - done, (to_tick_us + dt_us - 1) // dt_us)
        state, seen = run_on(
            plants, controllers, flown, state, noise[done : done + n], now_us, dt_us, n, trace[done : done + n]
        )
        now_us += n * dt_us
        done += n
        if n > 0 and now_us % TICK_US == 0:
            sample(tally, wanted, state.state, seen.reference, now_us)
        if done >= steps or not passes(calm, flown.trajectory, seen.nav, seen.feet_down, torque, state.state, now_us):
            break
    _put_motion(loop, state)  # the covariance is there
    for i in range(13):
        observed[i] = seen.nav[i]
    for i in range(15):
        observed[13 + i] = seen.command[i]
    for i in range(14):
        observed[28 + i] = seen.reference[i]
    _put3(observed, 42, seen.wind_N)
    _put3(observed, 45, seen.specific_force_B)
    _put3(observed, 48, seen.acceleration_N)
    observed[51] = seen.feet_down
    return done


def state_of(loop: Array) -> State:
    """The plant's state alone."""
    return State(*loop[:17].tolist())


def rotors_of(loop: Array) -> tuple[float, float]:
    """The propellers' speeds, left and right [rad/s]."""
    return loop.item(13), loop.item(14)


def accuracy_of(loop: Array) -> tuple[float, float]:
    """Standard deviations [m] that the filter gives its own level position and height."""
    variance = loop[_COVARIANCE : _MEMORY : ERRORS + 1].tolist()
    return math.sqrt(max(0.0, variance[0] + variance[1])), math.sqrt(max(0.0, variance[2]))


def nav_of(observed: Array) -> NavState:
    """The navigation state alone."""
    return NavState(*observed[_NAV].tolist())


def observed_of(observed: Array) -> Observed:
    """All that is seen, as tuples."""
    x = observed.tolist()
    return Observed(
        NavState(*x[_NAV]),
        Command(*x[_COMMAND]),
        Reference(*x[_REFERENCE]),
        (x[42], x[43], x[44]),
        (x[45], x[46], x[47]),
        (x[48], x[49], x[50]),
        int(x[51]),
    )
