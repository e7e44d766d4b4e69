"""Ground contact and tipping over as plain state."""

import pytest

from sitl.control.guidance import Effort
from sitl.control.reference import Reference
from sitl.frames import standing
from sitl.navigation import NavState
from sitl.onboard.ground import Contact, Intent, Tilt, contact, tilt
from sitl.onboard.guide import Fix
from sitl.onboard.modes import Landed

UPRIGHT, LYING = standing(0.3, 1.5708), standing(0.3, 0.1)
JUST_FLYING, TAKING_OFF, LANDING = Intent(False, False), Intent(True, False), Intent(False, True)
STANDING = Contact(Effort.IDLE, Landed.ON_GROUND)
FLYING = Contact(Effort.FLY, Landed.IN_AIR)


def nav(down_m: float = 0.0, v_down_m_s: float = 0.0, q=UPRIGHT) -> NavState:
    return NavState(0.0, 0.0, down_m, 0.0, 0.0, v_down_m_s, *q, 0.0, 0.0, 0.0)


def reference(down_m: float = 0.0, v_down_m_s: float = 0.0, a_down_m_s2: float = 0.0) -> Reference:
    return Reference(0.0, 0.0, down_m, 0.0, 0.0, v_down_m_s, 0.0, 0.0, a_down_m_s2, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("r", [reference(-0.05), reference(0.0, -0.01)])
def test_a_standing_vehicle_flies_once_the_reference_leaves_the_ground(r: Reference) -> None:
    assert contact(STANDING, Fix(0, nav(), 4), r, JUST_FLYING) == FLYING
    assert contact(STANDING, Fix(0, nav(), 4), r, TAKING_OFF).landed is Landed.TAKING_OFF
    assert contact(STANDING, Fix(0, nav(), 4), r, LANDING).effort is Effort.IDLE


def test_a_reference_that_has_come_down_and_still_brakes_leaves_the_vehicle_standing() -> None:
    assert contact(STANDING, Fix(0, nav(), 4), reference(0.01, 0.05, -0.2), JUST_FLYING).standing


@pytest.mark.parametrize("error_m", [-0.02, 0.02])
def test_an_error_of_the_height_estimate_lifts_nothing_off(error_m: float) -> None:
    assert contact(STANDING, Fix(0, nav(error_m), 4), reference(), JUST_FLYING).standing


def test_a_flying_vehicle_stands_when_the_reference_and_the_feet_are_down_and_it_is_calm() -> None:
    r = reference(0.1, 0.3)
    assert contact(FLYING, Fix(7, nav(), 2), r, LANDING) == Contact(Effort.IDLE, Landed.ON_GROUND, 7)
    assert not contact(FLYING, Fix(7, nav(v_down_m_s=0.5), 2), r, LANDING).standing
    assert not contact(FLYING, Fix(7, nav(), 2), reference(-0.3), LANDING).standing
    assert not contact(FLYING, Fix(7, nav(), 2), reference(0.1, -0.3), LANDING).standing


def test_a_reference_that_rests_on_the_ground_lets_down_a_vehicle_just_above_it() -> None:
    c = contact(FLYING, Fix(0, nav(-0.03), 0), reference(), JUST_FLYING)
    assert not c.standing
    assert not contact(c, Fix(300_000, nav(-0.03), 0), reference(), JUST_FLYING).standing
    assert contact(c, Fix(450_000, nav(-0.03), 0), reference(), JUST_FLYING).standing
    assert not contact(c, Fix(450_000, nav(-0.1), 0), reference(), JUST_FLYING).standing


def test_the_time_on_the_ground_counts_from_touch_down() -> None:
    c = contact(STANDING, Fix(1_000_000, nav(), 4), reference(), JUST_FLYING)
    c = contact(c, Fix(3_500_000, nav(), 4), reference(), JUST_FLYING)
    assert c.standing_s(3_500_000) == pytest.approx(2.5)


def test_a_vehicle_that_lies_still_has_tipped_over_after_a_moment() -> None:
    t = tilt(Tilt(), 0, nav(q=LYING), 1)
    assert not t.tipped_over
    assert not tilt(t, 200_000, nav(q=LYING), 1).tipped_over
    t = tilt(t, 350_000, nav(q=LYING), 1)
    assert t.tipped_over
    assert tilt(t, 400_000, nav(q=LYING), 1).tipped_over
    assert tilt(t, 400_000, nav(q=UPRIGHT), 1).tipped_over  # not yet on its feet
    assert not tilt(t, 400_000, nav(q=UPRIGHT), 4).tipped_over


@pytest.mark.parametrize("state", [nav(-3.0, q=LYING), nav(0.0, 1.0, q=LYING), nav()])
def test_in_the_air_in_motion_or_upright_nothing_has_tipped_over(state: NavState) -> None:
    t = Tilt()
    for now_us in range(0, 2_000_000, 20_000):
        t = tilt(t, now_us, state, 0)
    assert not t.tipped_over
