"""The flights beyond the paper: that they are what they say, and tell what they find."""

import math

import numpy as np
import pytest

from sitl.reproduce import robustness, trials
from sitl.reproduce.cases import BEYOND, Craft
from sitl.reproduce.robustness import STILL
from sitl.reproduce.trials import TRIALS, measure

pytestmark = pytest.mark.compiled
PITCH = robustness.BODY_AXES[1]
PRINTED = Craft("yawsitter")
EXACT, FILTERED = (setup.craft for setup in BEYOND if setup.key != "printed")


def test_a_step_begins_at_nought_and_ends_at_one_and_the_trial_tells_its_overshoot_and_settling() -> None:
    t, done = robustness.step_response(PRINTED, 1, 1).T
    assert (t[0], done[0]) == (0.0, pytest.approx(0.0, abs=0.005))
    assert t[-1] == pytest.approx(robustness.STEP_LASTS_S - 0.002)
    assert done[-1] == pytest.approx(1.0, abs=0.02)
    overshoot, settled = robustness.step(1, PRINTED, 1)
    assert overshoot == pytest.approx(100.0 * (done.max() - 1.0))
    assert np.abs(done[t > settled] - 1.0).max() <= 0.02
    assert abs(done[np.searchsorted(t, settled)] - 1.0) > 0.02


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_step_moves_its_own_axis_and_z_goes_up(axis: int) -> None:
    v = robustness.hovering(EXACT, 1)
    trace = robustness._stepped(v, axis)
    moved = trace[-1, 1:4] - (0.0, 0.0, -5.0)
    expected = np.zeros(3)
    expected[axis] = (3.0, 3.0, -3.0)[axis]
    assert moved == pytest.approx(expected, abs=0.05)


def test_wind_that_blows_moves_the_vehicle_more_than_wind_that_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    (windy,) = robustness.windy_hover(EXACT, 1)
    monkeypatch.setattr(robustness, "WIND_N", STILL)
    monkeypatch.setattr(robustness, "GUST_M_S", 0.0)
    (calm,) = robustness.windy_hover(EXACT, 1)
    assert windy > 5.0 * calm


def test_a_model_error_costs_more_than_none_and_is_flown_by_both_missions() -> None:
    none = robustness.model_error((), PRINTED, 1)
    wet = robustness.model_error((("air_density_kg_m3", 1.0045),), PRINTED, 1)
    assert len(none) == len(wet) == 2
    assert all(w > n for w, n in zip(wet, none, strict=True))


def test_a_start_turned_by_nothing_goes_nowhere_far_and_one_on_its_head_goes_further() -> None:
    upright, _ = robustness.excursion(EXACT, PITCH, 0.0, STILL)
    upside_down, last = robustness.excursion(EXACT, PITCH, 170.0, STILL)
    assert upright < 0.5 < upside_down
    assert last < 0.3


def test_a_filter_recovers_by_another_way_from_seed_to_seed_and_a_known_state_by_one() -> None:
    filtered = {robustness.excursion(FILTERED, PITCH, 60.0, STILL, seed)[0] for seed in (1, 2)}
    assert len(filtered) == 2
    assert trials.erring(FILTERED)
    assert not trials.erring(EXACT)
    assert not trials.erring(PRINTED)


def test_a_heading_is_kicked_by_a_step_and_more_so_without_the_slipstreams_in_the_allocation() -> None:
    known = robustness.heading_kick(EXACT, (), ())
    unknown = robustness.heading_kick(EXACT, (), (("wake_arm_m", 0.0),))
    assert 0.0 < known < unknown < 20.0


def test_a_lost_flight_is_told_as_infinitely_bad(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robustness, "WIND_N", (20.0, 0.0, 0.0))
    assert robustness.windy_rectangle(PRINTED, 1) == (math.inf,)
    assert robustness.windy_hover(PRINTED, 1) == (math.inf,)


def test_every_trial_measures_what_it_announces() -> None:
    keys = [trial.key for trial in TRIALS]
    assert len(set(keys)) == len(keys)
    for key in ("turn", "step-z", "wind-hover"):
        trial = next(trial for trial in TRIALS if trial.key == key)
        assert len(measure(key, EXACT, 1)) == len(trial.measures)


def test_a_trials_command_prints_its_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    words = trials.command("step-y", EXACT, 1).split()
    assert words[:3] == ["python", "-m", "sitl.reproduce.trials"]
    assert trials.main(words[3:]) == 0
    overshoot, settled = measure("step-y", EXACT, 1)
    assert capsys.readouterr().out == (
        f"step-y, overshoot: {overshoot:.6g} %\nstep-y, within 2 % after: {settled:.6g} s\n"
    )


def test_a_trial_that_there_is_not_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        trials.main(["loop", "yawsitter", "1"])
    assert "invalid choice: 'loop'" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        trials.main(["turn", "paperplane", "1"])
    assert "unknown vehicle 'paperplane'" in capsys.readouterr().err
