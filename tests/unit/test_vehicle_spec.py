from pathlib import Path

import pytest

from sitl.control.gains import GAIN_NAMES
from sitl.model.airframe import Airframe
from sitl.strict_yaml import ConfigError
from sitl.vehicle_spec import load_vehicle, vehicle_names, with_airframe

BUNDLED = Path("sitl")


def test_all_bundled_vehicles_load() -> None:
    assert vehicle_names() == ["yawsitter", "yawsitter-literal", "yawsitter-real"]
    for name in vehicle_names():
        assert load_vehicle(name).name == name


def test_every_airframe_number_has_a_unit_and_a_source() -> None:
    for name in vehicle_names():
        parameters = load_vehicle(name).airframe.file.parameters
        assert set(parameters) == set(Airframe._fields)
        assert all(entry.unit and entry.source for entry in parameters.values())


def test_the_paper_gains_are_the_printed_table() -> None:
    gains = load_vehicle("yawsitter").gains
    assert set(gains) == set(GAIN_NAMES)
    assert len(GAIN_NAMES) == 36
    assert (gains["POS_X_P"], gains["VEL_Z_I"], gains["ATT_Y_D"], gains["RATE_Y_P"]) == (2.84, 0.22, 1.25, 2.50)


def test_the_real_vehicle_lags_and_the_paper_one_does_not() -> None:
    assert load_vehicle("yawsitter").actuators == (0.0, 0.0)
    assert load_vehicle("yawsitter-real").actuators == (0.04, 0.03)


def test_an_unknown_vehicle_names_those_there_are() -> None:
    with pytest.raises(ConfigError, match="unknown vehicle 'nope': use one of yawsitter, yawsitter-literal"):
        load_vehicle("nope")


def edited(tmp_path: Path, old: str, new: str) -> str:
    text = (BUNDLED / "vehicles/yawsitter.yaml").read_text()
    assert old in text
    path = tmp_path / "mine.yaml"
    path.write_text(text.replace(old, new))
    return str(path)


@pytest.mark.parametrize(("rate_hz", "step_us", "substeps"), [(250, 4000, 1), (200, 5000, 2), (100, 10_000, 3)])
def test_a_file_of_ones_own_is_a_vehicle_too_integrated_in_steps_of_4_ms_at_most(
    tmp_path: Path, rate_hz: int, step_us: int, substeps: int
) -> None:
    spec = load_vehicle(edited(tmp_path, "control_rate_hz: 500", f"control_rate_hz: {rate_hz}"))
    assert (spec.name, spec.step_us, spec.substeps) == ("mine", step_us, substeps)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("control_rate_hz: 500", "control_rate_hz: 333", r"mine.yaml:4: control_rate_hz: 333 must be in"),
        ("motor_tau_s: 0.0", "motor_tau_s: -1", r"mine.yaml:5: actuators.motor_tau_s: -1.* must be 0 or greater"),
        ("gains: paper", "gains: papper", r"unknown gain 'papper': use one of paper, tuned"),
        ("airframe: yawsitter", "airframe: 7", r"mine.yaml:2: airframe: Expected `str`"),
        ("actuators:", "actuator:", r"mine.yaml:.*unknown field `actuator`"),
    ],
)
def test_a_mistake_in_a_vehicle_file_is_named_with_its_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load_vehicle(edited(tmp_path, old, new))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("{value: 1.076, ", "{value: -1, ", "parameters.mass_kg: -1.* must be greater than 0"),
        ("{value: 1.076, ", "{value: .nan, ", "parameters.mass_kg: nan is not finite"),
        ("  mass_kg:", "  mass:", "parameters: missing: mass_kg"),
        ("{value: 0.513,", "{value: 1.5,", r"yaml:\d+: parameters.immersed_fraction: 1.5 must be in 0"),
        ("{value: 0.5, ", "{value: 11, ", r"yaml:\d+: parameters.thrust_min_N: 11.0 must be below thrust_max_N, 11.0"),
        ("{value: 1.387e-7, ", "{value: -1, ", "parameters.torque_coefficient: -1.0 must be 0 or greater"),
    ],
)
def test_a_mistake_in_an_airframe_file_is_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = " ".join((BUNDLED / "airframes/yawsitter.yaml").read_text().split(" "))
    import re

    text = re.sub(r"value: ([^,]+),\s+unit", r"value: \1, unit", text)
    assert old in text
    (tmp_path / "frame.yaml").write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=message):
        load_vehicle(edited(tmp_path, "airframe: yawsitter", "airframe: frame.yaml"))


def test_a_negative_gain_is_refused_with_its_line(tmp_path: Path) -> None:
    text = (BUNDLED / "gains/paper.yaml").read_text()
    (tmp_path / "mine-gains.yaml").write_text(text.replace("P: 2.84", "P: -2.84"))
    with pytest.raises(ConfigError, match=r"mine-gains.yaml:3: gains.POS_X.P: -2.84 must be 0 or greater"):
        load_vehicle(edited(tmp_path, "gains: paper", "gains: mine-gains.yaml"))


def test_a_changed_airframe_flies_while_the_controller_believes_in_another() -> None:
    spec = load_vehicle("yawsitter")
    heavy, believed = with_airframe(spec, {"mass_kg": 1.2}, {"side_force_factor": 0.0})
    printed = spec.airframe.airframe
    assert heavy.airframe.airframe == printed._replace(mass_kg=1.2)
    assert believed == printed._replace(side_force_factor=0.0)
    assert spec.airframe.airframe.mass_kg == 1.076


def test_an_airframe_number_that_there_is_not_or_that_cannot_be_is_refused() -> None:
    spec = load_vehicle("yawsitter")
    with pytest.raises(ConfigError, match="airframe: unknown: mass; there are mass_kg, jxx_kg_m2"):
        with_airframe(spec, {"mass": 1.2}, {})
    with pytest.raises(ConfigError, match=r"airframe: mass_kg: 0\.0 must be greater than 0"):
        with_airframe(spec, {}, {"mass_kg": 0.0})
