"""Cells, tables and the page that they come to."""

import argparse
import importlib.util
from pathlib import Path

import pytest

from sitl.page import Cell, Group, Row, Table
from sitl.reproduce import main, notes, output, page, tables
from sitl.reproduce.cases import ABLATIONS, MISSIONS, SETUPS, Case, evaluation
from sitl.reproduce.printed import KEY_ERRORS, OVERALL


def test_a_cell_is_compared_by_size_and_equal_within_the_prints_rounding_counts_as_met() -> None:
    assert tables.number(-0.0129, 4, 0.0129).better is True
    assert tables.number(0.01294, 4, -0.0129).better is True
    assert tables.number(0.01296, 4, -0.0129).better is False
    assert tables.number(0.5).better is None


def test_numbers_are_told_with_a_true_minus_and_zero_has_no_sign() -> None:
    assert [tables.told(v, 1, True) for v in (-1.25, 1.26, -0.04, 0.0)] == ["−1.2", "+1.3", "0.0", "0.0"]
    assert tables.millimetres(-0.0863, signed=True).text == "−86.3"
    assert tables.millimetres(2.2225).text == "2222"  # thousands need no decimals
    assert tables.millimetres(0.0863).value == 0.0863


def test_the_score_counts_each_column_groups_compared_cells() -> None:
    rows = [Row("a", [Cell("1"), Cell("2", 2.0, True)]), Row("b", [Cell("1"), Cell("2", 2.0, False)])]
    table = Table("key", "title", [Group("paper", ("x",)), Group("flown", ("x",))], rows)
    assert tables.score(table) == [("flown", 1, 2)]


def test_the_long_form_names_part_group_and_column_of_every_cell() -> None:
    groups = [Group("one", ("x", "y")), Group("two", ("z",))]
    rows = [Row("a", [Cell("both", span=2), Cell("3", 3.0, True)], "part"), Row("b", [Cell("1"), Cell("2"), Cell("3")])]
    lines = tables.as_rows([Table("key", "title", groups, rows)])
    assert [line[:4] for line in lines] == [
        ["key", "part: a", "one", "x"],
        ["key", "part: a", "two", "z"],
        ["key", "part: b", "one", "x"],
        ["key", "part: b", "one", "y"],
        ["key", "part: b", "two", "z"],
    ]
    assert lines[1][4:] == ["3", 3.0, "true"]


def test_the_page_shows_marks_spans_and_parts_and_escapes_what_it_is_given() -> None:
    row = Row("a < b", [Cell("1.0", 1.0, True), Cell("lost", None, False, 2)], "part")
    table = Table("ranges", "Ranges & more", [Group("", ("x", "y", "z"))], [row])
    html = page.page([table], [], {"ranges": ["why & how"]}, ["sitl fly <x>"], ["first"])
    assert '<td class="first good">1.0</td><td class="bad" colspan="2">lost</td>' in html
    assert '<tr class="part"><th colspan="4">part</th></tr>' in html
    for text in ("a &lt; b", "Ranges &amp; more", "why &amp; how", "sitl fly &lt;x&gt;"):
        assert text in html


def test_a_table_that_no_section_shows_is_not_lost_silently() -> None:
    with pytest.raises(AssertionError, match="in no section: stray"):
        page.page([Table("stray", "", [], [])], [], {}, [], [])


def test_print_has_the_tables_instants_and_its_mean_times_its_duration_is_its_integral() -> None:
    assert [t for t, _ in KEY_ERRORS["rectangle"]] == [20.0, 30.0, 40.0, 50.0, 60.0, 65.0]
    assert [t for t, _ in KEY_ERRORS["circle"]] == [5.0, 15.0, 25.0, 35.0, 45.0, 55.0]
    for mission, duration_s in (("rectangle", 70.0), ("circle", 55.0)):
        for mae, iae in zip(OVERALL[mission]["mae"], OVERALL[mission]["iae"], strict=True):
            assert mae * duration_s == pytest.approx(iae, rel=0.01)


def test_every_setup_and_ablation_is_flown_on_both_missions_and_quick_flies_fewer() -> None:
    names = {case.name for case in evaluation(quick=False)}
    assert {f"{s.key}-{m}-1" for s in SETUPS for m in MISSIONS} <= names
    assert {f"{a.key}@yawsitter-real-{m}-1" for a in ABLATIONS for m in MISSIONS} <= names
    assert len(evaluation(quick=True)) < len(evaluation(quick=False))


def test_a_flights_command_says_everything_that_was_changed() -> None:
    case = Case("x", "circle", "yawsitter", 3, (("FF_ACCEL", 0.0),), (("side_force_factor", 0.3),), (("mass_kg", 1.1),))
    assert case.command == (
        "sitl fly missions/circle.yaml --vehicle yawsitter --seed 3 --set FF_ACCEL=0 "
        "--plant side_force_factor=0.3 --believed mass_kg=1.1"
    )


def test_the_least_lean_of_a_leg_is_that_of_full_push_and_full_brake() -> None:
    assert notes._bound_deg(10.0, 10.0) == pytest.approx(2.335, abs=1e-3)


def test_what_is_not_finite_becomes_null_in_the_numbers() -> None:
    assert output._finite({"a": [1.0, float("inf")], "b": float("nan")}) == {"a": [1.0, None], "b": None}


def test_without_matplotlib_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main.main(argparse.Namespace(out=tmp_path / "out", quick=True, json=False)) == 2
    assert capsys.readouterr().err == (
        "sitl reproduce: the report needs matplotlib: pip install 'yawsitter-sitl[report]'\n"
    )
    assert not (tmp_path / "out").exists()
