"""Loop analysis: poles, bandwidths and margins in hover, per gain set, kind of actuators and reading of M_des.

Each loop is looked at with the loops inside it closed and those outside it left out, as cascades are designed: the
rate loop sees the vehicle turn but not move, the attitude loop sees it turn under rate control, the velocity loop sees
it move. It is cut at one measurement at a time; the other two axes of the same loop stay closed. The measured velocity
goes two ways, into the velocity error and into the inverse model that cancels the wing's drag: only the first is cut.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.control.disturbance import Bandwidth
from sitl.control.gains import Gains, from_names
from sitl.margins import Margins, margins, response
from sitl.model.derivative import Actuators
from sitl.reproduce.linear import READINGS, Design, Hover, Linear, hover, linearised, read_as, taking_part
from sitl.vehicle import Vehicle, load_vehicle

Array = NDArray[np.float64]
IDEAL = Actuators(0.0, 0.0)
OFF = Bandwidth(0.0, 0.0)
HOMES = (("paper", "yawsitter", "ideal"), ("tuned", "yawsitter-real", "real"))  # gains, whose, made for which actuators
_GRID = 500
_LOWEST_RAD_S = 0.02
_MARGINAL_1_S = 1e-3  # a pole no faster than this is an integrator's, within the accuracy of the differences
FASTER_HZ = (2500, 12500)  # than the vehicle's own rate: whether an unstable reading is only a matter of sampling


class Cascade(NamedTuple):
    """One loop: which plant states it sees, which of the measurements are its own, their names."""

    loop: str
    states: tuple[int, ...]  # of x in `linear`
    own: tuple[int, int, int]
    axes: tuple[str, str, str]


_ACTUATORS = (12, 13, 14, 15)
CASCADES = (
    Cascade("rate", (9, 10, 11, *_ACTUATORS), (9, 10, 11), ("P", "Q", "R")),
    Cascade("attitude", (*range(6, 12), *_ACTUATORS), (6, 7, 8), ("φ", "θ", "ψ")),
    Cascade("velocity", (*range(3, 12), *_ACTUATORS), (3, 4, 5), ("north", "east", "down")),
    Cascade("position", tuple(range(16)), (0, 1, 2), ("north", "east", "down")),
)


def design(vehicle_name: str, actuators: Actuators | None = None, rate_hz: int | None = None) -> Design:
    """A vehicle's own loop, with its parameters in force, perfect navigation and no disturbance observer."""
    vehicle = Vehicle(load_vehicle(vehicle_name))
    spec = vehicle.spec
    lag = spec.actuators if actuators is None else actuators
    settings = vehicle.settings()._replace(motor_tau_s=lag.motor_tau_s, flap_tau_s=lag.flap_tau_s, disturbance=OFF)
    dt_s = 1.0 / (rate_hz or spec.control_rate_hz)
    return Design(spec.airframe.airframe, spec.airframe.gear, lag, from_names(spec.gains), settings, dt_s)


def poles(linear: Linear, cascade: Cascade) -> NDArray[np.complex128]:
    """Continuous equivalents ln(z) / h [1/s] of a loop's poles, all inside it closed; deadbeat ones left out."""
    kept = _kept(linear, cascade)
    z = np.linalg.eigvals(linear.closed(_fed(cascade))[np.ix_(kept, kept)]).astype(complex)
    s: NDArray[np.complex128] = np.log(z[np.abs(z) > 1e-6]) / linear.dt_s
    return s


def _fed(cascade: Cascade) -> Array:
    """Measurements of this loop and those inside it."""
    fed = np.zeros(12)
    fed[min(cascade.own) :] = 1.0
    return fed


def _kept(linear: Linear, cascade: Cascade) -> list[int]:
    """States of (x, m) that this loop consists of."""
    n = linear.A.shape[0]
    M = linear.closed(_fed(cascade))
    inside = [*cascade.states, *range(n, M.shape[0])]
    part = taking_part(M[np.ix_(inside, inside)], [inside.index(i) for i in cascade.own])
    return [inside[i] for i in part]


def open_loop(
    linear: Linear, gains: Gains, cascade: Cascade, axis: int, frequency_rad_s: Array
) -> NDArray[np.complex128]:
    """L(jω) of one axis, cut where its measurement enters its error."""
    own = cascade.own[axis]
    kept = _kept(linear, cascade)
    into = np.concatenate((linear.B @ linear.H[:, own], linear.F[:, own]))
    if cascade.loop == "velocity":
        # a position error e asks for the velocity (K_p + K_i h) e; the position's D acts on the velocity itself
        g = gains.position[axis]
        share = (1.0 + g.d) / (g.p + g.i * linear.dt_s)
        into = share * np.concatenate((linear.B @ linear.H[:, axis], linear.F[:, axis]))
    cut = linear.closed(_fed(cascade))
    cut[:, own] -= into
    out = np.array([1.0 if i == own else 0.0 for i in kept])
    return -response(cut[np.ix_(kept, kept)], into[kept], out, linear.dt_s, frequency_rad_s)


def grid(dt_s: float) -> Array:
    return np.geomspace(_LOWEST_RAD_S, 0.999 * math.pi / dt_s, _GRID)


def stable(s: NDArray[np.complex128]) -> bool:
    return bool(s.real.max(initial=-math.inf) < _MARGINAL_1_S)


def axis_margins(linear: Linear, gains: Gains) -> list[tuple[str, str, bool, Margins | None]]:
    """(loop, axis, whether the loop is stable, its margins where it is) from the inside out."""
    w = grid(linear.dt_s)
    rows: list[tuple[str, str, bool, Margins | None]] = []
    for cascade in CASCADES:
        ok = stable(poles(linear, cascade))
        for k, axis in enumerate(cascade.axes):
            rows.append((cascade.loop, axis, ok, margins(w, open_loop(linear, gains, cascade, k, w)) if ok else None))
    return rows


def analysed(d: Design, at: Hover, gains: str, actuators: str, reading: str) -> dict[str, Any]:
    """One line of the table of readings, and the loops' margins behind it, as plain data."""
    d = d._replace(gains=read_as(d.gains, reading, d.airframe))
    linear = linearised(d, at)
    s = poles(linear, CASCADES[-1])
    rows = axis_margins(linear, d.gains)
    return {
        "gains": gains,
        "actuators": actuators,
        "reading": reading,
        "rate_hz": round(1.0 / d.dt_s),
        "stable": stable(s),
        "unstable_loops": sorted({loop for loop, _, ok, _ in rows if not ok}),
        "worst_pole_1_s": _pair(s[np.argmax(s.real)]),
        "poles_1_s": [_pair(p) for p in s[np.argsort(s.real)]],
        "loops": [
            {"loop": loop, "axis": axis, "stable": ok, **(m._asdict() if m else {})} for loop, axis, ok, m in rows
        ],
    }


def _pair(s: complex) -> list[float]:
    return [float(s.real), float(s.imag)]


def analyse() -> list[dict[str, Any]]:
    """Every gain set with ideal and with real actuators, by every reading; the unstable ones at faster rates too."""
    lines = []
    real = load_vehicle("yawsitter-real").actuators
    for gains, home, _ in HOMES:
        for actuators, lag in (("ideal", IDEAL), ("real", real)):
            d = design(home, lag)
            at = hover(design(home, IDEAL))
            for reading in READINGS:
                line = analysed(d, at, gains, actuators, reading)
                lines.append(line)
                if line["stable"]:
                    continue
                for rate in FASTER_HZ:
                    faster = d._replace(dt_s=1.0 / rate)
                    lines.append(analysed(faster, hover(design(home, IDEAL, rate)), gains, actuators, reading))
    return lines


def shapes() -> dict[str, dict[str, Array]]:
    """By gain set and loop of the chain that moves the vehicle north: rows ω [rad/s] and |L|."""
    found = {}
    for gains, home, _ in HOMES:
        d = design(home)
        linear = linearised(d, hover(design(home, IDEAL)))
        w = grid(linear.dt_s)
        axes = (1, 1, 0, 0)  # pitch, then north
        loops = zip(CASCADES, axes, strict=True)
        found[gains] = {c.loop: np.vstack((w, np.abs(open_loop(linear, d.gains, c, k, w)))) for c, k in loops}
    return found


def unstable_zero() -> float:
    """The zero [1/s] in the right half plane from both flaps to the position north: what bounds that loop's speed.

    A flap that pitches the nose forward pushes the vehicle backward first. Zeros of x⁺ = A x + b u, y = c x with
    c b ≠ 0 are the eigenvalues of A − b (c b)⁻¹ c A.
    """
    d = design("yawsitter")
    linear = linearised(d, hover(d))
    b = linear.B[:, 2] + linear.B[:, 3]
    states = [0, 3, 7, 10]  # north, its speed, pitch and its rate
    A, b = linear.A[np.ix_(states, states)], b[states]
    zeros = np.linalg.eigvals(A - np.outer(b, A[0]) / b[0])
    s = np.log(zeros[np.abs(zeros) > 0.5].astype(complex)) / d.dt_s
    return float(s.real.max())
