"""The drawn mission: point to point, each with its plumb line to the ground."""

from gcs_tools.view.mission_path import lines, path
from gcs_tools.view.topics import Item, Mission


def test_items_without_a_point_are_passed_over() -> None:
    items = [Item(0, "takeoff", (0.0, 0.0, -5.0)), Item(1, "delay", None), Item(2, "waypoint", (9.0, 0.0, -5.0))]
    assert path(Mission(0, 1, items)) == [(0.0, 0.0, -5.0), (9.0, 0.0, -5.0)]


def test_every_point_is_joined_to_the_next_and_to_the_ground() -> None:
    segments, colours = lines([(0.0, 0.0, -5.0), (9.0, 0.0, -5.0), (9.0, 3.0, -5.0)], 0.5)
    assert segments.shape == colours.shape == (5, 2, 3)
    assert segments[0].tolist() == [[0, 0, -5], [9, 0, -5]]
    assert segments[4].tolist() == [[9, 3, -5], [9, 3, 0.5]]


def test_a_single_point_has_its_plumb_line_alone() -> None:
    segments, _ = lines([(1.0, 2.0, -3.0)], 0.0)
    assert segments.tolist() == [[[1, 2, -3], [1, 2, 0]]]
