"""The search for gains: its scale, its cost, and that it gets better in the same way with any number of workers."""

import importlib.util
import json
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from interrupted import interrupted, program

from gcs_tools.__main__ import main
from gcs_tools.tune import cost, gain_sets, loops, search
from gcs_tools.tune.cost import FAILED, Air, Cost, Task, failed, judged
from gcs_tools.tune.search import LEAST_SHARE, Space
from sitl.vehicle_spec import gains_named, load_vehicle

CALM = Air(1, (0.0, 0.0, 0.0), 0.0)
BAD = {"RATE_Y_P": 0.03}  # sluggish: the tuned gain is 0.386


@given(st.lists(st.floats(0.0, 100.0), min_size=3, max_size=3))
def test_gains_come_back_from_the_logarithmic_scale_within_their_bounds(values: list[float]) -> None:
    names, highest = ("POS_X_P", "POS_X_I", "RATE_X_P"), (100.0, 100.0, 10.0)
    space = Space(names, highest)
    back = space.gains(space.point(dict(zip(names, values, strict=True))))
    for name, top, value in zip(names, highest, values, strict=True):
        assert 0.0 <= back[name] <= top
        if LEAST_SHARE * top * 1.01 < value < top:
            assert back[name] == pytest.approx(value, rel=1e-4)
    assert space.gains(space.bounds[:, 0]) == dict.fromkeys(names, 0.0)
    assert space.gains(space.bounds[:, 1]) == dict(zip(names, highest, strict=True))


def test_a_failed_flight_costs_more_than_any_that_succeeds_and_less_the_further_it_got() -> None:
    dear = Cost(1e9, 1e9, 1e9)
    assert dear.total < FAILED <= failed("fell", 1.0).total < failed("fell", 0.3).total <= 2.0 * FAILED
    assert judged([[Cost(1, 0, 0), Cost(3, 0, 0)], [Cost(0, 1, 0), Cost(0, 0, 2)]]) == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("manoeuvre", "gains"),
    [
        (cost.TOUR, {"RATE_X_P": 0.0, "RATE_Y_P": 0.0, "RATE_Z_P": 0.0}),
        (cost.TOUR, dict.fromkeys(loops.GAIN_NAMES, 10.0)),
        ("position.x", {"POS_X_P": 30.0, "VEL_X_P": 30.0}),
        ("rate.q", {"POS_X_P": 100.0, "VEL_X_P": 100.0}),
    ],
)
def test_gains_that_cannot_fly_cost_as_failures_and_raise_nothing(manoeuvre: str, gains: dict[str, float]) -> None:
    told = cost.fly(Task("yawsitter-real", (), (manoeuvre,), (CALM,)), manoeuvre, CALM, gains)
    assert told.fault
    assert FAILED <= told.total <= 2.0 * FAILED


def test_better_gains_cost_less() -> None:
    task = Task("yawsitter-real", (), (cost.TOUR, "rate.q"), (CALM,))
    for manoeuvre in task.manoeuvres:
        good, bad = (cost.fly(task, manoeuvre, CALM, gains) for gains in ({}, BAD))
        assert 0.1 < good.total < bad.total


def auto(path: Path, workers: int, capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, object], str]:
    start = path.parent / "start.yaml"
    start.write_text("RATE_Y_P: 0.03\n")
    options = ["--from", str(start), "--budget", "13", "--seeds", "1", "--gust", "0", "--out", str(path), "--json"]
    options += ["--vehicle", "yawsitter-real", "--workers", str(workers), "--seed", "3"]
    assert main(["tune", "auto", "rate.q", *options]) == 0
    return json.loads(capsys.readouterr().out), path.read_text()


def test_a_bad_gain_gets_better_and_to_the_same_with_one_worker_as_with_two(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, written = auto(tmp_path / "one.yaml", 1, capsys)
    two, again = auto(tmp_path / "two.yaml", 2, capsys)
    assert one == two
    assert written == again
    assert one["best"]["cost"] < 0.8 * one["start"]["cost"]  # type: ignore[index]
    found = gains_named(str(tmp_path / "one.yaml"))
    assert found["RATE_Y_P"] > 1.3 * 0.03
    assert {name: value for name, value in found.items() if name != "RATE_Y_P"} == pytest.approx(
        {name: value for name, value in load_vehicle("yawsitter-real").gains.items() if name != "RATE_Y_P"}, rel=1e-4
    )


def test_terms_that_are_named_are_sought_from_zero_too_and_a_rates_derivative_only_where_it_acts() -> None:
    from gcs_tools.tune.auto import _space
    from sitl.vehicle import Vehicle

    vehicle = Vehicle(load_vehicle("yawsitter-real"))
    start = dict(vehicle.spec.gains)
    assert _space(vehicle, start, ["rate.q"], None).names == ("RATE_Y_P",)
    assert _space(vehicle, start, ["rate.q", "attitude.phi"], "PID").names == (
        "RATE_Y_P", "RATE_Y_I", "ATT_X_P", "ATT_X_I", "ATT_X_D",
    )  # fmt: skip
    filtered = Vehicle(load_vehicle("yawsitter-real"), overrides={"CTL_RATE_D_TAU": 0.02})
    assert "RATE_Y_D" in _space(filtered, start, ["rate.q"], "PID").names


def test_the_search_goes_on_from_generation_to_generation_with_the_best_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a cost in closed form: the distance from a gain of 2, in logarithms."""
    monkeypatch.setattr(
        cost, "fly", lambda _task, _m, _air, gains: Cost(abs(math.log(max(gains["POS_X_P"], 1e-9) / 2.0)), 0.0, 0.0)
    )
    task = Task("yawsitter", (), (cost.TOUR,), (CALM,))
    space = Space(("POS_X_P",), (100.0,))
    with ThreadPoolExecutor(1) as pool:
        standings = list(search.search(task, {"POS_X_P": 40.0}, space, budget=120, seed=1, pool=pool))
    best = [standing.best.total for standing in standings]
    assert best == sorted(best, reverse=True)
    assert standings[-1].best.gains["POS_X_P"] == pytest.approx(2.0, rel=0.05)


def test_ctrl_c_keeps_the_best_so_far(tmp_path: Path) -> None:
    path = tmp_path / "found.yaml"
    (tmp_path / "start.param").write_text("RATE_Y_P 0.03\n")
    options = ["--from", str(tmp_path / "start.param"), "--seeds", "1", "--workers", "1", "--out", str(path)]
    command = ["tune", "auto", "rate.q", "--vehicle", "yawsitter-real", *options, "--budget", "100000"]
    with program("gcs_tools", *command) as tune:
        for line in tune.stderr:
            if path.exists():
                break
            assert "judged" in line, line
        told, _ = interrupted(tune)
    assert f"written to {path}" in told
    assert gain_sets.load(str(path)).gains is not None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["all", "--course", "nowhere.yaml"], "nowhere.yaml: no such mission file"),
        (["rate.w"], "'rate.w' is not a loop"),
        (["rate.p", "--terms", "PX"], "'PX' is not some of the letters P, I, D"),
        (["rate.p", "--terms", "D", "--vehicle", "yawsitter-real"], "there is no gain to seek"),
        (["rate.p", "--from", "nope"], "unknown gain 'nope'"),
        (["rate.p", "--out", "nowhere/found.yaml"], "there is no folder nowhere"),
    ],
)
def test_a_search_that_cannot_begin_says_why_in_one_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        ended: object = main(["tune", "auto", *arguments])
    except SystemExit as end:
        ended = end.code
    assert ended == 2
    assert message in capsys.readouterr().err


def test_a_search_without_its_library_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    assert main(["tune", "auto", "rate.p"]) == 2
    assert "the search needs cmaes: pip install 'yawsitter-sitl[tune]'" in capsys.readouterr().err
