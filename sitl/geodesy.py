"""Latitude and longitude to local north and east, and back.

Azimuthal equidistant projection on a sphere of 6371 km, the one that PX4 uses (geo.cpp, MapProjection), so that
clients that project for themselves land on the same spot.
"""

import math
from typing import NamedTuple

EARTH_RADIUS_M = 6_371_000.0


class GeoPoint(NamedTuple):
    """A place: degrees, and metres above mean sea level."""

    lat_deg: float
    lon_deg: float
    alt_amsl_m: float


def to_local(origin: GeoPoint, lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """North and east [m] of (lat, lon) as seen from the origin."""
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    lat0, lon0 = math.radians(origin.lat_deg), math.radians(origin.lon_deg)
    cos_c = math.sin(lat0) * math.sin(lat) + math.cos(lat0) * math.cos(lat) * math.cos(lon - lon0)
    c = math.acos(max(-1.0, min(1.0, cos_c)))
    # haversine where acos loses its digits (within some hundred metres)
    if c < 1e-4:
        s_lat, s_lon = math.sin((lat - lat0) / 2), math.sin((lon - lon0) / 2)
        c = 2 * math.asin(math.sqrt(s_lat * s_lat + math.cos(lat0) * math.cos(lat) * s_lon * s_lon))
    k = c / math.sin(c) if c > 1e-12 else 1.0
    # sin(lat) − based form of the north component without cancellation: sin(lat-lat0) + sin(lat0)cos(lat)(1-cos dlon)
    north = math.sin(lat - lat0) + math.sin(lat0) * math.cos(lat) * 2 * math.sin((lon - lon0) / 2) ** 2
    east = math.cos(lat) * math.sin(lon - lon0)
    return k * north * EARTH_RADIUS_M, k * east * EARTH_RADIUS_M


def to_global(origin: GeoPoint, north_m: float, east_m: float) -> tuple[float, float]:
    """Latitude and longitude [deg] of a point north and east [m] of the origin."""
    x, y = north_m / EARTH_RADIUS_M, east_m / EARTH_RADIUS_M
    c = math.hypot(x, y)
    if c < 1e-15:
        return origin.lat_deg, origin.lon_deg
    lat0, lon0 = math.radians(origin.lat_deg), math.radians(origin.lon_deg)
    sin_c, cos_c = math.sin(c), math.cos(c)
    lat = math.asin(cos_c * math.sin(lat0) + x * sin_c * math.cos(lat0) / c)
    lon = lon0 + math.atan2(y * sin_c, c * math.cos(lat0) * cos_c - x * math.sin(lat0) * sin_c)
    return math.degrees(lat), math.degrees((lon + math.pi) % (2 * math.pi) - math.pi)
