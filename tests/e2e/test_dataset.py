"""A data set as a learner finds it: episodes in their splits, columns that say what they are, and a card."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from short_mission import HOP

from sitl import __main__ as command_line
from sitl.campaign.run import split
from sitl.campaign.store import table

pytestmark = pytest.mark.compiled

SPLITS = {"train": 8, "validation": 1, "test": 1}


def sitl(*words: object) -> int:
    return command_line.main([str(word) for word in words])


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    (folder / "hop.yaml").write_text(HOP)
    words = ("--episodes", 10, "--mission", folder / "hop.yaml", "--rate", 25, "--mcap", "--workers", 1)
    assert sitl("dataset", *words, "--out", folder / "made") == 0
    return folder / "made"


def test_every_episode_is_in_one_split_and_its_samples_lie_there(dataset: Path) -> None:
    episodes = table(dataset)
    of = dict(zip(episodes["index"].to_pylist(), episodes["split"].to_pylist(), strict=True))
    assert Counter(of.values()) == SPLITS
    for word in SPLITS:
        samples = pq.read_table(dataset / "traces" / word)
        assert set(samples["index"].to_pylist()) == {index for index, w in of.items() if w == word}
        counts = Counter(samples["index"].to_pylist())
        assert set(counts.values()) == {150}


def test_samples_fit_together(dataset: Path) -> None:
    one = pq.read_table(dataset / "traces" / "train")
    one = one.filter(pc.equal(one["index"], one["index"][0]))
    t, down, sink = (one[name].to_numpy() for name in ("t_s", "true_position_down_m", "true_velocity_down_m_s"))
    np.testing.assert_allclose(np.diff(t), 0.04, atol=1e-9)
    moved = 0.5 * (sink[1:] + sink[:-1]) * 0.04
    np.testing.assert_allclose(np.diff(down)[:110], moved[:110], atol=1e-3)  # until it comes near the ground
    assert np.linalg.norm([one[f"true_q_NB_{a}"].to_numpy() for a in "wxyz"], axis=0) == pytest.approx(1.0, abs=1e-6)
    aloft = one["reference_position_down_m"].to_numpy() < -0.9
    thrust = one["action_thrust_left_N"].to_numpy() + one["action_thrust_right_N"].to_numpy()
    assert thrust[aloft].mean() == pytest.approx(10.7, abs=1.0)
    assert np.ptp(one["wind_north_m_s"].to_numpy()) > 0.0
    assert np.abs(one["nav_position_down_m"].to_numpy() - down).max() < 0.3


def test_the_card_says_how_many_what_and_how_to_make_them_again(dataset: Path) -> None:
    card = (dataset / "DATACARD.md").read_text()
    assert "10 episodes, 1500 samples at 25 Hz" in card
    assert f"sitl dataset --episodes=10 --mission={dataset.parent / 'hop.yaml'} --rate=25.0 --mcap" in card
    for folder in ("traces", "flights"):
        schema = pq.read_schema(next((dataset / folder).rglob("*.parquet")))
        for field in schema:
            assert f"| `{field.name}` | " in card
            assert f"| {field.metadata[b'unit'].decode()} |" in card
    assert json.loads((dataset / "campaign.json").read_text())["simulator"] in card


def test_an_mcap_holds_the_samples_of_its_episode(dataset: Path) -> None:
    (path,) = (dataset / "mcap" / "test").glob("*.mcap")
    index = int(path.stem.partition("-")[2])
    samples = pq.read_table(dataset / "traces" / "test").to_pylist()
    with path.open("rb") as file:
        reader = make_reader(file)
        told = [json.loads(message.data) for _, _, message in reader.iter_messages()]
        (about,) = reader.iter_metadata()
    assert about.metadata["index"] == str(index)
    assert len(told) == len(samples) == 150
    for mine, sample in zip(told, samples, strict=True):
        assert mine == pytest.approx({k: v for k, v in sample.items() if k != "index"}, abs=1e-6)


def test_more_episodes_leave_those_that_are_there_in_their_split() -> None:
    words = [split(k, (6, 3, 1)) for k in range(1000)]
    assert all(Counter(words[k : k + 10]) == {"train": 6, "validation": 3, "test": 1} for k in range(0, 1000, 10))
    assert len({tuple(words[k : k + 10]) for k in range(0, 1000, 10)}) > 50


def test_what_a_file_says_is_not_said_by_options(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "file.yaml").write_text("name: x\nmission: {random: {}}\n")
    assert sitl("dataset", tmp_path / "file.yaml", "--episodes", 3) == 2
    assert "--episodes: say it in" in capsys.readouterr().err


def test_a_rate_that_does_not_divide_the_control_rate_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert sitl("dataset", "--episodes", 3, "--rate", 30) == 2
    assert "trace_rate_hz: 30 is no divisor of yawsitter-real's 500 control steps" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "missing", "install"),
    [
        (("campaign", "any.yaml"), "pyarrow", "needs pyarrow: pip install 'yawsitter-sitl[campaign]'"),
        (("dataset", "--mcap"), "mcap", "needs mcap: pip install 'yawsitter-sitl[record]'"),
        (
            ("dataset", "--cluster", "tcp://x:1"),
            "distributed",
            "needs distributed: pip install 'yawsitter-sitl[cluster]'",
        ),
    ],
)
def test_what_is_not_installed_is_named_with_the_command_that_installs_it(
    words: tuple[str, ...],
    missing: str,
    install: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == missing else name)
    assert sitl(*words) == 2
    assert install in capsys.readouterr().err
