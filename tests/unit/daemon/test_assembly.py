"""What the settings of `sitl run` make of a vehicle."""

from pathlib import Path

import pytest

from sitl.daemon.assembly import build_vehicle
from sitl.daemon.config import RunConfig, SettingError


def test_gains_of_the_command_line_rule_over_stored_ones_and_single_settings_over_them(tmp_path: Path) -> None:
    stored = build_vehicle(RunConfig(state_dir=tmp_path))
    stored.parameters.set("POS_X_P", 2.0)
    stored.parameters.set("MPC_XY_CRUISE", 2.0)
    vehicle = build_vehicle(RunConfig(state_dir=tmp_path, gains="tuned", settings=(("POS_Y_P", 1.5),)))
    names = ("POS_X_P", "POS_Y_P", "RATE_Z_P", "MPC_XY_CRUISE")
    assert [vehicle.parameters[name] for name in names] == pytest.approx([1.3, 1.5, 0.615, 2.0])
    again = build_vehicle(RunConfig(state_dir=tmp_path))
    assert again.parameters["POS_X_P"] == 2.0


def test_gains_that_there_are_not_are_refused_with_those_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(SettingError, match="unknown gain 'nope': use one of paper, tuned"):
        build_vehicle(RunConfig(state_dir=tmp_path, gains="nope"))
