"""The drawn fence: borders on the ground and above it, by kind."""

import math

import numpy as np
import pytest

from gcs_tools.view.fence_lines import HEIGHT_M, INSIDE_RGB, OUTSIDE_RGB, corners, lines
from gcs_tools.view.topics import Area

TRIANGLE = Area(True, [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)], None)
MAST = Area(False, [(10.0, -2.0)], 2.5)


def test_a_polygon_is_closed_twice_and_has_a_post_at_each_corner() -> None:
    segments, colours = lines([TRIANGLE], 0.4)
    assert segments.shape == colours.shape == (9, 2, 3)
    levels = sorted({tuple(np.round(s[:, 2], 3)) for s in segments})
    low, high = np.float32(0.4), np.float32(0.4 - HEIGHT_M)
    assert levels == sorted([(low, low), (high, high), (low, high)])
    length = sum(math.dist(*s) for s in segments.tolist())
    assert length == pytest.approx(2 * (4.0 + 3.0 + 5.0) + 3 * HEIGHT_M)


def test_a_circle_is_drawn_around_its_centre() -> None:
    assert {round(math.dist(corner, (10.0, -2.0)), 9) for corner in corners(MAST)} == {2.5}


def test_what_is_to_be_stayed_out_of_has_another_colour() -> None:
    _, colours = lines([TRIANGLE, MAST], 0.0)
    assert colours[0, 0].tolist() == list(INSIDE_RGB)
    assert colours[-1, 0].tolist() == list(OUTSIDE_RGB)
