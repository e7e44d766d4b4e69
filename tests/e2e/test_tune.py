"""`gcs tune` over real UDP: a simulator in one process, the experiment in another."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from daemon_process import Daemon, free_instance
from interrupted import interrupted, program

from gcs_tools.__main__ import main
from gcs_tools.client import Client

pytestmark = pytest.mark.e2e


@pytest.fixture(scope="module")
def connect(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, ...]]:
    """A simulator of our own at five times real time, and how to reach it.

    Half a second without targets is 100 ms there, which a busy machine may take: it waits for a second of ours.
    """
    instance = free_instance(range(120, 130))
    settings = ("--vehicle", "yawsitter-real", "--speed", "5", "--set", "COM_OF_LOSS_T=5", "--set", "POS_X_P=1")
    with Daemon(tmp_path_factory.mktemp("tune"), *settings, instance=instance):
        yield ("--connect", f"udpout:127.0.0.1:{14580 + instance}", "--system", str(instance + 1))


def own_gains(connect: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> dict[str, float]:
    capsys.readouterr()
    assert main(["param", "list", "--json", *connect]) == 0
    listed = json.loads(capsys.readouterr().out)
    return {name: value for name, value in listed.items() if name.split("_")[0] in ("POS", "VEL", "ATT", "RATE")}


def test_a_doublet_is_drawn(hovering: tuple[str, ...], capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "doublet.png"
    assert main(["tune", "step", "velocity.y", "--doublet", "--hold", "1", "--plot", str(path), *hovering]) == 0
    told = capsys.readouterr()
    assert "rise time" in told.out
    assert "Hz of the vehicle's time: what the link carried" in told.out
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.fixture(scope="module")
def hovering(connect: tuple[str, ...]) -> tuple[str, ...]:
    """The same simulator's vehicle, up in the air."""
    assert main(["takeoff", "--height", "6", "--wait", *connect]) == 0
    return connect


@pytest.mark.parametrize(
    ("loop", "size", "hold_s"),
    [("position.x", 1, 3), ("velocity.z", 0.5, 1.5), ("attitude.phi", 10, 1), ("rate.q", 5, 1)],
)
def test_a_step_of_each_kind_is_flown_measured_and_leaves_the_gains(
    loop: str, size: float, hold_s: float, hovering: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    before = own_gains(hovering, capsys)
    options = ["--size", str(size), "--hold", str(hold_s), "--gains", "tuned", "--json"]
    status = main(["tune", "step", loop, *options, *hovering])
    told = capsys.readouterr()
    assert status == 0, told.err
    result = json.loads(told.out)
    (flown,) = result["sets"]
    assert flown["name"] == "tuned"
    assert flown["rate_Hz"] == pytest.approx(50.0)  # what a link at five times real time carries
    assert abs(flown["figures"]["steady_error"]) < 0.15 * result["excitation"]["size"]
    assert own_gains(hovering, capsys) == before == {**before, "POS_X_P": pytest.approx(1.0)}


def test_ctrl_c_puts_the_gains_back_and_leaves_the_vehicle_in_hold(
    hovering: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    before = own_gains(hovering, capsys)
    with program("gcs_tools", "tune", "step", "position.x", "--gains", "paper", "--hold", "20", *hovering) as tune:
        assert any("heard" in line for line in tune.stderr)
        _until(hovering, capsys, lambda: own_gains(hovering, capsys) != before)
        _, rest = interrupted(tune)
    assert "putting the vehicle's own gains back" in rest
    assert own_gains(hovering, capsys) == before
    assert main(["watch", "--for", "1.5", *hovering]) == 0
    assert "mode: hold, armed" in capsys.readouterr().out


def _until(connect: tuple[str, ...], capsys: pytest.CaptureFixture[str], condition: Callable[[], bool]) -> None:
    for _ in range(40):
        if condition():
            return
    raise AssertionError("it never came about")


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["step", "position.w", "--vehicle", "yawsitter"], 2, "'position.w' is not a loop"),
        (["step", "rate.p", "--vehicle", "yawsitter", "--gains", "nope"], 2, "unknown gain 'nope'"),
        (["step", "rate.p", "--vehicle", "glider"], 2, "unknown vehicle 'glider'"),
        (["step", "rate.p", "--gust", "1"], 2, "--gust goes with --vehicle"),
        (["step", "rate.p", "--plot", "figure.svg"], 2, "the figure is a .png"),
        (
            ["step", "rate.p", "--connect", "udpout:127.0.0.1:1", "--system", "9"],
            1,
            "no vehicle with system id 9 heard",
        ),
    ],
)
def test_what_cannot_be_done_is_told_in_one_line(
    arguments: list[str],
    status: int,
    message: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    connect = Client.connect
    monkeypatch.setattr(Client, "connect", lambda client, patience_s=0.5: connect(client, patience_s))
    try:
        ended: object = main(["tune", *arguments])
    except SystemExit as end:
        ended = end.code
    told = capsys.readouterr()
    assert ended == status
    assert message in told.err
    assert "Traceback" not in told.err


def test_a_plot_without_matplotlib_is_refused_before_anything_flies(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    assert main(["tune", "step", "rate.p", "--vehicle", "yawsitter", "--plot", "figure.png"]) == 2
    assert "pip install 'yawsitter-sitl[tune]'" in capsys.readouterr().err
