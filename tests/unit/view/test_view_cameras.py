"""Cameras: where they stand to the vehicle, and that a hand on them is neither ignored nor imagined."""

import math

import numpy as np
import pytest

from gcs_tools.view.cameras import AHEAD, LET_GO_S, OFFSETS_H_M, SETTLE_S, Rig, View, turned
from sitl.frames import standing

HOVER = standing(0.0, math.pi / 2)
HERE = np.array([3.0, 4.0, -5.0])


def at(rig: Rig, wall_s: float, position=HERE, q=HOVER, heading_rad: float = 0.0) -> View:
    """The view of a browser that keeps up."""
    rig._ahead = 0
    view = rig.view(position, q, heading_rad, wall_s)
    assert view is not None
    return view


def test_the_chase_camera_stands_behind_the_back_whatever_the_heading() -> None:
    for heading in (0.0, math.pi / 2, -2.0):
        view = at(Rig(), 0.0, heading_rad=heading)
        ahead = (math.cos(heading), math.sin(heading), 0.0)
        assert np.dot(view.position - HERE, ahead) == pytest.approx(OFFSETS_H_M["chase"][0])
        assert view.position[2] < HERE[2]  # above
        assert view.look_at == pytest.approx(HERE)


def test_the_camera_from_above_keeps_north_up() -> None:
    rig = Rig()
    rig.choose("top")
    view = at(rig, 0.0, heading_rad=1.0)
    assert view.position == pytest.approx(HERE + OFFSETS_H_M["top"])
    assert view.up == (1.0, 0.0, 0.0)


def test_on_board_the_horizon_leans_with_the_vehicle() -> None:
    rig = Rig()
    rig.choose("onboard")
    view = at(rig, 0.0)
    assert view.look_at - view.position == pytest.approx((1.0, 0.0, 0.0))  # the belly faces north
    assert view.up == pytest.approx((0.0, 0.0, -1.0))
    east = at(rig, 0.0, q=standing(math.pi / 2, math.pi / 2))
    assert east.look_at - east.position == pytest.approx((0.0, 1.0, 0.0))


def test_a_turning_vehicle_takes_the_chase_camera_with_it_smoothly() -> None:
    rig = Rig()
    first = at(rig, 0.0)
    soon = at(rig, 0.033, heading_rad=math.pi)
    assert np.linalg.norm(soon.position - first.position) < 0.3
    for k in range(2, 300):
        late = at(rig, 0.033 * k, heading_rad=math.pi)
    assert late.position - HERE == pytest.approx(turned(OFFSETS_H_M["chase"], math.pi), abs=0.01)


def test_reports_of_what_a_camera_was_told_change_nothing_however_late_and_fast_it_flies() -> None:
    rig, told = Rig(), []
    for k in range(60):
        view = at(rig, 0.033 * k, position=HERE + np.array([0.3 * k, 0.0, 0.0]), heading_rad=0.05 * k)
        told.append(view)
        if k >= 10:
            rig.reported(told[k - 10].position, told[k - 10].look_at, 0.033 * k)
    assert len(told) == 60  # `at` asserts that it was never left alone


def test_what_a_hand_made_of_the_camera_is_kept_and_goes_with_the_vehicle() -> None:
    rig = Rig()
    at(rig, -SETTLE_S)
    at(rig, 0.0)
    rig.reported(HERE + np.array([0.0, 3.0, -1.0]), HERE, 0.1)
    assert rig.view(HERE, HOVER, 0.0, 0.1 + 0.5 * LET_GO_S) is None  # left alone while the hand is on it
    there = HERE + np.array([10.0, 0.0, 0.0])
    view = at(rig, 0.2 + LET_GO_S, position=there)
    assert view.position - there == pytest.approx((0.0, 3.0, -1.0))


def test_choosing_a_camera_puts_it_where_it_belongs_and_a_free_one_is_left_alone() -> None:
    rig = Rig()
    at(rig, -SETTLE_S)
    rig.reported(HERE + np.array([0.0, 3.0, -1.0]), HERE, 0.1)
    rig.choose("free")
    assert rig.view(HERE, HOVER, 0.0, 9.0) is None
    rig.choose("chase")
    assert at(rig, 10.0).position - HERE == pytest.approx(OFFSETS_H_M["chase"])


def test_a_late_report_of_the_camera_before_does_not_spoil_the_one_just_chosen() -> None:
    rig = Rig()
    before = at(rig, 0.0)
    rig.choose("top")
    at(rig, 5.0)
    rig.reported(before.position, before.look_at, 5.3)
    assert at(rig, 5.4).position == pytest.approx(HERE + OFFSETS_H_M["top"])


def test_a_browser_that_draws_slowly_is_not_told_more_until_it_has_drawn() -> None:
    rig = Rig()
    moved = [HERE + np.array([0.1 * k, 0.0, 0.0]) for k in range(30)]
    views = [rig.view(position, HOVER, 0.0, 0.033 * k) for k, position in enumerate(moved[:8])]
    assert [view is not None for view in views] == [True] * AHEAD + [False] * (8 - AHEAD)
    rig.reported(views[0].position, views[0].look_at, 0.3)
    assert rig.view(moved[9], HOVER, 0.0, 0.3) is not None
    assert rig.view(HERE, HOVER, 0.0, 99.0) is not None  # nor is one waited for that says nothing


def test_a_vehicle_that_stands_still_is_followed_at_once_when_it_moves() -> None:
    rig = Rig()
    for k in range(100):
        assert rig.view(HERE, HOVER, 0.0, 0.033 * k) is not None
