"""Flights without a link are the flights of `sitl fly`, to the last bit of the plant's state."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcs_tools import lockstep, yaml_plan
from gcs_tools import plan as plans
from gcs_tools.metrics import Track, evaluate
from gcs_tools.plan import Plan, Streamed, Uploaded
from gcs_tools.reference import ZERO, TimedPoint, Waypoints
from sitl import batch
from sitl.strict_yaml import ConfigError
from sitl.vehicle import Vehicle, load_vehicle

pytestmark = pytest.mark.compiled

MISSIONS = Path(__file__).parents[2] / "missions"
BREEZE = {"seed": 3, "wind_N": (1.0, 0.5, 0.0), "gust_m_s": 0.5}


class _Watched(Vehicle):
    """Keeps its true state at the end of every turn."""

    def __init__(self, *args: Any, **options: Any) -> None:
        self.seen: dict[int, tuple[float, ...]] = {}
        super().__init__(*args, **options)

    def advance(self, until_us: int, trace: Any = None) -> None:
        super().advance(until_us, trace)
        self.seen[self.now_us] = tuple(self.snapshot().truth)


def over_the_link(plan: Plan, vehicle: str, **settings: Any) -> tuple[lockstep.Flown, dict[int, tuple[float, ...]]]:
    watched = lockstep.build(plan, load_vehicle(vehicle), _Watched, **settings)
    return lockstep.fly(plan, watched), watched.seen


def mission(text: str) -> Uploaded:
    plan = yaml_plan.loads(f"name: test\nkind: mission\nlimit_s: 60\nitems:\n{text}", "test.yaml")
    assert isinstance(plan, Uploaded)
    return plan


UP_AND_STAY = mission("  - {do: takeoff, at_m: [0, 0, -2]}\n  - {do: waypoint, at_m: [1, 0, -2]}\n")
HOP = Streamed("hop", "", Waypoints([TimedPoint(0.0, ZERO), TimedPoint(3.0, (1.0, 0.0, -1.5))]), 4.007, (), None, None)
FENCE = yaml_plan.loads((MISSIONS / "rectangle-fenced.yaml").read_text(), "test.yaml").fence
FENCED_HOP = HOP._replace(fence=FENCE, rally=())
RETURNS = mission("  - {do: takeoff, at_m: [0, 0, -2]}\n  - {do: delay, seconds_s: 1}\n  - {do: return}\n")


@pytest.mark.parametrize(
    ("plan", "vehicle", "settings"),
    [
        pytest.param("hover.yaml", "yawsitter-real", BREEZE, id="targets, in wind, on the filter"),
        pytest.param("circle.yaml", "yawsitter", {}, id="targets that end in the air"),
        pytest.param(HOP, "yawsitter-real", {"seed": 2}, id="targets without heading, for no whole number of turns"),
        pytest.param(HOP, "yawsitter", {"overrides": {"GF_MAX_HOR_DIST": 9.0}}, id="targets within a fence"),
        pytest.param(FENCED_HOP, "yawsitter-real", {"seed": 2}, id="targets with a fence of their own"),
        pytest.param("rectangle-mission.yaml", "yawsitter-real", BREEZE, id="a mission that lands"),
        pytest.param("rectangle-fenced.yaml", "yawsitter", {}, id="a mission with fence and rally point"),
        pytest.param(UP_AND_STAY, "yawsitter", {}, id="a mission that stays up"),
        pytest.param(RETURNS, "yawsitter-real", {"overrides": {"EST_ENABLE": 0.0}}, id="a mission that returns"),
    ],
)
def test_a_flight_without_link_is_the_flight_over_the_link(
    plan: str | Plan, vehicle: str, settings: dict[str, Any]
) -> None:
    plan = plans.load(MISSIONS / plan) if isinstance(plan, str) else plan
    options = {("parameters" if name == "overrides" else name): value for name, value in settings.items()}
    mine = batch.fly(plan, load_vehicle(vehicle), traced=True, **options)
    flown, seen = over_the_link(plan, vehicle, **settings)
    flight = flown.flight
    assert (mine.fault, flight.client.fault) == ("", None)
    assert mine.landed
    assert mine.duration_s == pytest.approx(flight.measured_s, abs=1e-9)
    assert mine.trace is not None
    t_us = np.round(mine.trace[:, 0] * 1e6).astype(int)
    every = t_us % 20_000 == 0
    assert [tuple(row[1:18]) for row in mine.trace[every]] == [seen[t] for t in t_us[every]]
    assert mine.end_N == seen[round(mine.end_s * 1e6)][:3]
    start_s = flight.t0_s or 0.0
    t = np.array([at for at in sorted(seen) if at * 1e-6 <= start_s + mine.duration_s + 1e-6])
    position = np.array([seen[at][:3] for at in t])
    assert mine.start_s == start_s
    told = flight.track()
    reference = np.column_stack([np.interp(t * 1e-6 - start_s, told.t_s, told.reference_m[:, k]) for k in range(3)])
    none = np.zeros((0, 4))
    true = evaluate(Track(t * 1e-6 - start_s, reference, position, none, none, none), mine.duration_s)
    for figure, wanted in zip(mine[4:9], true[:5], strict=True):
        assert figure == pytest.approx(wanted, abs=2e-5 if isinstance(plan, Uploaded) else 1e-9)


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param({"wind_N": (14.0, 0.0, 0.0)}, id="blown away on the ground"),
        pytest.param({"overrides": {"BAT_CRIT_THR": 0.999, "COM_LOW_BAT_ACT": 2.0}}, id="sent down by its battery"),
    ],
)
def test_a_flight_that_goes_wrong_goes_wrong_as_over_the_link(settings: dict[str, Any]) -> None:
    plan = plans.load(MISSIONS / "hover.yaml")
    options = {("parameters" if name == "overrides" else name): value for name, value in settings.items()}
    mine = batch.fly(plan, load_vehicle("yawsitter"), **options)
    flown, seen = over_the_link(plan, "yawsitter", **settings)
    assert mine.fault == str(flown.flight.client.fault) != "None"
    assert mine.end_s * 1e6 == pytest.approx(max(seen), abs=200_000)


def test_a_mission_outside_its_fence_is_stopped_as_over_the_link() -> None:
    outside = UP_AND_STAY._replace(fence=FENCE, items=(UP_AND_STAY.items[0], UP_AND_STAY.items[1]._replace(x=300_000)))
    mine = batch.fly(outside, load_vehicle("yawsitter"))
    flown, _ = over_the_link(outside, "yawsitter")
    assert mine.fault == str(flown.flight.client.fault)
    assert "item 1 lies outside the fence: outside the polygon of fence item 0" in mine.fault


def test_figures_are_of_the_plant_and_its_seed() -> None:
    plan = plans.load(MISSIONS / "hover.yaml")
    assert isinstance(plan, Streamed)
    one, same, other = (batch.fly(plan, load_vehicle("yawsitter-real"), seed=seed) for seed in (1, 1, 2))
    assert one == same
    assert one.mae_m != other.mae_m
    assert all(m <= r <= x for m, r, x in zip(one.mae_m, one.rmse_m, one.max_error_m, strict=True))
    assert max(one.max_error_m) <= one.max_distance_m <= math.hypot(*one.max_error_m)
    assert max(one.mae_m) <= one.mean_distance_m <= math.hypot(*one.rmse_m)
    assert not one.tipped_over
    assert 9.0 < one.max_tilt_deg < 20.0
    assert 0.4 < one.least_height_m < 0.6
    assert 5e3 < one.energy_J < 2e4
    assert math.hypot(*one.end_N[:2]) < 0.05


def test_a_mission_that_the_vehicle_refuses_is_a_fault_and_a_period_beside_the_turns_an_error() -> None:
    spec = load_vehicle("yawsitter")
    jumps = UP_AND_STAY._replace(items=(UP_AND_STAY.items[0]._replace(command=177, param1=99.0),))
    assert "refuses the mission: item 0" in batch.fly(jumps, spec).fault
    with pytest.raises(ConfigError, match="divide 20 ms"):
        batch.fly(UP_AND_STAY, spec._replace(step_us=3000))
