"""Trajectories from any state of motion to a point, smooth to the acceleration and within limits of all derivatives.

The level axes together, the height and the heading are three groups. A group that starts at rest takes as long as the
slowest, so that a flight from rest is a straight line; one that is moving takes the time it needs itself, since a
moving start that is stretched swings out first.
"""

import math
from typing import NamedTuple

import numpy as np

from sitl.control.reference import DEGREE, Reference, Trajectory
from sitl.onboard import timing
from sitl.onboard.timing import SHORTEST_S, Axis, Limits, Polynomial, evaluated, shifted
from sitl.quaternion import Vec3

__all__ = ["COAST_S", "Limits", "Motion", "at", "heading_to", "plan", "stopping", "to_point"]

COAST_S = 0.1  # a trajectory that arrives with a velocity goes on with it so long


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


def heading_to(start_rad: float, target_rad: float, way: int = 0) -> float:
    """The target heading, reached from the start (not wrapped): way 0 the short way, 1 clockwise, −1 anticlockwise."""
    full = 2.0 * math.pi
    if way > 0:
        return start_rad + (target_rad - start_rad) % full
    if way < 0:
        return start_rad - (start_rad - target_rad) % full
    return start_rad + (target_rad - start_rad + math.pi) % full - math.pi


def plan(
    start_s: float,
    start: Motion,
    limits: Limits,
    level_N: tuple[float, float] | None = None,
    down_m: float | None = None,
    heading_rad: float | None = None,
    arrival_N: Vec3 = (0.0, 0.0, 0.0),
    way: int = 0,
) -> Trajectory:
    """From `start` to a level position, a height and a heading; what is None comes to rest smoothly ahead.

    Takes the shortest times in which speed, acceleration and jerk keep to the limits; a start that is itself beyond
    them is brought back within. `heading_rad` is reached by `way`, see heading_to. With `arrival_N`, which needs both a
    level position and a height, the trajectory passes its end with that velocity, if the limits allow it, and goes on
    with it for COAST_S.
    """
    p, v, a = start.position_N, start.velocity_N, start.acceleration_N
    n1, e1 = level_N if level_N is not None else (None, None)
    turned = None if heading_rad is None else heading_to(start.heading_rad, heading_rad, way)
    north, east = Axis(p[0], v[0], a[0], n1, arrival_N[0]), Axis(p[1], v[1], a[1], e1, arrival_N[1])
    down = Axis(p[2], v[2], a[2], down_m, arrival_N[2])
    heading = Axis(start.heading_rad, start.heading_rate_rad_s, 0.0, turned)
    passing_s: tuple[float, ...] = ()
    if any(arrival_N):
        passing_s = timing.passing_s((north, east, down), limits)
        if not passing_s:
            return plan(start_s, start, limits, level_N, down_m, heading_rad, way=way)
    level_s = passing_s or timing.level_s((north, east), limits)
    height_s = passing_s or timing.height_s(down, limits)
    turn_s = timing.turn_s(heading, limits)
    travel_s = max(sum(level_s), sum(height_s))
    if level_N is not None and not (north.moving or east.moving):
        level_s = (travel_s,)
    if down_m is not None and not down.moving:
        height_s = (travel_s,)
    if heading_rad is not None and not heading.moving:
        turn_s = (max(*turn_s, travel_s),)
    end_s = travel_s + COAST_S if passing_s else max(travel_s, sum(turn_s), SHORTEST_S)
    return _joined(start_s, ((north, level_s), (east, level_s), (down, height_s), (heading, turn_s)), end_s)


def _pieces(axis: Axis, times_s: tuple[float, ...]) -> list[tuple[float, Polynomial]]:
    """Polynomials, each with its start; the last is what follows the end: rest, or the arrival's velocity."""
    pieces, now_s, x = [], 0.0, axis
    if len(times_s) == 2:
        x = axis.halted()
        pieces.append((0.0, x.polynomial(times_s[0])))
        now_s, x = times_s[0], Axis(x.end(times_s[0]), 0.0, 0.0, axis.p1)
    t = times_s[-1]
    pieces.append((now_s, x.polynomial(t)))
    pieces.append((now_s + t, (x.end(t), x.v1, 0.0, 0.0, 0.0, 0.0)))
    return pieces


def _joined(start_s: float, tracks: tuple[tuple[Axis, tuple[float, ...]], ...], end_s: float) -> Trajectory:
    """Axes that each have their own times, as segments cut at all of them."""
    axes = [_pieces(axis, times_s) for axis, times_s in tracks]
    cuts = sorted({0.0, *(t for pieces in axes for t, _ in pieces if t < end_s)})
    coefficients = np.zeros((len(cuts), 4, DEGREE + 1))
    for i, pieces in enumerate(axes):
        for k, cut in enumerate(cuts):
            since, c = next((t, c) for t, c in reversed(pieces) if t <= cut)
            coefficients[k, i] = shifted(c, cut - since) if cut > since else c
    return Trajectory(start_s + np.array(cuts), coefficients, start_s + end_s)


def to_point(
    start_s: float,
    start: Motion,
    target_N: Vec3,
    heading_rad: float | None,
    limits: Limits,
    arrival_N: Vec3 = (0.0, 0.0, 0.0),
) -> Trajectory:
    """To `target_N`, reached with velocity `arrival_N` and no acceleration; heading None: stop turning."""
    return plan(start_s, start, limits, (target_N[0], target_N[1]), target_N[2], heading_rad, arrival_N)


def stopping(start_s: float, start: Motion, limits: Limits) -> Trajectory:
    """Brings the motion and the turning to rest smoothly ahead."""
    return plan(start_s, start, limits)


def at(trajectory: Trajectory, t_s: float) -> Reference:
    """The trajectory at one instant, as the cascade sees it (plain Python: no crossing into compiled code)."""
    starts = trajectory.start_s
    first = k = 0
    if len(starts) > 1:
        k = max(int(starts.searchsorted(t_s, "right")) - 1, 0)
    first_s, start_s = starts.item(first), starts.item(k)
    resting = t_s < first_s or t_s >= trajectory.end_s
    t = max(min(t_s, trajectory.end_s) - start_s, 0.0)
    values = []
    for c in trajectory.coefficients[k].tolist():
        values.append(evaluated(c, t))
    (n, vn, an, jn), (e, ve, ae, je), (d, vd, ad, jd), (h, vh, _, _) = values
    if resting:
        return Reference(n, e, d, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, h, 0.0)
    return Reference(n, e, d, vn, ve, vd, an, ae, ad, jn, je, jd, h, vh)
