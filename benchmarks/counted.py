"""Counts the floating-point operations of the kernels by running them as plain Python on numbers that count.

A process of its own (`arithmetic` starts it, with the JIT off): it reads a pickled Moment and prints JSON. What follows
from constants alone is not counted, as compiled code works it out once.
"""

import json
import math
import pickle
import sys
from collections import Counter
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from sitl.closed_loop import Controller, LoopState, Plant
from sitl.control.cascade import cascade
from sitl.control.guidance import Guidance
from sitl.estimation import corrections, error_state
from sitl.model.derivative import ActuatorCommand, derivative
from sitl.model.integrate import step
from sitl.model.sensors import observe, step_sensors

KINDS = ("plain", "divided", "root", "function")  # + − ×; ÷; square root; sine, exponential and the like
DT_S = 0.002
_FUNCTIONS = ("sin", "cos", "tan", "atan2", "exp", "asin", "hypot")
_done: Counter[str] = Counter()


class Moment(NamedTuple):
    """A vehicle's constants and its loop along a flight."""

    plant: Plant
    controller: Controller
    guidance: Guidance
    loop: LoopState
    command: ActuatorCommand
    t_s: float


class Counted(float):
    """A float whose operations are counted."""


def _counting(name: str, kind: str) -> Callable[..., Any]:
    plain = getattr(float, name)

    def operation(*numbers: Any) -> Counted:
        _done[kind] += 1
        return Counted(plain(*numbers))

    return operation


for _name in ("add", "sub", "mul", "truediv"):
    for _side in ("", "r"):
        _full = f"__{_side}{_name}__"
        setattr(Counted, _full, _counting(_full, "divided" if _name == "truediv" else "plain"))
for _name, _same in (("__neg__", float.__neg__), ("__abs__", float.__abs__)):  # a sign bit: not counted
    setattr(Counted, _name, lambda x, same=_same: Counted(same(x)))


def _function(plain: Callable[..., float], kind: str) -> Callable[..., float]:
    def function(*numbers: float) -> float:
        if not any(isinstance(x, Counted) for x in numbers):
            return plain(*numbers)
        _done[kind] += 1
        return Counted(plain(*numbers))

    return function


def counted(value: Any) -> Any:
    """The same tuple or array of numbers that count."""
    if isinstance(value, tuple):
        items = [counted(each) for each in value]
        return type(value)(*items) if hasattr(value, "_fields") else tuple(items)
    if isinstance(value, np.ndarray):
        return np.array([Counted(x) for x in value.ravel()] or [0.0], dtype=object).reshape(value.shape)
    return Counted(value)


def _zeros(count: int) -> Any:
    return counted(np.zeros(count))


def main() -> None:
    x: Moment = pickle.load(sys.stdin.buffer)
    for name in _FUNCTIONS:
        setattr(math, name, _function(getattr(math, name), "function"))
    math.sqrt = _function(math.sqrt, "root")
    corrections.np = SimpleNamespace(empty=_zeros, zeros=_zeros)  # type: ignore[attr-defined]
    loop, command, zero = counted(x.loop), counted(x.command), counted((0.0, 0.0, 0.0))
    a, k, s = x.plant.airframe, x.controller, loop.state
    nav = observe(x.plant.sensors, loop.sensors, s)
    found = {}
    for part, work in {
        "derivative": lambda: derivative(a, x.plant.gear, x.plant.actuators, s, command, zero),
        "plant": lambda: step(a, x.plant.gear, x.plant.actuators, s, command, zero, DT_S),
        "cascade": lambda: cascade(k.airframe, k.gains, k.settings, x.guidance, loop.memory, nav, Counted(x.t_s), DT_S),
        "sensors": lambda: step_sensors(x.plant.sensors, loop.sensors, zero, zero, _zeros(26), DT_S),
        "predicted": lambda: error_state.predicted(loop.estimate, zero, zero, DT_S),
        "spread": lambda: error_state.spread(loop.estimate, k.tuning, 0.01),
        "gnss": lambda: corrections.with_gnss(loop.estimate, k.tuning, zero, zero),
        "baro": lambda: corrections.with_baro(loop.estimate, k.tuning, Counted(0.0)),
        "field": lambda: corrections.with_field(loop.estimate, k.tuning, counted((0.3, 0.1, 0.9))),
    }.items():
        _done.clear()
        work()
        found[part] = [_done[kind] for kind in KINDS]
    print(json.dumps(found))


if __name__ == "__main__":
    main()
