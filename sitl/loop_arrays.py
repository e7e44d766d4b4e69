"""The closed loop over arrays that stay where they are: the way the vehicle crosses into compiled code.

Numba takes nested tuples apart and builds them again on every call, 10 µs for the loop's state and what is observed of
it: as much as five control steps. Here both live in flat arrays between calls, and become tuples inside.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sitl.closed_loop import Controller, LoopState, Observed, Plant, run
from sitl.control.cascade import Command, Memory
from sitl.control.feedforward import Trim
from sitl.control.guidance import Guidance
from sitl.control.reference import Reference
from sitl.jit import kernel
from sitl.model.rigid_body import State
from sitl.model.sensors import SensorState
from sitl.model.wind import GustState
from sitl.navigation import NavState
from sitl.quaternion import Vec3

Array = NDArray[np.float64]
LOOP_SIZE = 70
OBSERVED_SIZE = 52
_NAV, _COMMAND, _REFERENCE = slice(0, 13), slice(13, 28), slice(28, 42)


@kernel
def _vec(x: Array, i: int) -> Vec3:
    return x[i], x[i + 1], x[i + 2]


@kernel
def _trim(x: Array, i: int) -> Trim:
    return Trim(x[i], x[i + 1], x[i + 2], x[i + 3], x[i + 4], x[i + 5])


@kernel
def loop_of(x: Array) -> LoopState:
    """The loop's state from its array."""
    return LoopState(
        State(
            x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13], x[14], x[15], x[16]
        ),
        GustState(x[17], x[18], x[19], x[20], x[21]),
        SensorState(_vec(x, 22), _vec(x, 25), _vec(x, 28), _vec(x, 31)),
        Memory(
            _vec(x, 34), _vec(x, 37), _vec(x, 40), _vec(x, 43), _vec(x, 46), _vec(x, 49), _trim(x, 52), _trim(x, 58),
            x[64], x[65], x[66], x[67], x[68], x[69],
        ),
    )  # fmt: skip


@kernel
def _put3(x: Array, i: int, v: Vec3) -> None:
    x[i], x[i + 1], x[i + 2] = v[0], v[1], v[2]


@kernel
def put_loop(x: Array, loop: LoopState) -> None:
    """The loop's state into its array."""
    for i in range(17):
        x[i] = loop.state[i]
    for i in range(5):
        x[17 + i] = loop.gusts[i]
    e, m = loop.sensors, loop.memory
    _put3(x, 22, e.position)
    _put3(x, 25, e.velocity)
    _put3(x, 28, e.attitude)
    _put3(x, 31, e.rate)
    _put3(x, 34, m.position_integral)
    _put3(x, 37, m.velocity_integral)
    _put3(x, 40, m.attitude_integral)
    _put3(x, 43, m.rate_integral)
    _put3(x, 46, m.velocity_error_smoothed)
    _put3(x, 49, m.rate_error_smoothed)
    for i in range(6):
        x[52 + i] = m.reference_trim[i]
        x[58 + i] = m.command_trim[i]
    x[64], x[65] = m.flow_left_N, m.flow_right_N
    x[66], x[67], x[68], x[69] = m.thrust_short, m.roll_short, m.pitch_short, m.yaw_short


@kernel
def run_in_place(
    plants: Sequence[Plant],
    controllers: Sequence[Controller],
    guidance: Guidance,
    loop: Array,
    noise: Array,
    start_us: int,
    dt_us: int,
    steps: int,
    trace: Array,
    observed: Array,
) -> None:
    """`closed_loop.run` with the state in `loop` (LOOP_SIZE) and what is seen in `observed` (OBSERVED_SIZE)."""
    state, seen = run(plants, controllers, guidance, loop_of(loop), noise, start_us, dt_us, steps, trace)
    put_loop(loop, state)
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


def state_of(loop: Array) -> State:
    """The plant's state alone."""
    return State(*loop[:17].tolist())


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
