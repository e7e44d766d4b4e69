"""Units, clock stamps and attitudes on the wire."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.frames import quaternion_from_321, quaternion_from_yxz, standing
from sitl.mavlink import attitude, wire
from sitl.navigation import NavState


def nav(q: tuple[float, float, float, float], rates: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> NavState:
    return NavState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *q, *rates)


@pytest.mark.parametrize("heading_deg", [-170, -90, 0, 45, 179])
def test_upright_hover_reads_roll_and_pitch_zero_and_the_bellys_heading(heading_deg: float) -> None:
    a = attitude.wire_attitude(nav(standing(math.radians(heading_deg), math.pi / 2)))
    assert (a.roll, a.pitch) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert a.yaw == pytest.approx(math.radians(heading_deg))


def test_the_wires_roll_is_the_papers_yaw_and_its_yaw_minus_the_papers_roll() -> None:
    """Small angles about hover; φ turns about the nose, which points up: against the heading."""
    a = attitude.wire_attitude(nav(quaternion_from_yxz(0.02, math.pi / 2 + 0.03, 0.01)))
    assert (a.roll, a.pitch, a.yaw) == pytest.approx((0.01, 0.03, -0.02), abs=1e-3)


def test_the_wires_rates_are_r_q_and_minus_p() -> None:
    a = attitude.wire_attitude(nav((1.0, 0.0, 0.0, 0.0), (0.1, 0.2, 0.3)))
    assert (a.rollspeed, a.pitchspeed, a.yawspeed) == (0.3, 0.2, -0.1)


def test_level_forward_flight_reads_pitched_down_by_ninety_degrees() -> None:
    a = attitude.wire_attitude(nav(quaternion_from_321(0.0, 0.0, 0.5)))
    assert a.pitch == pytest.approx(-math.pi / 2)


def test_the_accelerometer_of_a_hovering_vehicle_reads_gravity_on_minus_z() -> None:
    """In hover the body's x points up, so the specific force is +g along it."""
    assert attitude.body_vector_on_wire((9.8, 0.1, 0.2)) == (0.2, 0.1, -9.8)


@pytest.mark.parametrize(
    ("value", "expected"),
    [(0.0, 0), (1e9, 32766), (-1e9, -32767), (math.nan, -32767), (math.inf, 32766), (12.344, 1234)],
)
def test_speeds_saturate_short_of_the_unset_value(value: float, expected: int) -> None:
    assert wire.cm_s(value) == expected


@given(st.floats())
def test_no_number_leaves_the_range_of_its_field(value: float) -> None:
    assert -32767 <= wire.int16(value) <= 32766
    assert 0 <= wire.uint16(value) <= 65534
    assert abs(wire.degE7(value)) <= 1_800_000_000
    assert -(2**31) < wire.mm(value) < 2**31 - 1
    assert 0 <= wire.cdeg(value) < 36000 or wire.cdeg(value) == wire.UINT16_UNSET


def test_headings_wrap_into_one_turn() -> None:
    assert wire.cdeg(-math.pi / 2) == 27000
    assert wire.cdeg(math.radians(359.999)) == 0


@given(st.integers(-(2**31), 2**31 - 1).filter(lambda v: (v >> 23) & 0xFF != 0xFF))
def test_integers_travel_bytewise_in_a_float(value: int) -> None:
    assert wire.int_of_float(wire.float_of_int(value)) == value


@pytest.mark.parametrize("offset_ms", [-900, -1, 0, 1, 900])
@pytest.mark.parametrize("now_us", [5_000_000, 2**32 * 1000 + 300_000, 3 * 2**32 * 1000 - 1000])
def test_boot_stamps_are_unwrapped_to_the_time_nearest_now(offset_ms: int, now_us: int) -> None:
    wanted_ms = now_us // 1000 + offset_ms
    assert wire.boot_time_us(wanted_ms % 2**32, now_us) == wanted_ms * 1000
