"""Keeping to the fence: what lies outside, and what is told and done when the vehicle does.

Outside is what the stored fence shuts out, what is further from home than GF_MAX_HOR_DIST or higher above it than
GF_MAX_VER_DIST (0: no limit). With GF_ACTION 0 nothing is. A breach is told and acted upon once, when it begins.
"""

import math
from enum import IntEnum
from typing import NamedTuple

from sitl.geodesy import GeoPoint, to_local
from sitl.onboard.fence import Fence, shut_out
from sitl.onboard.guide import Fix
from sitl.onboard.parameters import Parameters
from sitl.onboard.places import Places
from sitl.quaternion import Vec3

_REACTION_S = 0.3  # until a halt takes effect


class BreachKind(IntEnum):
    """FENCE_BREACH."""

    NONE = 0
    MAX_ALTITUDE = 2
    BOUNDARY = 3


class Violation(NamedTuple):
    """What a place outside the fence violates."""

    kind: BreachKind
    reason: str


class Breach(NamedTuple):
    """FENCE_STATUS: whether the vehicle is outside now, how often it has left, and the latest time it did."""

    outside: bool = False
    times: int = 0
    since_us: int = 0
    kind: BreachKind = BreachKind.NONE


class Geofence:
    """Judges places, and watches the vehicle's."""

    def __init__(self, parameters: Parameters, fence: Fence, places: Places) -> None:
        self._p, self._fence, self._places = parameters, fence, places
        self.breach = Breach()
        self._airborne_N: Vec3 | None = None
        fence.must_contain = self._must_contain

    @property
    def active(self) -> bool:
        return self._p["GF_ACTION"] != 0

    @property
    def present(self) -> bool:
        """Whether there is anything to keep to."""
        return bool(self._fence.areas) or self._p["GF_MAX_HOR_DIST"] > 0.0 or self._p["GF_MAX_VER_DIST"] > 0.0

    @property
    def limits(self) -> tuple[float, ...]:
        """The parameters that a violation depends on."""
        return self._p["GF_ACTION"], self._p["GF_MAX_HOR_DIST"], self._p["GF_MAX_VER_DIST"]

    def shut_out(self, point: GeoPoint) -> str:
        """Why home can't be at a place: it must lie within the stored fence, whatever GF_ACTION says."""
        area = shut_out(self._fence.areas, *to_local(self._places.origin, point.lat_deg, point.lon_deg))
        return f"would be {area.reason}" if area else ""

    def _must_contain(self) -> list[tuple[str, Vec3]]:
        places = [("home", self._places.home_N)]
        if self.active and self._airborne_N is not None:
            places.append(("the vehicle", self._airborne_N))
        return places

    def violation(self, point_N: Vec3) -> Violation | None:
        """Why a point lies outside, None if it doesn't. Of a coordinate that is NaN nothing is asked."""
        if not (self.active and self.present):
            return None
        north, east, down = point_N
        home, far, high = self._places.home_N, self._p["GF_MAX_HOR_DIST"], self._p["GF_MAX_VER_DIST"]
        if high > 0.0 and home[2] - down > high:
            return Violation(BreachKind.MAX_ALTITUDE, f"higher above home than GF_MAX_VER_DIST, {high:g} m")
        if math.isnan(north) or math.isnan(east):
            return None
        if far > 0.0 and math.hypot(north - home[0], east - home[1]) > far:
            return Violation(BreachKind.BOUNDARY, f"further from home than GF_MAX_HOR_DIST, {far:g} m")
        area = shut_out(self._fence.areas, north, east)
        return None if area is None else Violation(BreachKind.BOUNDARY, area.reason)

    def objection(self, point_N: Vec3, what: str) -> str:
        """The sentence that refuses a target, empty for one within the fence."""
        violation = self.violation(point_N)
        return f"{what} lies outside the fence: {violation.reason}" if violation else ""

    def watch(self, fix: Fix, flying: bool, braking_m_s2: float) -> Violation | None:
        """Look where the vehicle is, or with GF_PREDICT where it can halt; a breach that begins now is returned."""
        self._airborne_N = fix.position_N if flying else None
        if not self.breach.outside and not (flying and self.present and self.active):
            return None
        violation = self.violation(_halt_N(fix, braking_m_s2) if self._p["GF_PREDICT"] else fix.position_N)
        was, self.breach = self.breach, self.breach._replace(outside=violation is not None)
        if violation is None or was.outside:
            return None
        self.breach = Breach(True, was.times + 1, fix.now_us, violation.kind)
        return violation


def _halt_N(fix: Fix, braking_m_s2: float) -> Vec3:
    n = fix.nav
    ahead_s = _REACTION_S + 0.75 * fix.speed_m_s / braking_m_s2  # a stop along a cubic, see trajectory.stopping
    return (
        n.north_m + ahead_s * n.v_north_m_s,
        n.east_m + ahead_s * n.v_east_m_s,
        n.down_m + ahead_s * n.v_down_m_s,
    )
