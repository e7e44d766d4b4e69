"""The `gcs` command line: mistakes are one line with a status; help explains everything."""

import pytest

from gcs_tools.__main__ import MODES, main, parser
from gcs_tools.vehicle_state import MODES as VEHICLE_MODES


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["fly", "gone.yaml"], "gcs fly: gone.yaml: no such mission file"),
        (["param", "load", "gone.yaml"], "gcs param: gone.yaml: can't be read: No such file or directory"),
        (["hold", "--connect", "udpin:192.0.2.1:14999"], "gcs hold: can't listen on 192.0.2.1:14999: "),
    ],
)
def test_a_request_that_cannot_be_met_is_one_line_and_a_status(
    argv: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(argv) != 0
    out = capsys.readouterr()
    assert out.err.startswith(message)
    assert out.err.count("\n") == 1
    assert out.out == ""


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        ([], "required: COMMAND"),
        (["fly"], "required: MISSION"),
        (["hover"], "invalid choice: 'hover'"),
        (["mode", "sideways"], "invalid choice: 'sideways'"),
        (["param", "set", "A", "much"], "'much' is not a finite number"),
        (["param", "set", "A", "nan"], "'nan' is not a finite number"),
        (["takeoff", "--height", "-1"], "'-1' must be above 0"),
        (["arm", "--connect", "14550"], "'14550' is not udpin:HOST:PORT or udpout:HOST:PORT"),
        (["arm", "--system", "0"], "'0' is not a system id"),
    ],
)
def test_a_mistyped_command_is_one_line_and_status_two(
    argv: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(argv)
    assert stop.value.code == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "argv",
    [
        ["--help"],
        ["fly", "--help"],
        ["param", "--help"],
        *(["param", action, "--help"] for action in ("list", "get", "set", "save", "load")),
        *([name, "--help"] for name in ("arm", "disarm", "takeoff", "land", "hold", "return", "mode", "watch")),
    ],
    ids=" ".join,
)
def test_every_command_explains_itself(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(argv)
    assert stop.value.code == 0
    assert "usage: gcs" in capsys.readouterr().out


def test_the_default_connection_is_where_vehicles_send_to_ground_stations() -> None:
    assert parser().parse_args(["hold"]).connect == (True, "127.0.0.1", 14550)


def test_the_command_line_offers_every_mode() -> None:
    assert set(MODES) == set(VEHICLE_MODES)


def test_ctrl_c_is_quiet_while_the_tool_is_still_starting(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gcs_tools.__main__.parser", interrupted)
    assert main(["watch"]) == 130
    assert capsys.readouterr() == ("", "")
