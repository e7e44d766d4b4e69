"""The arithmetic of a control step: operations counted, time measured, beside the most that scalar code can do here.

`counted` tells the operations; the parts are timed compiled, each in a loop whose next round begins where the last one
ended, as a flight has it. The cascade's time is what a control step takes beside its Runge-Kutta step.
"""

import json
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from benchmarks import native
from benchmarks.counted import DT_S, Moment
from benchmarks.figure import Figure, told
from benchmarks.processes import ROOT
from sitl.closed_loop import run
from sitl.estimation.corrections import with_baro, with_field, with_gnss
from sitl.estimation.error_state import Estimate, Tuning, copied, predicted, spread
from sitl.jit import kernel
from sitl.model.sensors import NOISES, Sensors, SensorState, fitted, step_sensors
from sitl.vehicle import load_vehicle

Array = NDArray[np.float64]
_ROUNDS, _COUNT, _ALONG = 15, 20_000, 10_000
_NAMES = {
    "derivative": "derivative of the plant",
    "plant": "Runge-Kutta step: four of them",
    "cascade": "cascade and disturbance observer",
    "sensors": "sensors: slow errors and IMU",
    "predicted": "filter: the solution one IMU reading on",
    "spread": "filter: covariance, 100 a second",
    "gnss": "filter: satellite fix, 10 a second",
    "baro": "filter: height, 25 a second",
    "field": "filter: heading, 50 a second",
}


def measure(quick: bool) -> Iterator[Figure]:
    x = native.subject("yawsitter-real")
    loop, seen = run(x.plants, x.controllers, x.guidance, x.loop, native._NO_NOISE, 0, 2000, _ALONG, native._NO_TRACE)
    c = seen.command
    command = native.ActuatorCommand(c.thrust_left_N, c.thrust_right_N, c.flap_left_rad, c.flap_right_rad)
    plant = x.plant._replace(sensors=load_vehicle("yawsitter-real").sensors)
    counts = _counts(Moment(plant, x.controller, x.guidance, loop, command, _ALONG * DT_S))
    most = 32 * _COUNT / _best_s(lambda: _sixteen_chains(0.5, _COUNT)) * 1e-9
    yield told("products and sums, one number at a time, 16 chains beside each other", f"{most:.1f} a ns")
    t, e = x.controller.tuning, loop.estimate
    states = np.tile(native.flat(loop.state), (_COUNT, 1))
    seconds = {
        "derivative": _best_s(lambda: native.derivatives(x, states, command, (0.0, 0.0, 0.0))),
        "plant": _best_s(lambda: native.plant(x, loop.state, command, (0.0, 0.0, 0.0), _COUNT)),
        "cascade": _best_s(lambda: native.closed_loop(x, _COUNT)),
        "sensors": _best_s(lambda: _sensors(plant.sensors, loop.sensors, np.ones(NOISES), _COUNT)),
    } | {name: _best_s(lambda k=k: _filter(e, t, k, _COUNT)) for k, name in enumerate(_FILTER)}
    seconds["cascade"] -= seconds["plant"]
    for part, name in _NAMES.items():
        plain, divided, root, function = counts[part]
        ns = seconds[part] / _COUNT * 1e9
        done = f"{plain} + − ×, {divided} ÷, {root} √, {function} sines and the like"
        yield told(name, f"{ns:.0f} ns: {done}; {plain / ns:.2f} + − × a ns, {plain / ns / most:.0%} of the most")


def _counts(moment: Moment) -> dict[str, list[int]]:
    """Operations of each part by kind, from a process without the JIT."""
    done = subprocess.run(
        (sys.executable, "-m", "benchmarks.counted"), input=pickle.dumps(moment), stdout=subprocess.PIPE, check=True,
        cwd=ROOT, env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
    )  # fmt: skip
    counts: dict[str, list[int]] = json.loads(done.stdout)
    return counts


def _best_s(work: Callable[[], object]) -> float:
    """Processor time of the fastest of several rounds; the first compiles."""
    work()
    best = float("inf")
    for _ in range(_ROUNDS):
        begin_s = time.process_time()
        work()
        best = min(best, time.process_time() - begin_s)
    return best


@kernel
def _sixteen_chains(x: float, count: int) -> float:
    a = b = c = d = e = f = g = h = i = j = k = m = n = o = p = q = x
    for _ in range(count):
        a, b, c, d = a * x + 0.1, b * x + 0.2, c * x + 0.3, d * x + 0.4
        e, f, g, h = e * x + 0.5, f * x + 0.6, g * x + 0.7, h * x + 0.8
        i, j, k, m = i * x + 0.9, j * x + 1.0, k * x + 1.1, m * x + 1.2
        n, o, p, q = n * x + 1.3, o * x + 1.4, p * x + 1.5, q * x + 1.6
    return a + b + c + d + e + f + g + h + i + j + k + m + n + o + p + q


@kernel
def _sensors(p: Sensors, e: SensorState, noise: Array, count: int) -> SensorState:
    sensors = fitted(p)
    for _ in range(count):
        e = step_sensors(sensors, e, e.gyro_rad_s, e.accel_m_s2, noise, DT_S)
    return e


_FILTER = ("predicted", "spread", "gnss", "baro", "field")


@kernel
def _filter(e: Estimate, t: Tuning, part: int, count: int) -> Estimate:
    """So many rounds of one of _FILTER. Time stands still in `spread`, lest the covariance grow beyond all bounds."""
    e = copied(e)
    for _ in range(count):
        if part == 0:
            e = predicted(e, e.gyro_bias, e.accel_bias, 1e-9)
        elif part == 1:
            spread(e, t, 1e-9)
        elif part == 2:
            e = with_gnss(e, t, e.position_N, e.velocity_N)
        elif part == 3:
            e = with_baro(e, t, -e.position_N[2] + e.baro_offset_m)
        else:
            e = with_field(e, t, (0.3, 0.0, 0.9))
    return e
