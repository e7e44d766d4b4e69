"""How long a polynomial must take for its velocity, acceleration and jerk to keep to their limits.

Quintic (minimum-jerk) polynomials: from rest to rest over a distance d in time T the peaks are v = 15/8 d/T,
a = 10/√3 d/T², j = 60 d/T³ (Flash & Hogan 1985), which gives the shortest T directly. From a moving start the shortest
of a row of times is taken whose sampled peaks fit. Where none fits (a start at a limit with an acceleration beyond it)
there are two times: to a halt, and on from there.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SHORTEST_S = 0.05
_STOP_S = 0.4  # no halt is shorter
_STILL = 1e-3  # slower than this [m/s, m/s², rad/s] counts as at rest when times are chosen
HEADING_RAD_S2, _HEADING_RAD_S3 = 1.5, 20.0  # angular acceleration and jerk of a turn
_FITS = 1.02  # peaks are sampled: so much above a limit is within it
_SAMPLES = np.linspace(0.0, 1.0, 25)[:, None]
_STRETCH = 1.07 ** np.arange(64.0)

Polynomial = tuple[float, ...]  # six coefficients, ascending
Array = NDArray[np.float64]
Excess = Callable[[Array, Array, Array], Array]
"""Of velocities, accelerations and jerks (axes, samples, times): the worst ratio to its limit for each time."""


class Limits(NamedTuple):
    """Speed [m/s], acceleration [m/s²] and jerk [m/s³], horizontally, upward and downward; heading rate [rad/s]."""

    speed_m_s: float
    climb_m_s: float
    descent_m_s: float
    acceleration_m_s2: float
    climb_m_s2: float
    descent_m_s2: float
    jerk_m_s3: float
    heading_rad_s: float


class Axis(NamedTuple):
    """One axis' boundary values; p1 None: come to rest wherever that is smoothest."""

    p0: float
    v0: float
    a0: float
    p1: float | None
    v1: float = 0.0

    def polynomial(self, t: float) -> Polynomial:
        """From now to the end in time t; t 0 is for what rests already."""
        if t == 0.0:
            return (self.p0, 0.0, 0.0, 0.0, 0.0, 0.0)
        return quintic(self.p0, self.v0, self.a0, self.end(t), self.v1, 0.0, t)

    def end(self, t: float) -> float:
        # the velocity of a free stop is a cubic: it covers v t/2 + a t²/12
        return self.p0 + self.v0 * t / 2.0 + self.a0 * t * t / 12.0 if self.p1 is None else self.p1

    def halted(self) -> "Axis":
        return self._replace(p1=None, v1=0.0)

    @property
    def moving(self) -> bool:
        return max(abs(self.v0), abs(self.a0), abs(self.v1)) > _STILL


def quintic(p0: float, v0: float, a0: float, p1: float, v1: float, a1: float, t: float) -> Polynomial:
    """Coefficients (ascending) of the quintic from (p0, v0, a0) at 0 to (p1, v1, a1) at t."""
    dp = p1 - p0 - v0 * t - 0.5 * a0 * t * t
    dv = v1 - v0 - a0 * t
    da = a1 - a0
    return (
        p0,
        v0,
        0.5 * a0,
        (10.0 * dp / t - 4.0 * dv + 0.5 * da * t) / (t * t),
        (-15.0 * dp / t + 7.0 * dv - da * t) / (t * t * t),
        (6.0 * dp / t - 3.0 * dv + 0.5 * da * t) / (t * t * t * t),
    )


def evaluated(c: Polynomial, t: float) -> tuple[float, float, float, float]:
    """Value and first three derivatives at t."""
    c0, c1, c2, c3, c4, c5 = c
    return (
        ((((c5 * t + c4) * t + c3) * t + c2) * t + c1) * t + c0,
        (((5.0 * c5 * t + 4.0 * c4) * t + 3.0 * c3) * t + 2.0 * c2) * t + c1,
        ((20.0 * c5 * t + 12.0 * c4) * t + 6.0 * c3) * t + 2.0 * c2,
        (60.0 * c5 * t + 24.0 * c4) * t + 6.0 * c3,
    )


def shifted(c: Polynomial, t: float) -> Polynomial:
    """The same polynomial, told from t on (Taylor)."""
    x, v, a, j = evaluated(c, t)
    return (x, v, a / 2.0, j / 6.0, 5.0 * c[5] * t + c[4], c[5])


def _rest_to_rest_s(d: float, v: float, a: float, j: float) -> float:
    return max(SHORTEST_S, 1.875 * d / v, math.sqrt(10.0 / math.sqrt(3.0) * d / a), math.cbrt(60.0 * d / j))


def _settling_s(axes: tuple[Axis, ...]) -> float:
    """What is too slow to count as moving still wants its time to come to rest."""
    return _STOP_S if any(x.v0 or x.a0 or x.v1 for x in axes) else 0.0


def _least_s(axes: tuple[Axis, ...], v: float, a: float, j: float) -> float:
    """A time that is certainly not too long, where the search for a moving start begins."""
    far = math.hypot(*(0.0 if x.p1 is None else x.p1 - x.p0 for x in axes))
    change = math.hypot(*(x.v1 - x.v0 for x in axes))
    return max(_STOP_S, 0.9 * far / v, change / a, math.sqrt(3.0 * change / j), math.hypot(*(x.a0 for x in axes)) / j)


def _times_s(axes: tuple[Axis, ...], excess: Excess, least_s: float) -> tuple[float, ...]:
    """The shortest time from `least_s` on, in steps of 7 %, in which the axes' peaks fit; () if none does."""
    t: Array = least_s * _STRETCH
    tau = _SAMPLES * t
    values = []
    for x in axes:
        end = x.p0 + x.v0 * t / 2.0 + x.a0 * t * t / 12.0 if x.p1 is None else x.p1
        values.append(evaluated(quintic(x.p0, x.v0, x.a0, end, x.v1, 0.0, t), tau))  # type: ignore[arg-type]
    v, a, j = (np.array([value[k] for value in values]) for k in (1, 2, 3))
    ratio = excess(v, a, j)
    fits = np.flatnonzero(ratio <= _FITS)
    if not fits.size and axes[0].p1 is None:
        return (float(t[ratio.argmin()]),)  # a halt there must be
    return (float(t[fits[0]]),) if fits.size else ()


def _level_excess(axes: tuple[Axis, ...], m: Limits) -> Excess:
    """What the start or the end already exceeds can't be the trajectory's fault."""
    start_a = math.hypot(axes[0].a0, axes[1].a0)
    speed = max(m.speed_m_s, math.hypot(axes[0].v0, axes[1].v0), math.hypot(axes[0].v1, axes[1].v1))
    speed += 0.5 * start_a * start_a / m.jerk_m_s3
    acceleration = max(m.acceleration_m_s2, start_a)

    def excess(v: Array, a: Array, j: Array) -> Array:
        ratios = np.hypot(*v) / speed, np.hypot(*a) / acceleration, np.hypot(*j) / m.jerk_m_s3
        worst: Array = np.maximum.reduce(ratios).max(axis=0)
        return worst

    return excess


def _line_excess(x: Axis, least_v: float, most_v: float, least_a: float, most_a: float, jerk: float) -> Excess:
    """The same for a single axis with limits of its own to either side; all are given as positive numbers."""
    gained = 0.5 * x.a0 * x.a0 / jerk
    low_v, high_v = max(least_v, -x.v0, -x.v1) + gained, max(most_v, x.v0, x.v1) + gained
    low_a, high_a = max(least_a, -x.a0), max(most_a, x.a0)

    def excess(v: Array, a: Array, j: Array) -> Array:
        ratios = -v[0] / low_v, v[0] / high_v, -a[0] / low_a, a[0] / high_a, np.abs(j[0]) / jerk
        worst: Array = np.maximum.reduce(ratios).max(axis=0)
        return worst

    return excess


def _height_excess(x: Axis, m: Limits) -> Excess:
    return _line_excess(x, m.climb_m_s, m.descent_m_s, m.climb_m_s2, m.descent_m_s2, m.jerk_m_s3)


def _level_least_s(axes: tuple[Axis, ...], m: Limits) -> float:
    return _least_s(axes, m.speed_m_s, m.acceleration_m_s2, m.jerk_m_s3)


def _height_least_s(x: Axis, m: Limits) -> float:
    return _least_s((x,), max(m.climb_m_s, m.descent_m_s), max(m.climb_m_s2, m.descent_m_s2), m.jerk_m_s3)


def level_s(axes: tuple[Axis, Axis], m: Limits) -> tuple[float, ...]:
    """Times of the level axes' one after the other polynomials: one, or two with a halt between."""
    if any(x.moving for x in axes):
        times = _times_s(axes, _level_excess(axes, m), _level_least_s(axes, m))
        return times or _with_halt(axes, lambda group: level_s((group[0], group[1]), m))
    if axes[0].p1 is None or axes[1].p1 is None:
        return (_STOP_S if any(x.v0 or x.a0 for x in axes) else 0.0,)
    distance = math.hypot(axes[0].p1 - axes[0].p0, axes[1].p1 - axes[1].p0)
    return (max(_settling_s(axes), _rest_to_rest_s(distance, m.speed_m_s, m.acceleration_m_s2, m.jerk_m_s3)),)


def height_s(x: Axis, m: Limits) -> tuple[float, ...]:
    if x.moving:
        times = _times_s((x,), _height_excess(x, m), _height_least_s(x, m))
        return times or _with_halt((x,), lambda group: height_s(group[0], m))
    if x.p1 is None:
        return (_STOP_S if x.v0 or x.a0 else 0.0,)
    # it speeds up in one direction and brakes in the other
    acceleration = min(m.climb_m_s2, m.descent_m_s2)
    speed = m.climb_m_s if x.p1 < x.p0 else m.descent_m_s
    return (max(_settling_s((x,)), _rest_to_rest_s(abs(x.p1 - x.p0), speed, acceleration, m.jerk_m_s3)),)


def turn_s(x: Axis, m: Limits) -> tuple[float, ...]:
    if x.p1 is None:
        return (max(_STOP_S, 1.5 * abs(x.v0) / HEADING_RAD_S2) if x.v0 else 0.0,)
    rate, acceleration, jerk = m.heading_rad_s, HEADING_RAD_S2, _HEADING_RAD_S3
    if x.moving:
        excess = _line_excess(x, rate, rate, acceleration, acceleration, jerk)
        times = _times_s((x,), excess, _least_s((x,), rate, acceleration, jerk))
        return times or _with_halt((x,), lambda group: turn_s(group[0], m))
    return (max(_settling_s((x,)), _rest_to_rest_s(abs(x.p1 - x.p0), rate, acceleration, jerk)),)


def _with_halt(axes: tuple[Axis, ...], times_s: Callable[[tuple[Axis, ...]], tuple[float, ...]]) -> tuple[float, ...]:
    (halt_s,) = times_s(tuple(x.halted() for x in axes))
    (rest_s,) = times_s(tuple(Axis(x.halted().end(halt_s), 0.0, 0.0, x.p1) for x in axes))
    return halt_s, rest_s


def passing_s(axes: tuple[Axis, Axis, Axis], m: Limits) -> tuple[float, ...]:
    """All three axes at once, for an end that is passed with a velocity; () where there is no such time."""
    level, height = _level_excess(axes[:2], m), _height_excess(axes[2], m)

    def excess(v: Array, a: Array, j: Array) -> Array:
        worst: Array = np.maximum(level(v[:2], a[:2], j[:2]), height(v[2:], a[2:], j[2:]))
        return worst

    return _times_s(axes, excess, max(_level_least_s(axes[:2], m), _height_least_s(axes[2], m)))
