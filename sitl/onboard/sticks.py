"""Position mode: sticks ask for velocities, centred sticks for a halt."""

import math

import numpy as np

from sitl.control.reference import DEGREE, Trajectory
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.parameters import Parameters

_DEAD = 0.05
_TURN_RAD_S2 = 1.5
_AHEAD_S = 1.0  # a stick's trajectory reaches so far; it is renewed every tick


class Sticks:
    """The latest stick positions, −1 … 1: forward, right, up, clockwise."""

    def __init__(self, parameters: Parameters) -> None:
        self._p = parameters
        self._axes = (0.0, 0.0, 0.0, 0.0)
        self._arrived_us: int | None = None
        self._moving = False

    def submit(self, axes: tuple[float, float, float, float], now_us: int) -> None:
        if all(math.isfinite(a) for a in axes):
            x, y, z, r = (0.0 if abs(a) < _DEAD else max(-1.0, min(1.0, a)) for a in axes)
            self._axes = (x, y, z, r)
            self._arrived_us = now_us

    def centre(self) -> None:
        """Forget the sticks' positions; without new ones the vehicle holds."""
        self._axes, self._arrived_us, self._moving = (0.0, 0.0, 0.0, 0.0), None, False

    @property
    def deflected(self) -> bool:
        return any(self._axes)

    def lost(self, now_us: int) -> bool:
        """Whether sticks that were in use have fallen silent."""
        return self._arrived_us is not None and (now_us - self._arrived_us) * 1e-6 > self._p["COM_RC_LOSS_T"]

    def tick(self, fix: Fix, guide: Guide) -> None:
        """Steer the reference's velocity toward what the sticks ask, at the acceleration limits.

        A standing vehicle stays where it is until the sticks ask for a climb.
        """
        if guide.standing and self._axes[2] <= 0.0:
            self._moving = False
            guide.rest_here(fix)
            return
        if guide.standing and self._moving:
            return  # the climb that lifts it off has begun
        if not self.deflected:
            if self._moving:
                self._moving = False
                guide.stop(fix)
            return
        self._moving = True
        start, m = guide.motion(fix), guide.limits()
        forward, right, up, turn = self._axes
        c, s = math.cos(start.heading_rad), math.sin(start.heading_rad)
        wanted = (
            m.speed_m_s * (c * forward - s * right),
            m.speed_m_s * (s * forward + c * right),
            -up * (m.climb_m_s if up > 0 else m.descent_m_s),
        )
        coefficients = np.zeros((1, 4, DEGREE + 1))
        for i in range(3):
            p, v, a = start.position_N[i], start.velocity_N[i], start.acceleration_N[i]
            most = m.acceleration_m_s2 if i < 2 else min(m.climb_m_s2, m.descent_m_s2)
            target = max(-most, min(most, 2.0 * (wanted[i] - v)))
            jerk = max(-m.jerk_m_s3, min(m.jerk_m_s3, (target - a) / 0.1))
            coefficients[0, i, :4] = (p, v, a / 2.0, jerk / 6.0)
        spin = (turn * m.heading_rad_s - start.heading_rate_rad_s) / 0.1
        spin = max(-_TURN_RAD_S2, min(_TURN_RAD_S2, spin))
        coefficients[0, 3, :3] = (start.heading_rad, start.heading_rate_rad_s, spin / 2.0)
        guide.put(Trajectory(np.array([fix.t_s]), coefficients, fix.t_s + _AHEAD_S))
