"""Parameters over the link, against the stand-in vehicle."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from gcs_tools_stand_in import Pair, StandIn

from gcs_tools import parameter_files, params
from gcs_tools.client import Client, LinkError, Script
from gcs_tools.parameter import Parameter, number_text
from sitl.control.gains import GAIN_NAMES
from sitl.mavlink.wire import float32
from sitl.strict_yaml import ConfigError


def talk(script: Callable[[Client], Script[Any]], vehicle: StandIn | None = None, *, loss: float = 0.0) -> Any:
    """The result of a script that talks to a vehicle; its fault is raised."""
    client = Client()

    def whole() -> Script[Any]:
        yield from client.connect()
        return (yield from script(client))

    client.start(whole())
    Pair(client, vehicle or StandIn(), loss=loss).run()
    if client.fault is not None:
        raise client.fault
    return client.result


def test_a_list_has_every_parameter_by_name() -> None:
    found = talk(params.fetch_all)
    assert list(found) == ["POS_X_P", "RATE_Y_P", "SIM_PAUSE"]
    assert found["RATE_Y_P"] == Parameter("RATE_Y_P", 0.5, False)


def test_an_integer_comes_out_of_its_bytes() -> None:
    vehicle = StandIn()
    vehicle.parameters["SIM_PAUSE"] = 7
    value = talk(lambda c: params.fetch(c, "SIM_PAUSE"), vehicle).value
    assert value == 7
    assert isinstance(value, int)


def test_what_got_lost_of_a_list_is_asked_for_singly() -> None:
    vehicle = StandIn()
    vehicle.lost_parameters = 2
    assert len(talk(params.fetch_all, vehicle)) == 3


@pytest.mark.parametrize("loss", [0.1, 0.3])
def test_a_list_is_complete_over_a_bad_link(loss: float) -> None:
    vehicle = StandIn()
    vehicle.parameters = {f"P{k:03}": float(k) for k in range(200)}
    vehicle.int_parameters = set()
    found = talk(params.fetch_all, vehicle, loss=loss)
    assert {name: p.value for name, p in found.items()} == vehicle.parameters


def test_a_write_is_seen_in_force() -> None:
    vehicle = StandIn()
    assert talk(lambda c: params.store(c, "RATE_Y_P", 0.7), vehicle).text == "0.7"
    assert vehicle.parameters["RATE_Y_P"] == float32(0.7)
    assert talk(lambda c: params.store(c, "SIM_PAUSE", 1), vehicle) == Parameter("SIM_PAUSE", 1, True)


def test_a_value_that_the_vehicle_uses_up_at_once_is_written_once() -> None:
    class Stepping(StandIn):
        """A step is run within the turn in which it is asked for: the parameter is told, and told again as 0."""

        writes = 0

        def _on_param_set(self, m: Any, back: dict[str, int]) -> None:
            super()._on_param_set(m, back)
            self.writes += 1
            self.parameters["SIM_STEP_MS"] = 0
            self._value("SIM_STEP_MS")

    vehicle = Stepping()
    vehicle.parameters["SIM_STEP_MS"] = 0
    vehicle.int_parameters.add("SIM_STEP_MS")
    assert talk(lambda c: params.store(c, "SIM_STEP_MS", 20), vehicle).value == 20
    assert vehicle.writes == 1


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("RATE_Y_P", 1000.0, "RATE_Y_P: value out of range; it stays 0.5"),
        ("SIM_PAUSE", 0.5, "SIM_PAUSE: 0.5 refused: it takes whole numbers"),
        ("NOPE", 1.0, "NOPE: no such parameter"),
        ("A_NAME_LONGER_THAN_16", 1.0, "'A_NAME_LONGER_THAN_16' can't be a parameter"),
    ],
)
def test_a_refused_write_says_why_and_what_stays(name: str, value: float, message: str) -> None:
    vehicle = StandIn()
    before = dict(vehicle.parameters)
    with pytest.raises(LinkError) as caught:
        talk(lambda c: params.store(c, name, value), vehicle)
    assert str(caught.value).startswith(message)
    assert vehicle.parameters == before


def test_a_file_written_and_loaded_again_changes_nothing(tmp_path: Path) -> None:
    vehicle, path = StandIn(), tmp_path / "all.yaml"
    vehicle.parameters |= {"RATE_Y_P": float32(0.1), "POS_X_P": float32(1e-7)}
    parameter_files.write(path, talk(params.fetch_all, vehicle), "yawsitter")
    assert talk(lambda c: parameter_files.apply(c, path, parameter_files.read(path)), vehicle) == []


def test_a_loaded_file_writes_what_differs(tmp_path: Path) -> None:
    vehicle, path = StandIn(), tmp_path / "some.yaml"
    path.write_text("RATE_Y_P: 0.25\nPOS_X_P: 2.5\n")
    changed = talk(lambda c: parameter_files.apply(c, path, parameter_files.read(path)), vehicle)
    assert [(old.text, new.text) for old, new in changed] == [("0.5", "0.25")]
    assert vehicle.parameters["RATE_Y_P"] == 0.25


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("RATE_Y_P: 0.25\nNOPE: 1\n", "some.yaml:2: NOPE: the vehicle has no such parameter"),
        ("RATE_Y_P: 0.25\nSIM_PAUSE: 0.5\n", "some.yaml:2: SIM_PAUSE: 0.5 refused: it takes whole numbers"),
    ],
)
def test_a_file_with_a_mistake_names_the_line_and_writes_nothing(tmp_path: Path, text: str, message: str) -> None:
    vehicle, path = StandIn(), tmp_path / "some.yaml"
    path.write_text(text)
    with pytest.raises(LinkError) as caught:
        talk(lambda c: parameter_files.apply(c, path, parameter_files.read(path)), vehicle)
    assert str(caught.value).endswith(message)
    assert vehicle.parameters["RATE_Y_P"] == 0.5


def test_a_file_that_is_no_list_of_numbers_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "some.yaml"
    path.write_text("RATE_Y_P: high\n")
    with pytest.raises(ConfigError, match=r"some\.yaml:1: "):
        parameter_files.read(path)


def test_a_gains_file_is_loaded_as_the_parameters_it_holds() -> None:
    vehicle = StandIn()
    vehicle.parameters |= dict.fromkeys(GAIN_NAMES, 1.0)
    path = Path("sitl/gains/tuned.yaml")
    changed = talk(lambda c: parameter_files.apply(c, path, parameter_files.read(path)), vehicle)
    assert len(changed) == 36
    assert vehicle.parameters["RATE_Y_P"] == float32(0.386)
    vehicle.parameter_limit = 5.0
    vehicle.parameters["ATT_Y_P"] = 1.0
    with pytest.raises(LinkError, match=r"tuned\.yaml:10: ATT_Y_P: value out of range; it stays 1"):
        talk(lambda c: parameter_files.apply(c, path, parameter_files.read(path)), vehicle)


@pytest.mark.parametrize(
    "text",
    [
        "# Onboard parameters\n1\t1\tRATE_Y_P\t0.250000\t9\n1\t1\tSIM_PAUSE\t1\t6\n",
        "RATE_Y_P         0.250000\nSIM_PAUSE        1\n",
        "RATE_Y_P,0.25\nSIM_PAUSE,1 # stop\n",
    ],
)
def test_lists_of_other_ground_stations_are_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "some.param"
    path.write_text(text)
    assert {name: written.value for name, written in parameter_files.read(path).items()} == {
        "RATE_Y_P": 0.25,
        "SIM_PAUSE": 1.0,
    }


@pytest.mark.parametrize("text", ["RATE_Y_P 0.1\nRATE_Y_P high\n", "A 1\n1 2 3\n", "A 1\nA 2\n", "A 1\nB nan\n"])
def test_a_list_that_cannot_be_read_names_the_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "some.param"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"some\.param:2: "):
        parameter_files.read(path)


@pytest.mark.parametrize(("value", "text"), [(40.0, "40"), (0.1, "0.1"), (-2.5, "-2.5"), (1e-7, "1e-07"), (7, "7")])
def test_numbers_are_written_as_short_as_they_read_back(value: float, text: str) -> None:
    assert number_text(value if isinstance(value, int) else float32(value)) == text
    assert float32(float(text)) == float32(value)
