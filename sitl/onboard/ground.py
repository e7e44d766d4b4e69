"""Ground contact: when the vehicle stands, flies and has landed, and when it has tipped over.

Plain state goes in and comes out; the commander acts on it. A standing vehicle idles until the reference leaves the
ground; a flying one idles again once the reference is on or below the ground and the feet are down.
"""

import math
from typing import NamedTuple

from sitl.control.guidance import Effort
from sitl.control.reference import Reference
from sitl.navigation import NavState
from sitl.onboard.guide import Fix
from sitl.onboard.modes import Landed
from sitl.onboard.touch import LIFT_M, LIFT_M_S, NEAR_GROUND_M, TIPPED, TOUCH_M

_TOUCH_M_S = 0.3
_REST_S = 0.4  # a reference that rests on the ground so long, with the vehicle just above it, lets it down
_TIPPED_S = 0.3
_TIPPED_M_S = 0.5


class Contact(NamedTuple):
    """How an armed vehicle stands to the ground."""

    effort: Effort
    landed: Landed
    down_since_us: int | None = None  # standing with idling motors
    rest_since_us: int | None = None  # the reference rests on the ground, the vehicle just above

    @property
    def standing(self) -> bool:
        return self.effort != Effort.FLY

    def standing_s(self, now_us: int) -> float:
        return 0.0 if self.down_since_us is None else (now_us - self.down_since_us) * 1e-6


class Intent(NamedTuple):
    """What the present mode is about."""

    taking_off: bool
    landing: bool
    lifting: bool | None = None  # whether the thrust lifts, where it is given; None: the reference tells

    @property
    def flying_is(self) -> Landed:
        if self.landing:
            return Landed.LANDING
        return Landed.TAKING_OFF if self.taking_off else Landed.IN_AIR


def contact(c: Contact, fix: Fix, r: Reference, intent: Intent) -> Contact:
    """The contact now, from the one of the last tick."""
    now_us, nav, feet_down = fix
    if c.standing:
        rises = r.down_m < nav.down_m - LIFT_M or r.v_down_m_s < -LIFT_M_S
        if intent.lifting or (rises and intent.lifting is None and not intent.landing):
            return Contact(Effort.FLY, Landed.TAKING_OFF if intent.taking_off else Landed.IN_AIR)
        return c if c.down_since_us is not None else c._replace(down_since_us=now_us)
    landed = intent.flying_is
    # where the vehicle takes off from is the ground; a reference at or below it means to stand
    grounded = r.down_m > -TOUCH_M and r.v_down_m_s > -LIFT_M_S if intent.lifting is None else not intent.lifting
    near = nav.down_m >= -NEAR_GROUND_M or feet_down > 0
    calm = abs(nav.v_down_m_s) < _TOUCH_M_S and math.hypot(nav.v_north_m_s, nav.v_east_m_s) < 2.0 * _TOUCH_M_S
    if not (near and grounded and calm):
        return Contact(Effort.FLY, landed)
    since_us = now_us if c.rest_since_us is None else c.rest_since_us
    resting = (now_us - since_us) * 1e-6 >= _REST_S and nav.down_m > -3.0 * TOUCH_M
    if feet_down > 0 or resting:
        return Contact(Effort.IDLE, Landed.ON_GROUND, now_us)
    return Contact(Effort.FLY, landed, None, since_us)


class Tilt(NamedTuple):
    """Whether the vehicle lies on the ground, and since when it has looked like that."""

    tipped_over: bool = False
    since_us: int | None = None


_UPRIGHT = Tilt()


def tilt(t: Tilt, now_us: int, nav: NavState, feet_down: int) -> Tilt:
    """The tilt now, from the one of the last tick. It ends only with the vehicle upright on its feet."""
    nose_down = 2.0 * (nav.qx * nav.qz - nav.qw * nav.qy)
    if nose_down <= TIPPED or nav.down_m <= -NEAR_GROUND_M:
        upright = nose_down < TIPPED and feet_down > 2
        return Tilt(True) if t.tipped_over and not upright else _UPRIGHT
    if math.hypot(nav.v_north_m_s, nav.v_east_m_s, nav.v_down_m_s) >= _TIPPED_M_S:
        return Tilt(t.tipped_over)
    since_us = now_us if t.since_us is None else t.since_us
    return Tilt(t.tipped_over or (now_us - since_us) * 1e-6 >= _TIPPED_S, since_us)
