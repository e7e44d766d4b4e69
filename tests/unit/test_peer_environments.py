"""Other simulators' environments: used where they are whole and of the versions named, and never made unasked."""

from pathlib import Path

import pytest

from benchmarks import peer_environments
from benchmarks.peer_environments import ENVIRONMENTS, python_of


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = tmp_path / "yawsitter" / "peers" / "jsbsim"
    folder.mkdir(parents=True)
    return folder


def test_an_environment_is_used_once_it_is_whole_and_of_the_versions_named(folder: Path) -> None:
    assert python_of("jsbsim") is None
    (folder / "installed.txt").write_text("jsbsim==0.1\n")
    assert python_of("jsbsim") is None
    (folder / "installed.txt").write_text("\n".join(ENVIRONMENTS["jsbsim"].packages))
    assert python_of("jsbsim") is not None


def test_peers_that_are_not_there_are_told_with_the_command_that_installs_them(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from benchmarks import peers

    monkeypatch.setattr(peers, "FLIGHTS", (peers.CESSNA,))
    monkeypatch.setattr(peer_environments, "install", lambda name: pytest.fail(f"{name} was installed unasked"))
    [figure] = peers.measure(quick=True)
    assert figure.met is None
    assert "python -m benchmarks.peer_environments jsbsim (" in figure.measured
