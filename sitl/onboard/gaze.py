"""Where the vehicle faces while it flies elsewhere: a region of interest, an orbit's centre, or the way it flies."""

import math
from enum import Enum

from sitl.control.reference import Reference
from sitl.quaternion import Vec3

_LEAD_S = 0.2  # how far ahead the bearing is taken: as long as the heading lags behind it
_NEAR_M, _SLOW_M_S = 0.3, 0.2  # nearer or slower than this there is no bearing worth following


class Look(Enum):
    AHEAD = "as the trajectory says"
    POINT = "at a point"
    ALONG = "the way it flies"


class Gaze:
    """What to face until the mode changes."""

    def __init__(self) -> None:
        self.look = Look.AHEAD
        self._point_N: Vec3 = (0.0, 0.0, 0.0)

    def at(self, look: Look, point_N: Vec3 = (0.0, 0.0, 0.0)) -> None:
        self.look, self._point_N = look, point_N

    def forget(self) -> None:
        self.look = Look.AHEAD

    def bearing(self, r: Reference) -> float | None:
        """The heading to face from the reference [rad]; None: as the trajectory says."""
        if self.look is Look.POINT:
            north = self._point_N[0] - r.north_m - _LEAD_S * r.v_north_m_s
            east = self._point_N[1] - r.east_m - _LEAD_S * r.v_east_m_s
            return math.atan2(east, north) if math.hypot(north, east) > _NEAR_M else None
        if self.look is Look.ALONG:
            north, east = r.v_north_m_s + _LEAD_S * r.a_north_m_s2, r.v_east_m_s + _LEAD_S * r.a_east_m_s2
            return math.atan2(east, north) if math.hypot(north, east) > _SLOW_M_S else None
        return None
