"""`gcs view`: what can't be done is one line that says what, where and what would do."""

import importlib.util
import socket

import pytest

from gcs_tools.__main__ import main
from gcs_tools.view.feed import endpoint_of

pytest.importorskip("viser")


def refusal(argv: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["view", *argv]) == 2
    out = capsys.readouterr()
    assert out.out == ""
    assert out.err.count("\n") == 1
    return out.err


def test_what_is_no_endpoint_is_refused_with_one_that_is(capsys) -> None:
    text = refusal(["--connect", "nonsense"], capsys)
    assert text.startswith("gcs view: --connect: not a Zenoh endpoint: nonsense")
    assert "tcp/127.0.0.1:7447" in text


def test_a_port_that_is_taken_is_named_and_a_way_out(capsys) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        text = refusal(["--port", str(port), "--connect", endpoint_of(109)], capsys)
    assert text == f"gcs view: 127.0.0.1:{port} is taken; choose another with --port\n"


def test_an_address_that_is_not_this_machine_s_is_refused(capsys) -> None:
    text = refusal(["--host", "192.0.2.1", "--connect", endpoint_of(109)], capsys)
    assert text.startswith("gcs view: 192.0.2.1:8080 can't be used: ")


@pytest.mark.parametrize(("argv", "package"), [([], "viser"), (["flight.mcap"], "mcap")])
def test_a_missing_extra_is_named_with_what_installs_it(argv, package, capsys, monkeypatch) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == package else found(name))
    text = refusal(argv, capsys)
    assert text == f"gcs view: the page needs the package {package}: pip install 'yawsitter-sitl[view]'\n"


def test_a_recording_that_is_not_there_is_named(capsys) -> None:
    assert refusal(["gone.mcap"], capsys) == "gcs view: gone.mcap: No such file or directory\n"
