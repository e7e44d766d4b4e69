"""Taking off: straight up to a height that may have been asked for before arming."""

import math

from sitl.onboard.geofence import Geofence
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.mission_items import LEAST_HEIGHT_M
from sitl.onboard.modes import ACCEPTED, Outcome, Verdict
from sitl.onboard.parameters import Parameters
from sitl.onboard.places import Places

LEAST_CLIMB_M = 0.5  # from the ground, wherever home is
_MOST_M = 1000.0


class Takeoff:
    """What was asked for last, and the climb to it."""

    def __init__(self, parameters: Parameters, guide: Guide, places: Places, geofence: Geofence) -> None:
        self._p, self._guide, self._places, self._geofence = parameters, guide, places, geofence
        self.forget()

    def forget(self) -> None:
        self._altitude_amsl_m: float | None = None
        self._heading_rad: float | None = None

    def ask(self, altitude_amsl_m: float | None, heading_rad: float | None) -> Outcome:
        """None or what is not finite: MIS_TAKEOFF_ALT above home; the heading in force."""
        altitude = altitude_amsl_m if altitude_amsl_m is not None and math.isfinite(altitude_amsl_m) else None
        ground = self._places.origin.alt_amsl_m
        low, high = ground + LEAST_HEIGHT_M, ground + _MOST_M
        if altitude is not None and not low <= altitude <= high:
            return Outcome(Verdict.DENIED, f"take-off altitude {altitude:.1f} m AMSL is outside {low:.1f} … {high:.1f}")
        objection = self._geofence.objection((math.nan, math.nan, self._down(altitude)), "take-off")
        if objection:
            return Outcome(Verdict.DENIED, objection)
        self._altitude_amsl_m = altitude
        self._heading_rad = heading_rad if heading_rad is not None and math.isfinite(heading_rad) else None
        return ACCEPTED

    def _down(self, altitude_amsl_m: float | None) -> float:
        if altitude_amsl_m is None:
            altitude_amsl_m = self._places.home.alt_amsl_m + self._p["MIS_TAKEOFF_ALT"]
        return self._places.origin.alt_amsl_m - altitude_amsl_m

    def start(self, fix: Fix) -> None:
        down = self._down(self._altitude_amsl_m)
        if self._guide.standing:
            down = min(down, fix.nav.down_m - LEAST_CLIMB_M)
        self._guide.rise(fix, down, self._heading_rad)
