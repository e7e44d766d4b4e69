"""Level circles as trajectories: a number of turns between two rests, and an orbit at constant speed.

Positive turns go clockwise seen from above. Pieces of a circle are quintics that agree with it in position, velocity
and acceleration where they meet.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sitl.control.reference import DEGREE, Trajectory
from sitl.onboard.timing import SHORTEST_S, Limits, quintic
from sitl.quaternion import Vec3

_PIECES_A_TURN = 32
_AHEAD_TURNS = 2.0  # of an orbit without end: so far its trajectory reaches
_SHORTEST_RAMP_S = 0.5

Turning = tuple[float, float, float]
"""Angle [rad, from north toward east], its rate and angular acceleration."""


class Circle(NamedTuple):
    """A level circle in N [m]."""

    centre_N: Vec3
    radius_m: float

    def entry(self, here_N: Vec3) -> Vec3:
        """The point of the circle nearest to a place; to its north from the centre."""
        north, east = here_N[0] - self.centre_N[0], here_N[1] - self.centre_N[1]
        return self.point(math.atan2(east, north) if math.hypot(north, east) > 0.1 else 0.0)

    def point(self, angle_rad: float) -> Vec3:
        n, e, d = self.centre_N
        return n + self.radius_m * math.cos(angle_rad), e + self.radius_m * math.sin(angle_rad), d

    def angle(self, place_N: Vec3) -> float:
        return math.atan2(place_N[1] - self.centre_N[1], place_N[0] - self.centre_N[0])


def turns_at_rest(
    start_s: float, circle: Circle, angle_rad: float, turns: float, heading_rad: float, limits: Limits
) -> Trajectory:
    """Turns from the point at `angle_rad` that start and end at rest; the angle follows a minimum-jerk profile."""
    total, r = 2.0 * math.pi * turns, circle.radius_m
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

    def turning(t: float) -> Turning:
        s = t / t_total
        return (
            angle_rad + total * (10 * s**3 - 15 * s**4 + 6 * s**5),
            total * (30 * s**2 - 60 * s**3 + 30 * s**4) / t_total,
            total * (60 * s - 180 * s**2 + 120 * s**3) / t_total**2,
        )

    return _joined(start_s, circle, turning, t_total, turns, heading_rad)


def orbit_speed(circle: Circle, limits: Limits) -> float:
    """The speed at which the circle can be flown within the limits of speed and horizontal acceleration."""
    return min(limits.speed_m_s, math.sqrt(0.9 * limits.acceleration_m_s2 * circle.radius_m))


def orbit(
    start_s: float,
    circle: Circle,
    angle_rad: float,
    rate_rad_s: float,
    heading_rad: float,
    limits: Limits,
    *,
    moving: bool,
    total_rad: float = math.inf,
) -> Trajectory:
    """Around the circle at a constant angular rate (positive: clockwise), for `total_rad` or as far ahead as is enough.

    It starts at rest and speeds up smoothly, or already `moving` at the rate. A finite `total_rad` ends at rest.
    """
    speed = abs(rate_rad_s) * circle.radius_m
    ramp_s = max(
        _SHORTEST_RAMP_S,
        1.875 * speed / limits.acceleration_m_s2,
        math.sqrt(10.0 / math.sqrt(3.0) * speed / limits.jerk_m_s3),
    )
    rise_s = 0.0 if moving else ramp_s
    fall_s = ramp_s if math.isfinite(total_rad) else 0.0
    ahead = total_rad if math.isfinite(total_rad) else 2.0 * math.pi * _AHEAD_TURNS
    even_s = ahead / abs(rate_rad_s) - 0.5 * (rise_s + fall_s)
    if even_s < 0.0:  # too short to reach the speed
        turns = math.copysign(total_rad / (2.0 * math.pi), rate_rad_s)
        return turns_at_rest(start_s, circle, angle_rad, turns, heading_rad, limits)

    def turning(t: float) -> Turning:
        if t < rise_s:
            share, slope, covered = _ramp(t, rise_s)
            return angle_rad + rate_rad_s * covered, rate_rad_s * share, rate_rad_s * slope
        over_s = t - rise_s - even_s
        if over_s <= 0.0 or fall_s == 0.0:
            return angle_rad + rate_rad_s * (t - 0.5 * rise_s), rate_rad_s, 0.0
        share, slope, covered = _ramp(over_s, fall_s)
        covered_before = 0.5 * rise_s + even_s
        return (
            angle_rad + rate_rad_s * (covered_before + over_s - covered),
            rate_rad_s * (1.0 - share),
            -rate_rad_s * slope,
        )

    return _joined(start_s, circle, turning, rise_s + even_s + fall_s, ahead / (2.0 * math.pi), heading_rad)


def _ramp(t: float, duration_s: float) -> Turning:
    """The smooth step from 0 to 1: its value, its slope, and its integral."""
    s = t / duration_s
    return (
        10 * s**3 - 15 * s**4 + 6 * s**5,
        (30 * s**2 - 60 * s**3 + 30 * s**4) / duration_s,
        duration_s * (2.5 * s**4 - 3 * s**5 + s**6),
    )


def _joined(
    start_s: float,
    circle: Circle,
    turning: Callable[[float], Turning],
    duration_s: float,
    turns: float,
    heading_rad: float,
) -> Trajectory:
    centre, r = circle.centre_N, circle.radius_m

    def at(t: float) -> tuple[Turning, Turning]:
        """North and east there, each with velocity and acceleration."""
        angle, rate, angular = turning(t)
        c, n = math.cos(angle), math.sin(angle)
        return (
            (centre[0] + r * c, -r * n * rate, -r * (c * rate**2 + n * angular)),
            (centre[1] + r * n, r * c * rate, r * (-n * rate**2 + c * angular)),
        )

    pieces = max(8, math.ceil(abs(turns) * _PIECES_A_TURN))
    starts = np.linspace(0.0, duration_s, pieces + 1)
    coefficients = np.zeros((pieces, 4, DEGREE + 1))
    coefficients[:, 2, 0] = centre[2]
    coefficients[:, 3, 0] = heading_rad
    states = [at(t) for t in starts.tolist()]
    for k in range(pieces):
        h = float(starts[k + 1] - starts[k])
        for i in range(2):
            coefficients[k, i] = quintic(*states[k][i], *states[k + 1][i], h)
    return Trajectory(start_s + starts[:-1], coefficients, start_s + duration_s)
