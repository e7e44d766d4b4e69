"""Home and the start point, and where mission items are in world N."""

import math

from sitl.geodesy import GeoPoint, to_global, to_local
from sitl.onboard.modes import ACCEPTED, Outcome, Verdict
from sitl.onboard.plan import Frame, MissionItem
from sitl.quaternion import Vec3

_FAR_M = 1e5


class Places:
    """`origin` of world N stays where the vehicle stood at start; `home` may move."""

    def __init__(self, origin: GeoPoint) -> None:
        self.origin = origin
        self.home = origin
        self.home_N: Vec3 = (0.0, 0.0, 0.0)

    def of(self, item: MissionItem, here: Vec3) -> Vec3:
        """The item's point in N [m]. Latitude and longitude both 0 mean here, as ground stations send take-off."""
        if item.frame == Frame.LOCAL_NED:
            return item.x * 1e-4, item.y * 1e-4, item.z
        if item.x == 0 and item.y == 0:
            north, east = here[0], here[1]
        else:
            north, east = to_local(self.origin, item.x * 1e-7, item.y * 1e-7)
        base = self.home.alt_amsl_m if item.frame in (Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT) else 0.0
        return north, east, self.origin.alt_amsl_m - (item.z + base)

    def global_of(self, point_N: Vec3) -> GeoPoint:
        lat, lon = to_global(self.origin, point_N[0], point_N[1])
        return GeoPoint(lat, lon, self.origin.alt_amsl_m - point_N[2])

    def move_home(self, point: GeoPoint) -> Outcome:
        if not (abs(point.lat_deg) <= 90.0 and abs(point.lon_deg) <= 180.0 and abs(point.alt_amsl_m) < _FAR_M):
            return Outcome(Verdict.DENIED, "home is not a place on Earth")
        north, east = to_local(self.origin, point.lat_deg, point.lon_deg)
        if math.hypot(north, east) > _FAR_M:
            return Outcome(Verdict.DENIED, "home is further than 100 km from the start point")
        self.home = point
        self.home_N = (north, east, self.origin.alt_amsl_m - point.alt_amsl_m)
        return ACCEPTED
