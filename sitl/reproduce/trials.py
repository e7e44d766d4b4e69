"""Beyond the paper: what is aimed at, and the flights of `robustness` that measure it.

`python -m sitl.reproduce.trials TRIAL VEHICLE SEED [NAME=VALUE …]` flies one.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

from sitl.daemon import config
from sitl.quaternion import Vec3
from sitl.reproduce import robustness
from sitl.reproduce.cases import MISSIONS, Craft, Values
from sitl.reproduce.robustness import AXES, BODY_AXES, DRIFTS, OBLIQUE_AXES, STILL
from sitl.strict_yaml import ConfigError
from sitl.vehicle import load_vehicle


class Measure(NamedTuple):
    """One of a trial's numbers, and the most that it may be."""

    title: str
    unit: str
    limit: float


class Trial(NamedTuple):
    """fly: (craft, seed) → a number for each measure. gusty: the seed matters though no sensor errs."""

    key: str
    group: str
    title: str
    measures: tuple[Measure, ...]
    fly: Callable[[Craft, int], tuple[float, ...]]
    gusty: bool = False


def _model(key: str, title: str, plant: Values) -> Trial:
    measures = tuple(Measure(f"{mission}, greatest MAE / print", "", 0.5) for mission in MISSIONS)
    return Trial(key, "model error: the controller believes in the airframe file", title, measures,
                 partial(robustness.model_error, plant))  # fmt: skip


def _excursion(limit_m: float) -> tuple[Measure]:
    return (Measure("greatest excursion", "m", limit_m),)


def _rms(limit_m: float) -> tuple[Measure]:
    return (Measure("greatest RMS of an axis", "m", limit_m),)


def _recovery(key: str, title: str, limit_m: float, axes: tuple[Vec3, ...], velocities: tuple[Vec3, ...]) -> Trial:
    fly = partial(robustness.recovery, axes, velocities)
    return Trial(key, "recovery from 30° to 170°", title, _excursion(limit_m), fly)


_WIND = "wind of 2 m/s with 1 m/s of gusts"
_STEPS = "3 m steps of the bare position target"
_STEP = (Measure("overshoot", "%", 5.0), Measure("within 2 % after", "s", 5.0))
TRIALS = (
    _model("air", "air 18 % thinner", (("air_density_kg_m3", 1.0045),)),
    _model("flaps", "flaps 20 % weaker", (("flap_lift_slope", 1.2), ("flap_moment_slope", -0.8))),
    _model("immersion", "60 % of the wing immersed, not 51 %", (("immersed_fraction", 0.6),)),
    Trial("wind-hover", _WIND, "hover", _rms(0.10), robustness.windy_hover, True),
    Trial("wind-rectangle", _WIND, "rectangle", _rms(0.25), robustness.windy_rectangle, True),
    _recovery("recovery-rest", "about each body axis, at rest", 4.0, BODY_AXES, (STILL,)),
    _recovery("recovery-oblique", "about axes between them, at rest", 4.0, OBLIQUE_AXES, (STILL,)),
    _recovery("recovery-drift", "about each body axis, drifting at 5 m/s", 8.0, BODY_AXES, DRIFTS),
    Trial("turn", "turning", "full turn of the heading in hover", _excursion(0.05), robustness.full_turn),
    *(Trial(f"step-{name}", _STEPS, name, _STEP, partial(robustness.step, axis)) for axis, name in enumerate(AXES)),
)


def measure(key: str, craft: Craft, seed: int) -> tuple[float, ...]:
    """The numbers of the trial with this key."""
    return next(trial for trial in TRIALS if trial.key == key).fly(craft, seed)


def erring(craft: Craft) -> bool:
    """Whether a craft flies on an estimate from sensors that err, so that its flights differ from seed to seed."""
    spec = load_vehicle(craft.vehicle)
    estimating = dict(craft.overrides).get("EST_ENABLE", spec.parameters.get("EST_ENABLE", 0.0))
    return bool(estimating > 0.0 and any(spec.sensors))


def command(key: str, craft: Craft, seed: int) -> str:
    """The command line that flies a trial."""
    words = ["python -m sitl.reproduce.trials", key, craft.vehicle, str(seed)]
    return " ".join([*words, *(f"{name}={value:.12g}" for name, value in craft.overrides)])


def main(words: Sequence[str] | None = None) -> int:
    """Fly one trial and print its measures."""
    parser = argparse.ArgumentParser(prog="python -m sitl.reproduce.trials", description=main.__doc__)
    parser.add_argument("trial", choices=[trial.key for trial in TRIALS])
    parser.add_argument("vehicle")
    parser.add_argument("seed", type=int)
    parser.add_argument("settings", nargs="*", type=config.parse_setting, metavar="NAME=VALUE")
    args = parser.parse_args(words)
    measures = next(trial for trial in TRIALS if trial.key == args.trial).measures
    try:
        values = measure(args.trial, Craft(args.vehicle, tuple(args.settings)), args.seed)
    except ConfigError as error:
        parser.error(str(error))
    for told, value in zip(measures, values, strict=True):
        print(f"{args.trial}, {told.title}: {value:.6g} {told.unit}".rstrip())
    return 0


if __name__ == "__main__":
    sys.exit(main())
