"""Experiments in lockstep with the real vehicle: what is measured, and that the vehicle is left as it was."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gcs_tools.client import Client, LinkError
from gcs_tools.lockstep import TURN_US, Lockstep
from gcs_tools.tune import analysis, gain_sets, loops
from gcs_tools.tune.experiment import Experiment, GainSet, Trial
from gcs_tools.tune.session import LEFT_BEHIND, InProcess, conduct
from sitl.onboard.modes import Mode, Outcome, Verdict
from sitl.strict_yaml import ConfigError
from sitl.vehicle import Vehicle, load_vehicle

HEIGHT_M = 6.0


def gains_of(vehicle: Vehicle) -> dict[str, float]:
    return {name: vehicle.parameters[name] for name in loops.GAIN_NAMES}


class Craft:
    """A vehicle, a client and an experiment on a link in this process."""

    def __init__(self, loop: str, *sets: GainSet, vehicle: Vehicle | None = None, hold_s: float | None = None) -> None:
        self.vehicle = vehicle or Vehicle(load_vehicle("yawsitter-real"))
        self.loop = loops.parse(loop)
        kind = self.loop.kind
        self.excitation = loops.step(kind.size, hold_s or kind.hold_s)
        self.experiment = Experiment(
            Client(), self.loop, self.excitation, sets or (GainSet("own", None),), height_m=HEIGHT_M
        )
        self.link = InProcess(self.vehicle, lambda: self.experiment.recording)
        self.before = gains_of(self.vehicle)

    def conduct(self) -> list[Trial]:
        return conduct(self.experiment, self.link, quiet=True)

    def figures(self) -> list[dict[str, float]]:
        return [analysis.analyse(trial, self.excitation, 0.02).values for trial in self.conduct()]

    def interrupt_when(self, condition: Callable[[], bool]) -> None:
        """Ctrl-C at the first turn at which the condition holds."""
        turn, fired = self.link._lockstep.turn, []

        def interrupted(client: Client, turn_us: int = TURN_US) -> None:
            turn(client, turn_us)
            if not fired and condition():
                fired.append(True)
                raise KeyboardInterrupt

        self.link._lockstep.turn = interrupted  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ("loop", "rise_s"), [("position.y", 0.99), ("velocity.z", 0.5), ("attitude.psi", 0.122), ("rate.p", 0.061)]
)
def test_a_step_is_recorded_at_every_control_step_and_measured(loop: str, rise_s: float) -> None:
    craft = Craft(loop)
    (values,) = craft.figures()
    record = craft.experiment.trials[0].records[0]
    assert record.rate_Hz == pytest.approx(500.0)
    assert np.diff(record.t_s)[1:].max() == pytest.approx(0.002)
    assert values["rise_s"] == pytest.approx(rise_s, rel=0.1)
    assert abs(values["steady_error"]) < 0.02 * craft.excitation.size
    assert values["overshoot"] < 0.25
    assert values["bandwidth_rad_s"] * values["rise_s"] == pytest.approx(2.2, rel=0.2)  # near enough to first order
    assert values["energy_s"] > 0.0
    assert not craft.vehicle.commander.armed


def test_two_sets_of_gains_are_flown_and_the_vehicles_own_are_back_afterwards() -> None:
    craft = Craft("rate.q", gain_sets.load("own"), GainSet("soft", {"RATE_Y_P": 0.15}))
    own, soft = craft.figures()
    assert soft["bandwidth_rad_s"] < 0.6 * own["bandwidth_rad_s"]
    assert [trial.gains["RATE_Y_P"] for trial in craft.experiment.trials] == pytest.approx([0.386, 0.15])
    assert gains_of(craft.vehicle) == craft.before


def test_gains_that_cannot_hold_the_vehicle_are_taken_back_and_told() -> None:
    limp = GainSet("limp", {"POS_X_P": 30.0, "VEL_X_P": 30.0})
    craft = Craft("position.x", limp, GainSet("own", None), hold_s=3.0)
    lost, flown = craft.conduct()
    assert lost.fault
    assert lost.records == []
    assert flown.fault == ""
    assert analysis.analyse(lost, craft.excitation, 0.02).values == {}
    assert gains_of(craft.vehicle) == craft.before


def test_ctrl_c_puts_the_gains_back_and_lands() -> None:
    craft = Craft("rate.q", GainSet("soft", {"RATE_Y_P": 0.15}))
    craft.interrupt_when(lambda: craft.experiment.recording)
    with pytest.raises(KeyboardInterrupt):
        craft.conduct()
    assert gains_of(craft.vehicle) == craft.before
    assert craft.vehicle.commander.mode is Mode.LAND


class Severed(Lockstep):
    """Carries nothing to the client from an instant on, for so long."""

    def __init__(self, vehicle: Vehicle, when: Callable[[], bool], seconds: float) -> None:
        super().__init__(vehicle)
        self._when, self._seconds, self._until_s = when, seconds, math.nan

    def turn(self, client: Client, turn_us: int = TURN_US) -> None:
        now_s = self.vehicle.now_us * 1e-6
        if math.isnan(self._until_s) and self._when():
            self._until_s = now_s + self._seconds
        if not now_s < self._until_s:
            super().turn(client, turn_us)
            return
        client.poll(now_s)
        self.vehicle.advance(self.vehicle.now_us + turn_us)


@pytest.mark.parametrize("away_s", [8.0, 1000.0])
def test_a_lost_link_puts_the_gains_back_when_it_returns_and_keeps_them_in_a_file_if_it_does_not(
    away_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    craft = Craft("rate.q", GainSet("soft", {"RATE_Y_P": 0.15}))
    craft.link._lockstep = Severed(craft.vehicle, lambda: craft.experiment.recording, away_s)
    with pytest.raises(LinkError, match="nothing heard from the vehicle for 3 s") as fault:
        craft.conduct()
    if away_s < 100.0:
        assert gains_of(craft.vehicle) == craft.before
        assert not LEFT_BEHIND.exists()
    else:
        assert "gcs param load" in str(fault.value)
        assert gain_sets.load(str(LEFT_BEHIND)).gains == pytest.approx(craft.before, rel=1e-4)


def test_a_vehicle_that_hovers_is_taken_over_and_left_in_hold() -> None:
    vehicle = Vehicle(load_vehicle("yawsitter"))
    vehicle.advance(100_000)
    vehicle.commander.takeoff(vehicle.commander.origin.alt_amsl_m + 4.0)
    vehicle.commander.arm()
    vehicle.advance(12_000_000)
    craft = Craft("rate.p", vehicle=vehicle)
    (values,) = craft.figures()
    assert values["rise_s"] < 0.05
    assert vehicle.commander.armed
    assert vehicle.commander.mode is Mode.HOLD
    assert -vehicle.snapshot().truth.down_m == pytest.approx(4.0, abs=0.3)


def test_a_vehicle_that_refuses_offboard_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    craft = Craft("position.x")
    refusal = Outcome(Verdict.DENIED, "Offboard denied: not today")
    monkeypatch.setattr(craft.vehicle.commander, "set_mode", lambda *_args, **_options: refusal)
    with pytest.raises(LinkError, match="mode offboard: refused by the vehicle: Offboard denied: not today"):
        craft.conduct()
    assert not craft.vehicle.commander.armed


def test_a_step_that_would_lead_into_the_ground_is_not_begun() -> None:
    craft = Craft("velocity.z", hold_s=5.5)
    with pytest.raises(LinkError, match=r"it would come down to 0\.5 m: begin higher"):
        craft.conduct()
    assert not craft.vehicle.commander.armed


def test_a_place_beyond_the_fence_ends_the_experiment_on_the_ground() -> None:
    craft = Craft("position.x", vehicle=Vehicle(load_vehicle("yawsitter"), overrides={"GF_MAX_VER_DIST": 1.5}))
    with pytest.raises(
        LinkError, match="the vehicle left Offboard mode for hold: offboard target lies outside the fence"
    ):
        craft.conduct()


def test_a_parameter_file_without_gains_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "some.param"
    path.write_text("MPC_XY_CRUISE 3\n")
    with pytest.raises(ConfigError, match="none of the 36 gains"):
        gain_sets.load(str(path))
    path.write_text("MPC_XY_CRUISE 3\nPOS_X_P 2\n")
    assert gain_sets.load(str(path)) == GainSet("some", {"POS_X_P": 2.0})
