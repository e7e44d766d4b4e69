"""Wind: a steady part and Dryden gusts near the ground."""

import math
from typing import NamedTuple

from sitl.jit import kernel
from sitl.quaternion import Vec3

_FOOT_M = 0.3048


class Wind(NamedTuple):
    """The air's own motion over the ground: steady part in N [m/s], and the gusts' horizontal standard deviation."""

    north_m_s: float
    east_m_s: float
    down_m_s: float
    gust_m_s: float


class GustState(NamedTuple):
    """Unit-variance filter states: along the wind; across it (two); vertical (two)."""

    along: float
    across_1: float
    across_2: float
    vertical_1: float
    vertical_2: float


CALM = GustState(0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def _driven(x: float, decay: float, noise: float) -> float:
    return decay * x + math.sqrt(1.0 - decay * decay) * noise


@kernel
def step_gusts(w: Wind, g: GustState, height_m: float, speed_m_s: float, noise: Vec3, dt_s: float) -> GustState:
    """The gusts' filters `dt_s` later, driven by three standard normal numbers.

    Dryden's spectra with the low-altitude scale lengths of MIL-F-8785C, L_w = h and
    L_u = L_v = h / (0.177 + 0.000823 h)^1.2 (h in feet, at least 10), passed at the vehicle's speed through the air
    (at least 1 m/s, so that a hovering vehicle in still air sees them go by too).
    """
    h = max(10.0, height_m / _FOOT_M)
    speed = max(1.0, speed_m_s)
    long_m = h / (0.177 + 0.000823 * h) ** 1.2 * _FOOT_M
    decay_long, decay_short = math.exp(-speed * dt_s / long_m), math.exp(-speed * dt_s / (h * _FOOT_M))
    return GustState(
        _driven(g.along, decay_long, noise[0]),
        _driven(g.across_1, decay_long, noise[1]),
        decay_long * g.across_2 + (1.0 - decay_long) * g.across_1,
        _driven(g.vertical_1, decay_short, noise[2]),
        decay_short * g.vertical_2 + (1.0 - decay_short) * g.vertical_1,
    )


@kernel
def wind_velocity(w: Wind, g: GustState, height_m: float) -> Vec3:
    """Steady wind plus gusts in N [m/s].

    Across and vertical follow (1 + √3 T s)/(1 + T s)² = √3/(1+Ts) + (1−√3)/(1+Ts)², whose variance is twice that of
    its first filter; the vertical part is weaker near the ground by (0.177 + 0.000823 h)^0.4.
    """
    if w.gust_m_s <= 0.0:
        return w.north_m_s, w.east_m_s, w.down_m_s
    h = max(10.0, height_m / _FOOT_M)
    root3 = math.sqrt(3.0)
    along = w.gust_m_s * g.along
    across = w.gust_m_s * (root3 * g.across_1 + (1.0 - root3) * g.across_2) / math.sqrt(2.0)
    vertical = w.gust_m_s * (root3 * g.vertical_1 + (1.0 - root3) * g.vertical_2) / math.sqrt(2.0)
    vertical *= (0.177 + 0.000823 * h) ** 0.4
    steady = math.sqrt(w.north_m_s * w.north_m_s + w.east_m_s * w.east_m_s)
    c, s = (w.north_m_s / steady, w.east_m_s / steady) if steady > 1e-9 else (1.0, 0.0)
    return w.north_m_s + c * along - s * across, w.east_m_s + s * along + c * across, w.down_m_s + vertical
