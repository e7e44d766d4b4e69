import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.geodesy import EARTH_RADIUS_M, GeoPoint, to_global, to_local


@given(st.floats(-85, 85), st.floats(-180, 180), st.floats(-5000, 5000), st.floats(-5000, 5000))
def test_local_and_global_are_inverse_to_a_micrometre(lat: float, lon: float, north: float, east: float) -> None:
    origin = GeoPoint(lat, lon, 0.0)
    assert to_local(origin, *to_global(origin, north, east)) == pytest.approx((north, east), abs=1e-6)


def test_a_degree_of_latitude_is_a_360th_of_the_circumference() -> None:
    north, east = to_local(GeoPoint(10.0, 20.0, 0.0), 11.0, 20.0)
    assert north == pytest.approx(EARTH_RADIUS_M * 3.141592653589793 / 180)
    assert east == pytest.approx(0.0, abs=1e-6)
