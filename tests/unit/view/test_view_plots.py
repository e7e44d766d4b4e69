"""The plots: what a chart shows of the rows, and that it does not magnify next to nothing."""

import numpy as np
import pytest

from gcs_tools.view.history import COLUMNS, INDEX
from gcs_tools.view.overlays import ERROR_FULL_M, error_colours, segments, thinned
from gcs_tools.view.plots import TABS


def rows(n: int, **columns: float) -> np.ndarray:
    table = np.zeros((n, len(COLUMNS)))
    table[:, 0] = 0.02 * np.arange(n)
    for name, value in columns.items():
        table[:, INDEX[name]] = value
    return table


def chart(tab: str, title: str):
    return next(chart for chart in TABS[tab] if chart.title.startswith(title))


def test_every_curve_reads_columns_that_there_are() -> None:
    for charts in TABS.values():
        for each in charts:
            assert len(each.drawn(rows(5))) == len(each.curves) + 1


def test_the_error_is_where_it_is_less_where_it_should_be_in_centimetres() -> None:
    north, east, down, _ = chart("Position", "error").drawn(rows(9, north_m=1.5, reference_north_m=1.48, down_m=-3.0))
    assert north == pytest.approx([2.0] * 9)
    assert east == pytest.approx([0.0] * 9)
    assert down == pytest.approx([-300.0] * 9)


def test_an_axis_is_never_narrower_than_what_is_worth_seeing() -> None:
    still = chart("Position", "down").drawn(rows(9, down_m=-5.0, reference_down_m=-5.0004))
    assert min(v.min() for v in still) == pytest.approx(-5.05, abs=2e-3)
    assert max(v.max() for v in still) == pytest.approx(-4.95, abs=2e-3)
    moving = chart("Position", "down").drawn(rows(9, down_m=-5.0, reference_down_m=-3.0))
    assert min(v.min() for v in moving) == -5.0  # the unseen curve is within


def test_thinning_keeps_the_newest_and_even_steps() -> None:
    table = rows(1000)
    kept = thinned(table, 300)
    assert len(kept) <= 300
    assert kept[-1, 0] == table[-1, 0]
    assert np.ptp(np.diff(kept[:, 0])) == pytest.approx(0.0, abs=1e-9)
    assert len(thinned(table[:7], 300)) == 7


def test_a_path_is_drawn_point_to_point_and_coloured_by_its_error() -> None:
    points = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, -1.0)])
    assert segments(points).tolist() == [[[0, 0, 0], [1, 0, 0]], [[1, 0, 0], [1, 1, -1]]]
    assert segments(points[:1]).shape == (1, 2, 3)
    good, bad, worse = error_colours(np.array([0.0, ERROR_FULL_M, 5.0]))
    assert good[1] > good[0]
    assert bad[0] > bad[1]
    assert bad.tolist() == worse.tolist()
