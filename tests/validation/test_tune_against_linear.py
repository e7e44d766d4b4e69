"""What `gcs tune step` reads off a flight, against the same loops as matrices (sitl.reproduce)."""

import pytest

from gcs_tools.client import Client
from gcs_tools.tune import analysis, loops
from gcs_tools.tune.experiment import Experiment, GainSet
from gcs_tools.tune.session import InProcess, conduct
from sitl.margins import Margins
from sitl.reproduce.linear import hover, linearised
from sitl.reproduce.loops import IDEAL, axis_margins, design
from sitl.vehicle import Vehicle, load_vehicle

VEHICLE = "yawsitter-real"
STATE_KNOWN = {"EST_ENABLE": 0, "CTL_DIST_F_BW": 0, "CTL_DIST_M_BW": 0}


@pytest.fixture(scope="module")
def computed() -> dict[tuple[str, str], Margins | None]:
    d = design(VEHICLE)
    rows = axis_margins(linearised(d, hover(design(VEHICLE, IDEAL))), d.gains)
    return {(loop, axis): margins for loop, axis, _, margins in rows}


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("name", "loop", "axis"),
    [("rate.q", "rate", "Q"), ("attitude.psi", "attitude", "ψ"), ("velocity.y", "velocity", "east"),
     ("position.x", "position", "north")],
)  # fmt: skip
def test_bandwidth_and_phase_margin_from_a_step_are_those_of_the_linear_loop(
    name: str, loop: str, axis: str, computed: dict[tuple[str, str], Margins | None]
) -> None:
    chosen = loops.parse(name)
    excitation = loops.step(chosen.kind.size, chosen.kind.hold_s)
    experiment = Experiment(Client(), chosen, excitation, [GainSet("own", None)], land=False)
    vehicle = Vehicle(load_vehicle(VEHICLE), overrides=STATE_KNOWN)
    (trial,) = conduct(experiment, InProcess(vehicle, lambda: experiment.recording), quiet=True)
    flown = analysis.analyse(trial, excitation, 0.02).values
    expected = computed[loop, axis]
    assert expected is not None
    assert flown["bandwidth_rad_s"] == pytest.approx(expected.bandwidth_rad_s, rel=0.05)
    assert flown["phase_margin_deg"] == pytest.approx(expected.phase_deg, abs=3.0)
    assert flown["crossover_rad_s"] == pytest.approx(expected.crossover_rad_s, rel=0.08)
