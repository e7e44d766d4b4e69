"""Trajectories from any state of motion to a point, smooth to the acceleration and within limits of all derivatives.

Quintic (minimum-jerk) segments: from rest to rest over a distance d in time T the peaks are v = 15/8 d/T,
a = 10/√3 d/T², j = 60 d/T³ (Flash & Hogan 1985), which gives the shortest T directly. From any other start the time is
stretched until the sampled peaks fit.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sitl.control.reference import DEGREE, Reference, Trajectory
from sitl.quaternion import Vec3

_SAMPLES = 24
_SHORTEST_S = 0.05


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


class Motion(NamedTuple):
    """Where a trajectory starts: position, velocity, acceleration in N, and heading with its rate."""

    position_N: Vec3
    velocity_N: Vec3
    acceleration_N: Vec3
    heading_rad: float
    heading_rate_rad_s: float = 0.0

    @classmethod
    def of(cls, r: Reference) -> "Motion":
        return cls(
            (r.north_m, r.east_m, r.down_m),
            (r.v_north_m_s, r.v_east_m_s, r.v_down_m_s),
            (r.a_north_m_s2, r.a_east_m_s2, r.a_down_m_s2),
            r.heading_rad,
            r.heading_rate_rad_s,
        )


def quintic(p0: float, v0: float, a0: float, p1: float, v1: float, a1: float, t: float) -> tuple[float, ...]:
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


def _rest_to_rest_s(d: float, v: float, a: float, j: float) -> float:
    return max(1.875 * d / v, math.sqrt(10.0 / math.sqrt(3.0) * d / a), math.cbrt(60.0 * d / j))


def _peaks(coefficients: np.ndarray, t: float) -> tuple[float, float, float, float, float, float]:
    """Sampled peaks: horizontal speed, climb, descent, horizontal, upward and downward acceleration."""
    tau = np.linspace(0.0, t, _SAMPLES)
    k = np.arange(1, DEGREE + 1)
    first = coefficients[:3, 1:] * k
    second = first[:, 1:] * k[:-1]
    v = first @ np.vander(tau, DEGREE, increasing=True).T
    a = second @ np.vander(tau, DEGREE - 1, increasing=True).T
    return (
        float(np.hypot(v[0], v[1]).max()),
        float(-v[2].min()),
        float(v[2].max()),
        float(np.hypot(a[0], a[1]).max()),
        float(-a[2].min()),
        float(a[2].max()),
    )


def heading_to(start_rad: float, target_rad: float) -> float:
    """The target heading, reached from the start the short way round (not wrapped)."""
    return start_rad + (target_rad - start_rad + math.pi) % (2.0 * math.pi) - math.pi


def to_point(
    start_s: float, start: Motion, target_N: Vec3, heading_rad: float, limits: Limits, arrival_N: Vec3 = (0.0, 0.0, 0.0)
) -> Trajectory:
    """One segment from `start` to `target_N`, reached with velocity `arrival_N` and no acceleration.

    Takes the shortest time in which speed, acceleration and jerk keep to the limits; a start that is itself beyond
    them is brought back within. `heading_rad` is reached the short way round.
    """
    p, v, a = start.position_N, start.velocity_N, start.acceleration_N
    m = limits
    horizontal = math.hypot(target_N[0] - p[0], target_N[1] - p[1])
    vertical = target_N[2] - p[2]
    up = vertical < 0.0
    t = max(
        _SHORTEST_S,
        _rest_to_rest_s(horizontal, m.speed_m_s, m.acceleration_m_s2, m.jerk_m_s3),
        _rest_to_rest_s(
            abs(vertical),
            m.climb_m_s if up else m.descent_m_s,
            m.climb_m_s2 if up else m.descent_m_s2,
            m.jerk_m_s3,
        ),
    )
    turned = heading_to(start.heading_rad, heading_rad)
    turn = abs(turned - start.heading_rad)
    turn_s = max(_SHORTEST_S, 1.875 * turn / m.heading_rad_s)
    moving = any((*v, *a, *arrival_N))
    if moving:
        speed, climb = math.hypot(v[0], v[1]), abs(v[2])
        t = max(t, 1.5 * speed / m.acceleration_m_s2, 1.5 * climb / min(m.climb_m_s2, m.descent_m_s2))
        t = _stretched(start, target_N, arrival_N, m, t)
    t = max(t, turn_s)
    c = _segment(start, target_N, arrival_N, t)
    c[3] = quintic(start.heading_rad, start.heading_rate_rad_s, 0.0, turned, 0.0, 0.0, t)
    return Trajectory(np.array([start_s]), c[None, :, :], start_s + t)


def _segment(start: Motion, target_N: Vec3, arrival_N: Vec3, t: float) -> np.ndarray:
    c = np.zeros((4, DEGREE + 1))
    for i in range(3):
        c[i] = quintic(
            start.position_N[i], start.velocity_N[i], start.acceleration_N[i], target_N[i], arrival_N[i], 0.0, t
        )
    return c


def _stretched(start: Motion, target_N: Vec3, arrival_N: Vec3, m: Limits, t: float) -> float:
    """The shortest time from t on, in steps of a tenth, in which the segment's sampled peaks keep to the limits."""
    v, a = start.velocity_N, start.acceleration_N
    # what the start or the end already exceeds can't be the segment's fault
    bounds = (
        max(m.speed_m_s, math.hypot(v[0], v[1]), math.hypot(arrival_N[0], arrival_N[1])),
        max(m.climb_m_s, -v[2], -arrival_N[2]),
        max(m.descent_m_s, v[2], arrival_N[2]),
        max(m.acceleration_m_s2, math.hypot(a[0], a[1])),
        max(m.climb_m_s2, -a[2]),
        max(m.descent_m_s2, a[2]),
    )
    best, best_excess = t, math.inf
    for _ in range(30):
        peaks = _peaks(_segment(start, target_N, arrival_N, t), t)
        excess = max(peak / bound for peak, bound in zip(peaks, bounds, strict=True))
        if excess <= 1.02:
            return t
        if excess < best_excess:
            best, best_excess = t, excess
        t *= 1.1
    return best


def through(
    start_s: float, start: Motion, points: Sequence[Vec3], headings: Sequence[float], limits: Limits
) -> Trajectory:
    """Segments that rest at each of `points` in turn."""
    starts, coefficients, t, at = [], [], start_s, start
    for point, heading in zip(points, headings, strict=True):
        leg = to_point(t, at, point, heading, limits)
        starts.append(t)
        coefficients.append(leg.coefficients[0])
        t = leg.end_s
        at = Motion(point, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), heading_to(at.heading_rad, heading))
    return Trajectory(np.array(starts), np.array(coefficients), t)


def circle(
    start_s: float, centre_N: Vec3, radius_m: float, angle_rad: float, turns: float, heading_rad: float, limits: Limits
) -> Trajectory:
    """Turns around a level circle from the point at `angle_rad` (from north toward east), starting and ending at rest.

    Positive turns go clockwise seen from above. The angle follows a minimum-jerk profile; pieces of the circle are
    quintics that agree with it in position, velocity and acceleration where they meet.
    """
    total = 2.0 * math.pi * turns
    length = abs(total) * radius_m
    # centripetal v²/r takes its share of the acceleration limit
    speed = min(limits.speed_m_s, math.sqrt(0.7 * limits.acceleration_m_s2 * radius_m))
    t_total = max(_SHORTEST_S, _rest_to_rest_s(length, speed, limits.acceleration_m_s2, limits.jerk_m_s3))
    pieces = max(8, math.ceil(abs(turns) * 32))

    def at(t: float) -> Motion:
        s = t / t_total
        angle = angle_rad + total * (10 * s**3 - 15 * s**4 + 6 * s**5)
        rate = total * (30 * s**2 - 60 * s**3 + 30 * s**4) / t_total
        acceleration = total * (60 * s - 180 * s**2 + 120 * s**3) / t_total**2
        c, n, r = math.cos(angle), math.sin(angle), radius_m
        return Motion(
            (centre_N[0] + r * c, centre_N[1] + r * n, centre_N[2]),
            (-r * n * rate, r * c * rate, 0.0),
            (-r * (c * rate**2 + n * acceleration), r * (-n * rate**2 + c * acceleration), 0.0),
            heading_rad,
        )

    starts = np.linspace(0.0, t_total, pieces + 1)
    coefficients = np.zeros((pieces, 4, DEGREE + 1))
    for k in range(pieces):
        one, two, h = at(starts[k]), at(starts[k + 1]), float(starts[k + 1] - starts[k])
        for i in range(3):
            coefficients[k, i] = quintic(
                one.position_N[i], one.velocity_N[i], one.acceleration_N[i],
                two.position_N[i], two.velocity_N[i], two.acceleration_N[i], h,
            )  # fmt: skip
        coefficients[k, 3, 0] = heading_rad
    return Trajectory(start_s + starts[:-1], coefficients, start_s + t_total)


def stopping(start_s: float, start: Motion, limits: Limits) -> Trajectory:
    """Brings the motion to rest at the nearest smooth point ahead; the heading stays as it is."""
    v = start.velocity_N
    speed, climb = math.hypot(v[0], v[1]), abs(v[2])
    t = max(0.4, 1.5 * speed / limits.acceleration_m_s2, 1.5 * climb / min(limits.climb_m_s2, limits.descent_m_s2))
    ahead = 0.5 * t  # a smooth stop covers half of what the speed would
    target = (
        start.position_N[0] + ahead * v[0],
        start.position_N[1] + ahead * v[1],
        start.position_N[2] + ahead * v[2],
    )
    c = _segment(start, target, (0.0, 0.0, 0.0), t)
    c[3] = quintic(start.heading_rad, start.heading_rate_rad_s, 0.0, start.heading_rad, 0.0, 0.0, t)
    return Trajectory(np.array([start_s]), c[None, :, :], start_s + t)


def at(trajectory: Trajectory, t_s: float) -> Reference:
    """The trajectory at one instant, as the cascade sees it (plain Python: no crossing into compiled code)."""
    starts = trajectory.start_s.tolist()
    k = len(starts) - 1
    while k > 0 and t_s < starts[k]:
        k -= 1
    resting = t_s < starts[0] or t_s >= trajectory.end_s
    t = max(min(t_s, trajectory.end_s) - starts[k], 0.0)
    values = []
    for c0, c1, c2, c3, c4, c5 in trajectory.coefficients[k].tolist():
        values.append(
            (
                ((((c5 * t + c4) * t + c3) * t + c2) * t + c1) * t + c0,
                (((5 * c5 * t + 4 * c4) * t + 3 * c3) * t + 2 * c2) * t + c1,
                ((20 * c5 * t + 12 * c4) * t + 6 * c3) * t + 2 * c2,
                (60 * c5 * t + 24 * c4) * t + 6 * c3,
            )
        )
    (n, vn, an, jn), (e, ve, ae, je), (d, vd, ad, jd), (h, vh, _, _) = values
    if resting:
        return Reference(n, e, d, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, h, 0.0)
    return Reference(n, e, d, vn, ve, vd, an, ae, ad, jn, je, jd, h, vh)
