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
from sitl.onboard.timing import SHORTEST_S, Axis, Limits, Polynomial, evaluated, quintic, shifted
from sitl.quaternion import Vec3

__all__ = ["COAST_S", "Limits", "Motion", "at", "circle", "heading_to", "plan", "quintic", "stopping", "to_point"]

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


def heading_to(start_rad: float, target_rad: float) -> float:
    """The target heading, reached from the start the short way round (not wrapped)."""
    return start_rad + (target_rad - start_rad + math.pi) % (2.0 * math.pi) - math.pi


def plan(
    start_s: float,
    start: Motion,
    limits: Limits,
    level_N: tuple[float, float] | None = None,
    down_m: float | None = None,
    heading_rad: float | None = None,
    arrival_N: Vec3 = (0.0, 0.0, 0.0),
) -> Trajectory:
    """From `start` to a level position, a height and a heading; what is None comes to rest smoothly ahead.

    Takes the shortest times in which speed, acceleration and jerk keep to the limits; a start that is itself beyond
    them is brought back within. `heading_rad` is reached the short way round. With `arrival_N`, which needs both a
    level position and a height, the trajectory passes its end with that velocity, if the limits allow it, and goes on
    with it for COAST_S.
    """
    p, v, a = start.position_N, start.velocity_N, start.acceleration_N
    n1, e1 = level_N if level_N is not None else (None, None)
    turned = None if heading_rad is None else heading_to(start.heading_rad, heading_rad)
    north, east = Axis(p[0], v[0], a[0], n1, arrival_N[0]), Axis(p[1], v[1], a[1], e1, arrival_N[1])
    down = Axis(p[2], v[2], a[2], down_m, arrival_N[2])
    heading = Axis(start.heading_rad, start.heading_rate_rad_s, 0.0, turned)
    passing_s: tuple[float, ...] = ()
    if any(arrival_N):
        passing_s = timing.passing_s((north, east, down), limits)
        if not passing_s:
            return plan(start_s, start, limits, level_N, down_m, heading_rad)
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


def circle(
    start_s: float, centre_N: Vec3, radius_m: float, angle_rad: float, turns: float, heading_rad: float, limits: Limits
) -> Trajectory:
    """Turns around a level circle from the point at `angle_rad` (from north toward east), starting and ending at rest.

    Positive turns go clockwise seen from above. The angle follows a minimum-jerk profile; pieces of the circle are
    quintics that agree with it in position, velocity and acceleration where they meet.
    """
    total, r = 2.0 * math.pi * turns, radius_m
    # at unit duration; in a time T the speed falls with T, the acceleration with T² and the jerk with T³
    s = np.linspace(0.0, 1.0, 201)
    rate = total * (30 * s**2 - 60 * s**3 + 30 * s**4)
    angular = total * (60 * s - 180 * s**2 + 120 * s**3)
    angular_jerk = total * (60 - 360 * s + 360 * s**2)
    speed = r * float(np.abs(rate).max())
    acceleration = r * float(np.hypot(rate**2, angular).max())
    jerk = r * float(np.hypot(angular_jerk - rate**3, 3.0 * rate * angular).max())
    t_total = max(
        SHORTEST_S,
        speed / limits.speed_m_s,
        math.sqrt(acceleration / limits.acceleration_m_s2),
        math.cbrt(jerk / limits.jerk_m_s3),
    )
    pieces = max(8, math.ceil(abs(turns) * 32))

    def at(t: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """North and east there, each with velocity and acceleration."""
        s = t / t_total
        angle = angle_rad + total * (10 * s**3 - 15 * s**4 + 6 * s**5)
        rate = total * (30 * s**2 - 60 * s**3 + 30 * s**4) / t_total
        angular = total * (60 * s - 180 * s**2 + 120 * s**3) / t_total**2
        c, n = math.cos(angle), math.sin(angle)
        return (
            (centre_N[0] + r * c, -r * n * rate, -r * (c * rate**2 + n * angular)),
            (centre_N[1] + r * n, r * c * rate, r * (-n * rate**2 + c * angular)),
        )

    starts = np.linspace(0.0, t_total, pieces + 1)
    coefficients = np.zeros((pieces, 4, DEGREE + 1))
    coefficients[:, 2, 0] = centre_N[2]
    coefficients[:, 3, 0] = heading_rad
    states = [at(t) for t in starts.tolist()]
    for k in range(pieces):
        h = float(starts[k + 1] - starts[k])
        for i in range(2):
            coefficients[k, i] = quintic(*states[k][i], *states[k + 1][i], h)
    return Trajectory(start_s + starts[:-1], coefficients, start_s + t_total)


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
