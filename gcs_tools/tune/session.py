"""An experiment carried out over a link, UDP or lockstep, with the vehicle left as it was however it ends."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from gcs_tools import link as edge
from gcs_tools import lockstep
from gcs_tools.client import Client, LinkError
from gcs_tools.progress import Progress
from gcs_tools.tune import gain_sets
from gcs_tools.tune.experiment import Experiment, Trial
from sitl.vehicle import Vehicle

LEFT_BEHIND = Path("gains-before-tuning.yaml")  # where the vehicle's gains are kept if they can't be written back
_SHOW_EVERY = 64  # turns in lockstep


class Link(Protocol):
    def run(self, client: Client, each_turn: Callable[[float], None] = ...) -> None:
        """Until the client's script has ended. Raises its fault."""


class InProcess:
    """A vehicle in this process, in lockstep: a turn a control step while `fine` says so."""

    def __init__(self, vehicle: Vehicle, fine: Callable[[], bool]) -> None:
        self._lockstep, self._fine = lockstep.Lockstep(vehicle), fine
        self._step_us = vehicle.step_us

    def run(self, client: Client, each_turn: Callable[[float], None] = lambda _wall_s: None) -> None:
        vehicle, turns = self._lockstep.vehicle, 0
        end_us = vehicle.now_us + int(lockstep.LIMIT_S * 1e6)
        while not client.finished:
            self._lockstep.turn(client, self._step_us if self._fine() else lockstep.TURN_US)
            turns += 1
            if turns % _SHOW_EVERY == 0:
                each_turn(edge.now_s())
            if vehicle.now_us > end_us:
                client.stop(LinkError(f"not done after {lockstep.LIMIT_S:g} s of simulation time"))
        if client.fault is not None:
            raise client.fault


def conduct(experiment: Experiment, link: Link, *, quiet: bool) -> list[Trial]:
    """Run an experiment to its end and return its trials.

    Where it ends early, by a fault or Ctrl-C, the vehicle gets its own gains back before the exception goes on; where
    it can't be reached any more they are written to a file, which the LinkError names.
    """
    client = experiment.client
    client.start(experiment.script())
    with Progress(experiment, quiet=quiet) as progress:
        try:
            link.run(client, progress.update)
        except BaseException as reason:
            _leave(experiment, link, progress, reason)
            raise
    return experiment.trials


def _leave(experiment: Experiment, link: Link, progress: Progress, reason: BaseException) -> None:
    client = experiment.client
    if isinstance(reason, KeyboardInterrupt):
        print("\ninterrupted: putting the vehicle's own gains back", file=sys.stderr)
    client.stop(LinkError("interrupted"))
    if not experiment.own:
        return
    client.start(experiment.leave())
    try:
        link.run(client, progress.update)
    except (LinkError, KeyboardInterrupt) as failure:
        if not experiment.written:
            return
        gain_sets.write(
            LEFT_BEHIND, experiment.own, "The vehicle's own, before an experiment that left others in force"
        )
        raise LinkError(
            f"{reason or 'interrupted'}; its own gains could not be written back ({failure or 'interrupted again'}): "
            f"gcs param load {LEFT_BEHIND}"
        ) from None
