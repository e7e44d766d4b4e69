"""Flights from Python, and the examples that show them."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sitl import Actuation, ConfigError, FlightError, Flown, fly
from sitl.api import COLUMNS

pytestmark = pytest.mark.compiled

ROOT = Path(__file__).parents[2]
HOVER = ROOT / "missions" / "hover.yaml"


@pytest.fixture(scope="module")
def hover() -> Flown:
    return fly(HOVER, "yawsitter-real", seed=4, wind_N=(1.0, 0.0, 0.0), gust_m_s=0.3, parameters={"POS_X_P": 2.0})


def test_it_is_the_flight_that_the_command_line_flies(hover: Flown) -> None:
    arguments = "--vehicle yawsitter-real --seed 4 --wind 1,0,0 --gust 0.3 --set POS_X_P=2.0 --json"
    command = [sys.executable, "-m", "sitl", "fly", str(HOVER), *arguments.split()]
    printed = json.loads(subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout)
    true = printed.pop("true")
    assert {**hover.reported, "real_time_factor": 0} == {**printed, "real_time_factor": 0}
    assert {name: hover.true[name] for name in ("mae", "rmse", "max_overshoot", "final_error")} == {
        name: values for name, values in true.items() if "distance" not in name
    }
    away = np.linalg.norm(hover.position_m - hover.reference_m, axis=1)
    assert true["max_distance"] == pytest.approx(away.max(), abs=1e-6)
    assert true["mean_distance"] == pytest.approx(away.mean(), rel=0.01)


def test_its_arrays_have_a_row_for_every_sample_and_say_what_happened(hover: Flown) -> None:
    n = len(hover.t_s)
    assert hover.t_s[0] == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(np.diff(hover.t_s), 0.02, atol=1e-9)
    for array in (hover.position_m, hover.reported_m, hover.reference_m, hover.angles_deg):
        assert array.shape == (n, 3)
    assert hover.thrust_N.shape == hover.flap_deg.shape == (n, 2)
    middle = n // 2
    assert hover.reference_m[middle].tolist() == [0.0, 0.0, -2.0]
    assert hover.position_m[middle, 2] == pytest.approx(-2.0, abs=0.1)
    assert 80.0 < hover.angles_deg[middle, 1] < 115.0
    assert hover.thrust_N[middle].sum() == pytest.approx(hover.vehicle.spec.airframe.airframe.mass_kg * 9.81, rel=0.1)
    assert hover.column(COLUMNS[0]) is not None


def test_a_vehicle_with_sensors_reports_another_position_than_the_true_one(hover: Flown) -> None:
    apart = np.abs(hover.reported_m - hover.position_m).max()
    assert 1e-4 < apart < 0.2
    assert hover.true["mae"] != hover.reported["mae"]


def test_its_short_form_tells_mission_vehicle_and_error(hover: Flown) -> None:
    north = hover.true["mae"][0]
    assert repr(hover).startswith("<Flown hover, yawsitter-real, ")
    assert f"{north:.4f}" in repr(hover)


def test_an_uploaded_mission_is_measured_against_the_vehicles_own_reference() -> None:
    flown = fly(ROOT / "missions" / "rectangle-mission.plan")
    assert max(flown.true["mae"]) < 0.05
    assert flown.true["mae"] == pytest.approx(flown.reported["mae"], abs=0.01)
    assert len(flown.true["waypoints"]) == len(flown.reported["waypoints"]) > 3


@pytest.mark.parametrize(
    ("arguments", "options", "named"),
    [
        (("missions/nowhere.yaml",), {}, r"nowhere\.yaml: no such mission file"),
        ((HOVER, "zeppelin"), {}, "unknown vehicle 'zeppelin': use one of .*yawsitter"),
        ((HOVER,), {"parameters": {"POS_Q_P": 1.0}}, "parameter POS_Q_P: unknown"),
        ((HOVER,), {"parameters": {"POS_X_P": -1.0}}, "parameter POS_X_P: -1 refused.*allowed 0 … 100"),
        ((HOVER,), {"plant": {"mass_lb": 1.0}}, "mass_lb"),
    ],
)
def test_settings_that_cannot_be_used_say_what_is_wrong(arguments, options, named) -> None:
    with pytest.raises(ConfigError, match=named):
        fly(*arguments, **options)


def test_a_flight_that_fails_says_why_and_keeps_what_was_flown() -> None:
    def falling(t_s, nav, ref):
        return Actuation(0, 0, 0, 0) if nav.down_m < -0.6 else Actuation(6.5, 6.5, 0, 0)

    with pytest.raises(FlightError, match="hover: ") as failed:
        fly(HOVER, controller=falling)
    flown = failed.value.flown
    assert "not completed" in repr(flown)
    assert flown.true == flown.reported == {}
    assert flown.position_m[:, 2].min() < -0.5


def test_a_pilot_that_changes_nothing_flies_the_same_bits() -> None:
    from gcs_tools import lockstep, plan
    from sitl import Vehicle, load_vehicle

    flights = []
    for pilot in (None, lambda t_s, nav, guidance: guidance):
        vehicle = Vehicle(load_vehicle("yawsitter-real"), seed=2, gust_m_s=0.3)
        vehicle.pilot = pilot
        lockstep.fly(plan.load(HOVER), vehicle)
        flights.append(vehicle.snapshot())
    assert flights[0] == flights[1]


def test_importing_the_package_costs_nothing_of_what_flying_needs() -> None:
    code = "import sys, sitl; print(sorted({'numpy', 'numba', 'pymavlink', 'sitl.api'} & set(sys.modules)), dir(sitl))"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert said.startswith("[] ")
    assert "'fly'" in said


def example(name: str, *arguments: str) -> str:
    command = [sys.executable, str(ROOT / "examples" / name), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout


def test_the_example_that_plots_draws_its_picture(tmp_path: Path) -> None:
    picture = tmp_path / "circle.png"
    assert "<Flown circle, yawsitter-real" in example("fly_and_plot.py", str(picture))
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_example_that_sweeps_a_gain_prints_a_row_for_each_value() -> None:
    _, soft, stiff = example("sweep_a_gain.py", "POS_X_P", "0.5", "2").splitlines()
    assert float(stiff.split()[1]) < float(soft.split()[1])


def test_the_example_with_its_own_controller_flies_as_well_as_it_says() -> None:
    built_in, own = example("own_controller.py").splitlines()
    assert max(float(v) for v in own.split("|")[2].split("m (")[0].split("/")) < 0.02
    assert "built in" in built_in
