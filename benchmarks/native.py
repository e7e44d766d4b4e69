"""The compiled step beside the same arithmetic written by hand in C (benchmarks/c), in one run and on one core.

The C is built into a temporary folder with `cc -O2`, without contracting a product and a sum into one rounding: then
both compute the same numbers, which is checked before they are timed. Both loop inside; no call from Python is timed.
Beside it the same C as fast as the compiler makes it for this very processor, which numba's compiler aims at too.
"""

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import flights
from benchmarks.figure import Figure, at_most, spread, told
from sitl.closed_loop import NOISE_COLUMNS, TRACE_COLUMNS, Controller, LoopState, Plant, run, start
from sitl.control.cascade import Memory
from sitl.control.guidance import Guidance
from sitl.jit import kernel
from sitl.model.airframe import loaded
from sitl.model.derivative import ActuatorCommand, derivative
from sitl.model.integrate import step
from sitl.model.rigid_body import State
from sitl.model.wind import Wind
from sitl.quaternion import Vec3
from sitl.records import packed
from sitl.vehicle import Vehicle, load_vehicle

Array = NDArray[np.float64]
LIMIT = 1.3
AGREE = 1e-12  # of C and Python, relative
_SOURCE = Path(__file__).parent / "c" / "native.c"
_PLAIN, _NATIVE = ("-O2",), ("-O3", "-march=native")
_FLAGS = ("-std=c11", "-ffp-contract=off", "-shared", "-fPIC")
_ROUNDS, _STATES, _STEPS = 25, 5_000, 20_000
_STEP_US = 2000
_NO_NOISE, _NO_TRACE = np.zeros((0, NOISE_COLUMNS)), np.zeros((0, len(TRACE_COLUMNS)))


def measure(quick: bool) -> Iterator[Figure]:
    with tempfile.TemporaryDirectory(prefix="yawsitter-benchmark-") as folder:
        plain, native = built(Path(folder)), built(Path(folder), _NATIVE)
        if plain is None or native is None:
            yield told("compiled step against C", "left out: there is no C compiler (cc) here")
            return
        x, states = subject("yawsitter-real"), random_states(_STATES)
        command, wind = ActuatorCommand(5.0, 6.0, 0.1, -0.2), (1.0, -2.0, 0.5)
        apart = difference(c_derivatives(plain, x, states, command, wind), derivatives(x, states, command, wind))
        yield at_most("derivative of the plant, Python and C apart by", [apart], AGREE, "of it")
        state, held = along(x)
        for what, count, python, c in (
            ("derivative of the plant, all loads", _STATES, partial(derivatives, x, states, command, wind),
             partial(c_derivatives, x=x, states=states, command=command, wind_N=wind)),
            ("plant: a Runge-Kutta step", _STEPS, partial(plant, x, state, held, wind, _STEPS),
             partial(c_plant, x=x, s=state, command=held, wind_N=wind, count=_STEPS)),
            ("control step: plant and cascade", _STEPS, partial(closed_loop, x, _STEPS),
             partial(c_closed_loop, x=x, count=_STEPS)),
        ):  # fmt: skip
            own, other, best = _in_turns(count, python, partial(c, plain), partial(c, native))
            yield at_most(f"{what}, time against C", [min(own) / min(other)], LIMIT, "×")
            yield told("  compiled Python", spread(own, "µs"))
            yield told("  C, -O2", spread(other, "µs"))
            yield told("  C, -O3 -march=native", f"{spread(best, 'µs')}; against it {min(own) / min(best):.2f} ×")


def _in_turns(count: int, *work: Callable[[], object]) -> list[list[float]]:
    """Microseconds each of `count` repetitions takes, by kind of work and round."""
    times: list[list[float]] = [[] for _ in work]
    for k in range(_ROUNDS + 1):
        for each, do in zip(times, work, strict=True):
            begin_s = time.process_time()
            do()
            if k > 0:  # the first round compiles and warms up
                each.append((time.process_time() - begin_s) / count * 1e6)
    return times


class Subject(NamedTuple):
    """A vehicle's constants and the rectangle before it, its state known to it, in still air."""

    plant: Plant
    controller: Controller
    plants: Any
    controllers: Any
    guidance: Guidance
    loop: LoopState


def subject(name: str) -> Subject:
    """A bundled vehicle before the rectangle."""
    vehicle = Vehicle(load_vehicle(name))
    spec, bare = vehicle.spec, flights.bare(name)
    plant = Plant(spec.airframe.airframe, spec.airframe.gear, spec.actuators, spec.sensors, Wind(0.0, 0.0, 0.0, 0.0), 1)
    plant = plant._replace(sensors=load_vehicle("yawsitter").sensors)  # perfect ones
    controller = vehicle.controller._replace(estimating=0.0)
    loop = start(controller, bare.loop.state)
    return Subject(plant, controller, packed(plant), packed(controller), bare.guidance, loop)


def random_states(count: int) -> Array:
    """(count, 17): any attitude, fast and slow, stalled and not, a part of them touching the ground."""
    random = np.random.default_rng(1)
    x = random.standard_normal((count, len(State._fields)))
    x[:, :3] *= (10.0, 10.0, 3.0)
    x[:, 3:6] *= 10.0 ** random.uniform(-6.0, 1.5, (count, 1))
    x[:, 6:10] /= np.linalg.norm(x[:, 6:10], axis=1, keepdims=True)
    x[:, 10:13] *= 5.0
    x[:, 13:15] = random.uniform(0.0, 1500.0, (count, 2))
    x[:, 15:17] *= 0.3
    return x


def difference(a: Array, b: Array) -> float:
    """The greatest difference relative to the number itself, or to 1 where that is less: rates near zero are sums."""
    return float(np.max(np.abs(a - b) / np.maximum(np.abs(b), 1.0)))


# in Python


@kernel
def _derivatives(plants: Any, states: Array, command: ActuatorCommand, wind_N: Vec3, out: Array) -> None:
    p = plants[0]
    for i in range(states.shape[0]):
        s = states[i]
        state = State(
            s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9], s[10], s[11], s[12], s[13], s[14], s[15], s[16]
        )
        rates = derivative(loaded(p.airframe), p.gear, p.actuators, state, command, wind_N)
        for j in range(17):
            out[i, j] = rates[j]


def derivatives(x: Subject, states: Array, command: ActuatorCommand, wind_N: Vec3) -> Array:
    """(n, 17) rates of (n, 17) states."""
    out = np.empty_like(states)
    _derivatives(x.plants, states, command, wind_N, out)
    return out


@kernel
def _plant(plants: Any, s: State, command: ActuatorCommand, wind_N: Vec3, h_s: float, count: int) -> State:
    p = plants[0]
    airframe = loaded(p.airframe)
    for _ in range(count):
        s = step(airframe, p.gear, p.actuators, s, command, wind_N, h_s)
    return s


def plant(x: Subject, s: State, command: ActuatorCommand, wind_N: Vec3, count: int) -> State:
    """The state `count` Runge-Kutta steps later."""
    moved: State = _plant(x.plants, s, command, wind_N, _STEP_US * 1e-6, count)
    return moved


def closed_loop(x: Subject, count: int) -> tuple[State, Memory]:
    """The state and the cascade's memory after `count` control steps along the rectangle, from standing."""
    loop, _ = run(x.plants, x.controllers, x.guidance, x.loop, _NO_NOISE, 0, _STEP_US, count, _NO_TRACE)
    return loop.state, loop.memory


def along(x: Subject) -> tuple[State, ActuatorCommand]:
    """State and command ten seconds along the rectangle."""
    loop, seen = run(x.plants, x.controllers, x.guidance, x.loop, _NO_NOISE, 0, _STEP_US, 5_000, _NO_TRACE)
    c = seen.command
    return loop.state, ActuatorCommand(c.thrust_left_N, c.thrust_right_N, c.flap_left_rad, c.flap_right_rad)


# in C


def built(folder: Path, optimised: tuple[str, ...] = _PLAIN) -> ctypes.CDLL | None:
    """The C, compiled into `folder`; None where there is no compiler. Raises CalledProcessError where it fails."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    made = folder / f"native{optimised[0]}.so"
    subprocess.run((compiler, *optimised, *_FLAGS, str(_SOURCE), "-o", str(made), "-lm"), check=True)
    return ctypes.CDLL(str(made))


def flat(value: Any) -> Array:
    """The numbers of a NamedTuple, those in it and arrays, in order."""
    if isinstance(value, tuple):
        return np.concatenate([flat(each) for each in value])
    return np.asarray(value, dtype=np.float64).ravel()


def _pointers(*values: Any) -> list[Any]:
    arrays = [np.ascontiguousarray(flat(value)) for value in values]
    return [each.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for each in arrays]


def c_derivatives(c: ctypes.CDLL, x: Subject, states: Array, command: ActuatorCommand, wind_N: Vec3) -> Array:
    out, p = np.empty_like(states), x.plant
    c.derivatives(*_pointers(p.airframe, p.gear, p.actuators), *_held(states), *_pointers(command, wind_N),
                  ctypes.c_long(len(states)), *_held(out))  # fmt: skip
    return out


def _held(*arrays: Array) -> list[Any]:
    return [each.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for each in arrays]


def c_plant(c: ctypes.CDLL, x: Subject, s: State, command: ActuatorCommand, wind_N: Vec3, count: int) -> State:
    state, p = flat(s), x.plant
    c.plant(*_pointers(p.airframe, p.gear, p.actuators), *_held(state), *_pointers(command, wind_N),
            ctypes.c_double(_STEP_US * 1e-6), ctypes.c_long(count))  # fmt: skip
    return State(*state.tolist())


def c_closed_loop(c: ctypes.CDLL, x: Subject, count: int) -> tuple[Array, Array]:
    """(state, memory) as flat arrays; see `closed_loop`."""
    p, k, g = x.plant, x.controller, x.guidance
    state, memory = flat(x.loop.state), flat(x.loop.memory)
    c.closed_loop(
        *_pointers(p.airframe, k.airframe, p.gear, p.actuators, k.gains, k.settings, g[2:9],
                   g.trajectory.start_s, g.trajectory.coefficients),
        ctypes.c_double(g.trajectory.end_s), ctypes.c_long(len(g.trajectory.start_s)),
        *_held(state, memory), *_pointers((0.0, 0.0, 0.0)), ctypes.c_long(_STEP_US), ctypes.c_long(count),
    )  # fmt: skip
    return state, memory
