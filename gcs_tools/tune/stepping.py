"""`gcs tune step`: from the parsed arguments to what is printed."""

import argparse
import importlib.util
import json
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from gcs_tools.client import Client, LinkError
from gcs_tools.link import UdpLink, signer
from gcs_tools.tune import analysis, gain_sets, loops, output
from gcs_tools.tune.analysis import Analysed
from gcs_tools.tune.experiment import Experiment
from gcs_tools.tune.response import TooFewSamplesError
from gcs_tools.tune.session import InProcess, Link, conduct
from sitl.strict_yaml import ConfigError
from sitl.vehicle import Vehicle, load_vehicle


def run(args: argparse.Namespace) -> None:
    """Raises ConfigError for what can't be used, LinkError where it could not be flown, KeyboardInterrupt."""
    if args.plot is not None:
        check_plot(args.plot)
    loop, kind = args.loop, args.loop.kind
    size = kind.size if args.size is None else args.size
    hold_s = kind.hold_s if args.hold is None else args.hold
    excitation = (loops.doublet if args.doublet else loops.step)(size, hold_s)
    sets = [gain_sets.load(text) for text in (args.gains, args.against) if text is not None]
    vehicle = in_process(args)
    client = Client() if vehicle else Client(args.system, signer(args.signing_key) if args.signing_key else None)
    experiment = Experiment(client, loop, excitation, sets, repeat=args.repeat, height_m=args.height)
    with _terminated_as_interrupted(), _opened(args, experiment, vehicle) as link:
        trials = conduct(experiment, link, quiet=args.json)
    band = 0.01 * args.band
    try:
        analysed = [analysis.analyse(trial, excitation, band) for trial in trials]
    except TooFewSamplesError as error:
        raise LinkError(str(error)) from None
    name = client.vehicle.name
    if args.json:
        print(json.dumps(analysis.result(loop, excitation, name, analysed, band)))
    else:
        output.show(loop, excitation, name, analysed, band)
        print(_rate(analysed, vehicle is not None))
    if args.plot is not None and any(one.record is not None for one in analysed):
        output.plot(args.plot, loop, excitation, analysed, name)
    lost = [trial for trial in trials if trial.fault]
    if lost:
        raise LinkError("; ".join(f"gains {trial.name}: {trial.fault}" for trial in lost))


def check_plot(path: Path) -> None:
    """Before anything is flown. Raises ConfigError."""
    if path.suffix.lower() != ".png":
        raise ConfigError(f"--plot {path}: the figure is a .png")
    if not path.parent.is_dir():
        raise ConfigError(f"--plot {path}: there is no folder {path.parent}")
    if importlib.util.find_spec("matplotlib") is None:
        raise ConfigError("--plot needs matplotlib: pip install 'yawsitter-sitl[tune]'")


def in_process(args: argparse.Namespace) -> Vehicle | None:
    """The vehicle to fly in lockstep, if one is named. Raises ConfigError."""
    if args.vehicle is None:
        given = [f"--{name}" for name in ("wind", "gust", "seed", "set") if getattr(args, name) is not None]
        if given:
            raise ConfigError(f"{given[0]} goes with --vehicle: a vehicle over the link has its own air and parameters")
        return None
    return Vehicle(
        load_vehicle(args.vehicle),
        wind_N=args.wind or (0.0, 0.0, 0.0),
        gust_m_s=args.gust or 0.0,
        seed=1 if args.seed is None else args.seed,
        overrides=dict(args.set or ()),
    )


@contextmanager
def _opened(args: argparse.Namespace, experiment: Experiment, vehicle: Vehicle | None) -> Iterator[Link]:
    if vehicle is not None:
        yield InProcess(vehicle, lambda: experiment.recording)
        return
    with UdpLink(args.connect, args.impair) as link:
        yield link


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """SIGTERM leaves the vehicle in order too, as Ctrl-C does."""

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _rate(analysed: list[Analysed], every_step: bool) -> str:
    records = [one.record for one in analysed if one.record is not None]
    if not records:
        return "nothing was recorded"
    told = f"recorded at {records[0].rate_Hz:.0f} Hz of the vehicle's time"
    if every_step:
        return f"{told}: every control step"
    if any(one.coarse for one in analysed):
        print(
            "warning: fewer than 10 samples in the rise: its figures are coarse; fly slower (SIM_SPEED), or in this "
            "process with --vehicle",
            file=sys.stderr,
        )
    return f"{told}: what the link carried"
