"""The closed loop in hover as matrices, by central differences through the very code that flies.

Discrete time, one control step: plant x⁺ = A x + B u, y = the first twelve of x; cascade m⁺ = E m + F y, u = G m + H y.
x: position and velocity (N), small rotation and rates (B), rotor speeds, flap angles, all as deviations from hover.
u: thrusts left and right [N], flaps left and right [rad]. m: whatever the cascade remembers.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.control.cascade import Memory, at_rest, cascade
from sitl.control.gains import Gains, Pid, Settings
from sitl.control.guidance import Effort, Guidance
from sitl.control.reference import rest_at
from sitl.frames import standing
from sitl.model.airframe import Airframe, Gear
from sitl.model.derivative import ActuatorCommand, Actuators
from sitl.model.integrate import step
from sitl.model.propulsion import rotor_speed
from sitl.model.rigid_body import State
from sitl.model.trim import solve
from sitl.navigation import NavState
from sitl.quaternion import conjugate, multiply

Array = NDArray[np.float64]
HEIGHT_M = 10.0
MEASURED = 12  # of x: what the cascade sees
_STILL = (0.0, 0.0, 0.0)
_T_S = 1.0
_SETTLE_S = 2.0  # enough from a trim that is exact already
_STEP = 1e-5
_READINGS = {"bracket": 0, "J⁻¹ × bracket": -1, "J × bracket": 1}
READINGS = tuple(_READINGS)


class Design(NamedTuple):
    """What is linearised: a vehicle, how it is controlled, and how often."""

    airframe: Airframe
    gear: Gear
    actuators: Actuators
    gains: Gains
    settings: Settings
    dt_s: float


class Linear(NamedTuple):
    """The matrices of the module's docstring."""

    A: Array
    B: Array
    E: Array
    F: Array
    G: Array
    H: Array
    dt_s: float

    def closed(self, fed: Array) -> Array:
        """Of (x, m) with the measurements fed back where `fed` (12,) is 1, and held where it is 0."""
        C = np.zeros((MEASURED, self.A.shape[0]))
        C[:, :MEASURED] = np.diag(fed)
        return np.block([[self.A + self.B @ self.H @ C, self.B @ self.G], [self.F @ C, self.E]])


def read_as(gains: Gains, reading: str, airframe: Airframe) -> Gains:
    """Rate gains for a reading of M_des: the printed bracket, multiplied by J⁻¹ or by J."""
    inertia = (airframe.jxx_kg_m2, airframe.jyy_kg_m2, airframe.jzz_kg_m2)
    factors = [j ** _READINGS[reading] for j in inertia]
    axes = [Pid(f * g.p, f * g.i, f * g.d) for f, g in zip(factors, gains.rate, strict=True)]
    return gains._replace(rate=type(gains.rate)(*axes))


def _numbers(x: Any) -> Iterator[float]:
    for value in x:
        if isinstance(value, tuple):
            yield from _numbers(value)
        else:
            yield float(value)


def _like(template: Any, values: Iterator[float]) -> Any:
    """`values` in the nesting of `template`."""
    parts = [_like(part, values) if isinstance(part, tuple) else next(values) for part in template]
    return type(template)(*parts) if hasattr(template, "_fields") else tuple(parts)


def moved(hover: State, x: Array) -> State:
    """The plant's state that deviates from hover by x."""
    q = multiply((hover.qw, hover.qx, hover.qy, hover.qz), (1.0, 0.5 * x[6], 0.5 * x[7], 0.5 * x[8]))
    k = 1.0 / math.sqrt(sum(c * c for c in q))
    flat = [*(hover[i] + x[i] for i in range(6)), *(k * c for c in q), *(hover[10 + i] + x[9 + i] for i in range(7))]
    return State(*map(float, flat))


def deviation(hover: State, s: State) -> list[float]:
    """The x of a state: the inverse of `moved`."""
    turned = multiply(conjugate((hover.qw, hover.qx, hover.qy, hover.qz)), (s.qw, s.qx, s.qy, s.qz))
    return [
        *(s[i] - hover[i] for i in range(6)),
        *(2.0 * c / turned[0] for c in turned[1:]),
        *(s[10 + i] - hover[10 + i] for i in range(7)),
    ]


def _nav(s: State) -> NavState:
    return NavState(*s[:13])


class Hover(NamedTuple):
    """The equilibrium: state, command and memory that reproduce themselves."""

    state: State
    command: ActuatorCommand
    memory: Memory


def _command(c: Any) -> ActuatorCommand:
    return ActuatorCommand(c.thrust_left_N, c.thrust_right_N, c.flap_left_rad, c.flap_right_rad)


def guidance() -> Guidance:
    return Guidance(int(Effort.FLY), rest_at(0.0, 0.0, -HEIGHT_M, 0.0))


def hover(d: Design) -> Hover:
    """Trim, and the cascade's memory settled at it.

    Where the rate loop's demand is zero its gains don't matter, so the equilibrium is the same for every reading of
    M_des, stable or not.
    """
    a, trim, g = d.airframe, solve(d.airframe), guidance()
    each = 0.5 * trim.thrust_N
    rotor = rotor_speed(a, each)
    at = (0.0, 0.0, -HEIGHT_M)
    state = State(*at, *_STILL, *standing(0.0, trim.pitch_rad), *_STILL, rotor, rotor, trim.flap_rad, trim.flap_rad)
    memory = at_rest(a, each)
    command = ActuatorCommand(each, each, trim.flap_rad, trim.flap_rad)
    for _ in range(round(_SETTLE_S / d.dt_s)):
        wanted, memory, _ = cascade(a, d.gains, d.settings, g, memory, _nav(state), _T_S, d.dt_s)
        command = _command(wanted)
    return Hover(state, command, memory)


def _columns(function: Any, at: Array, sizes: Array) -> Array:
    """The Jacobian of `function` at `at`, a column an argument."""
    columns = []
    for k, size in enumerate(sizes):
        h = np.zeros_like(at)
        h[k] = size
        columns.append((np.array(function(at + h)) - np.array(function(at - h))) / (2.0 * size))
    return np.array(columns).T


def linearised(d: Design, at: Hover | None = None, substeps: int = 1) -> Linear:
    """The loop of `d` around hover (or a given equilibrium)."""
    at = at if at is not None else hover(d)
    a, g, state, memory = d.airframe, guidance(), at.state, at.memory
    rest = np.array(list(_numbers(memory)))
    trim = np.array(at.command)
    n, m = 16, rest.size

    def plant(x: Array) -> list[float]:
        s, u = moved(state, x[:n]), ActuatorCommand(*map(float, trim + x[n:]))
        for _ in range(substeps):
            s = step(a, d.gear, d.actuators, s, u, _STILL, d.dt_s / substeps)
        return deviation(state, s)

    def control(x: Array) -> list[float]:
        remembered = _like(memory, iter((rest + x[:m]).tolist()))
        seen = _nav(moved(state, np.concatenate((x[m:], np.zeros(n - MEASURED)))))
        wanted, after, _ = cascade(a, d.gains, d.settings, g, remembered, seen, _T_S, d.dt_s)
        return [*(v - r for v, r in zip(_numbers(after), rest, strict=True)), *np.array(_command(wanted)) - trim]

    sizes = np.full(n + 4, _STEP)
    sizes[12:14] *= 100.0  # rotors, rad/s
    P = _columns(plant, np.zeros(n + 4), sizes)
    K = _columns(control, np.zeros(m + MEASURED), np.full(m + MEASURED, _STEP))
    return Linear(P[:, :n], P[:, n:], K[:m, :m], K[:m, m:], K[m:, :m], K[m:, m:], d.dt_s)


def taking_part(M: Array, ends: Sequence[int], tolerance: float = 1e-7) -> list[int]:
    """States of x⁺ = M x that both depend on the states `ends` and act on them.

    What is left out are integrators whose gain is zero and memories that nothing feeds: their poles belong to no loop.
    """
    linked = np.abs(M) > tolerance
    return sorted(_reached(linked.T, ends) & _reached(linked, ends))


def _reached(linked: NDArray[np.bool_], start: Sequence[int]) -> set[int]:
    """States from which `linked[i, j]` (i reads j) leads, in any number of hops, starting at `start`."""
    seen, edge = set(start), list(start)
    while edge:
        for j in np.flatnonzero(linked[edge.pop()]):
            if int(j) not in seen:
                seen.add(int(j))
                edge.append(int(j))
    return seen
