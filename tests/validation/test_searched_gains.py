"""The example of gains that `gcs tune auto` has found, in flights that the search never saw."""

from pathlib import Path

import pytest

from gcs_tools import plan
from sitl import batch
from sitl.vehicle_spec import gains_named, load_vehicle

FOUND = "examples/gains/searched-yawsitter.yaml"


@pytest.mark.compiled
@pytest.mark.parametrize("mission", ["rectangle", "circle"])
@pytest.mark.parametrize("gust_m_s", [0.0, 0.5])
def test_they_hold_the_paths_closer_than_the_papers(mission: str, gust_m_s: float) -> None:
    path, spec = plan.load(Path("missions") / f"{mission}.yaml"), load_vehicle("yawsitter")
    found, paper = (
        batch.fly(path, spec, seed=11, gust_m_s=gust_m_s, parameters=gains_named(gains)) for gains in (FOUND, "paper")
    )
    assert found.fault == paper.fault == ""
    assert found.mean_distance_m < 0.4 * paper.mean_distance_m
    assert found.max_distance_m < 0.5 * paper.max_distance_m
