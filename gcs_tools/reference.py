"""Where the vehicle should be at each instant of a flight: position, velocity and acceleration, north-east-down.

Plain floats and no numpy: a reference is evaluated once per streamed target, where numpy's overhead would dominate.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple, Protocol

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)


class Setpoint(NamedTuple):
    """A reference at one instant (m, m/s, m/s², NED)."""

    position_m: Vector
    velocity_m_s: Vector
    acceleration_m_s2: Vector


class Reference(Protocol):
    def at(self, t_s: float) -> Setpoint:
        """The reference t_s seconds after the start of the flight; at rest before it and after its end."""
        ...


class TimedPoint(NamedTuple):
    t_s: float
    at_m: Vector


# Peak speed and acceleration of a rest-to-rest minimum-jerk move of length d in time T: 15/8 d/T and 10/√3 d/T².
PEAK_SPEED = 15.0 / 8.0
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)


def minimum_jerk(tau: float) -> tuple[float, float, float]:
    """The rest-to-rest quintic s(τ) = 10τ³ − 15τ⁴ + 6τ⁵ on 0..1 with its first two derivatives.

    It minimises the integral of squared jerk between two points at rest (Flash and Hogan, 1985).
    """
    rest = 1.0 - tau
    return (
        tau**3 * (10.0 + tau * (6.0 * tau - 15.0)),
        30.0 * tau**2 * rest**2,
        60.0 * tau * rest * (1.0 - 2.0 * tau),
    )


class Waypoints:
    """At rest at every point at its time, minimum jerk along the straight lines between."""

    def __init__(self, points: Sequence[TimedPoint]) -> None:
        self.points = tuple(points)
        self._times = [point.t_s for point in self.points]

    def at(self, t_s: float) -> Setpoint:
        after = bisect_right(self._times, t_s)
        if after == 0:
            return Setpoint(self.points[0].at_m, ZERO, ZERO)
        if after == len(self.points):
            return Setpoint(self.points[-1].at_m, ZERO, ZERO)
        (t0, (x0, y0, z0)), (t1, (x1, y1, z1)) = self.points[after - 1], self.points[after]
        span = t1 - t0
        s, v, a = minimum_jerk((t_s - t0) / span)
        v /= span
        a /= span * span
        dx, dy, dz = x1 - x0, y1 - y0, z1 - z0
        return Setpoint((x0 + dx * s, y0 + dy * s, z0 + dz * s), (dx * v, dy * v, dz * v), (dx * a, dy * a, dz * a))


class Knot(NamedTuple):
    t_s: float
    at_m: Vector
    velocity_m_s: Vector


class Spline:
    """Through every knot at its time with its velocity and without acceleration; quintic polynomials between.

    Position, velocity and acceleration are continuous.
    """

    def __init__(self, knots: Sequence[Knot]) -> None:
        self.knots = tuple(knots)
        self._times = [knot.t_s for knot in self.knots]

    def at(self, t_s: float) -> Setpoint:
        after = bisect_right(self._times, t_s)
        if after == 0:
            return Setpoint(self.knots[0].at_m, ZERO, ZERO)
        if after == len(self.knots):
            return Setpoint(self.knots[-1].at_m, ZERO, ZERO)
        (t0, p0, v0), (t1, p1, v1) = self.knots[after - 1], self.knots[after]
        span = t1 - t0
        tau = (t_s - t0) / span
        s, ds, dds = minimum_jerk(tau)
        # Hermite's quintics for the two velocities, where both accelerations are zero
        f, g = _departure(tau), _departure(1.0 - tau)
        rows = []
        for a, b, u, w in zip(p0, p1, v0, v1, strict=True):
            rows.append((
                a + (b - a) * s + span * (u * f[0] - w * g[0]),
                (b - a) * ds / span + u * f[1] + w * g[1],
                (b - a) * dds / span**2 + (u * f[2] - w * g[2]) / span,
            ))  # fmt: skip
        position, velocity, acceleration = zip(*rows, strict=True)
        return Setpoint(position, velocity, acceleration)


def _departure(tau: float) -> tuple[float, float, float]:
    """τ − 6τ³ + 8τ⁴ − 3τ⁵, which leaves with slope 1 and arrives at rest in zero, with its first two derivatives."""
    return (
        tau + tau**3 * (-6.0 + tau * (8.0 - 3.0 * tau)),
        1.0 + tau**2 * (-18.0 + tau * (32.0 - 15.0 * tau)),
        tau * (-36.0 + tau * (96.0 - 60.0 * tau)),
    )


class Circle:
    """A climb straight up from the start, then level laps of a circle that passes through the point above the start.

    bearing_rad is the direction from the start to the circle's centre (0 north, positive towards east).
    direction is +1 clockwise seen from above, −1 anticlockwise.
    ramp_s: the angular rate grows from zero over this time and falls to zero over the same time at the end, along the
    quintic step (so that position, velocity and acceleration are continuous); 0 keeps the rate constant from the
    first instant to the last, which asks for a jump in velocity at both ends.
    """

    def __init__(
        self,
        *,
        radius_m: float,
        altitude_m: float,
        climb_s: float,
        lap_s: float,
        laps: float = 1.0,
        ramp_s: float = 0.0,
        bearing_rad: float = 0.0,
        direction: int = 1,
    ) -> None:
        self._radius = radius_m
        self._climb = Waypoints([TimedPoint(0.0, ZERO), TimedPoint(climb_s, (0.0, 0.0, -altitude_m))])
        self._down = -altitude_m
        self._start = climb_s
        self._turning = lap_s * laps
        self._ramp = ramp_s
        self._rate = direction * 2.0 * math.pi * laps / (self._turning - ramp_s)
        self._centre = (radius_m * math.cos(bearing_rad), radius_m * math.sin(bearing_rad))
        self._bearing_back = bearing_rad + math.pi
        self.end_s = climb_s + self._turning

    @property
    def peak_speed_m_s(self) -> float:
        return abs(self._rate) * self._radius

    def _angle(self, t: float) -> tuple[float, float, float]:
        """Angle travelled t seconds into the laps, its rate and its acceleration (rad)."""
        ramp, rate = self._ramp, self._rate
        if ramp > 0.0 and t < ramp:
            return _ramped(t, ramp, rate)
        if ramp > 0.0 and t > self._turning - ramp:
            left, rate_now, acceleration = _ramped(self._turning - t, ramp, rate)
            return rate * (self._turning - ramp) - left, rate_now, -acceleration
        return rate * (t - 0.5 * ramp), rate, 0.0

    def at(self, t_s: float) -> Setpoint:
        t = t_s - self._start
        if t < 0.0:
            return self._climb.at(t_s)
        north, east = self._centre
        if t < self._turning:
            angle, rate, acceleration = self._angle(t)
        else:
            angle, rate, acceleration = self._rate * (self._turning - self._ramp), 0.0, 0.0
        r = self._radius
        cos, sin = math.cos(self._bearing_back + angle), math.sin(self._bearing_back + angle)
        along, inward = r * acceleration, r * rate * rate
        return Setpoint(
            (north + r * cos, east + r * sin, self._down),
            (-r * rate * sin, r * rate * cos, 0.0),
            (-along * sin - inward * cos, along * cos - inward * sin, 0.0),
        )


def _ramped(t: float, ramp_s: float, rate: float) -> tuple[float, float, float]:
    """Angle, rate and acceleration t seconds into a rise of the rate along the quintic step."""
    tau = t / ramp_s
    step, slope, _ = minimum_jerk(tau)
    area = tau**4 * (2.5 + tau * (tau - 3.0))  # ∫ of the quintic step
    return rate * ramp_s * area, rate * step, rate * slope / ramp_s
