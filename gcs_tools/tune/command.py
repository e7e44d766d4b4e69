"""`gcs tune` on the command line. No heavy imports: what a command needs is imported when it runs."""

import argparse
import math
from pathlib import Path
from typing import Any

STEP = """\
Excite one loop of a vehicle in Offboard flight with a step (out and back) or a doublet, record what it does, and print
what a control engineer reads off it. With --against the same again with other gains, side by side.

Over a link (--connect) the vehicle may stand disarmed: it takes off, climbs 10 m, and lands at the end. Or it may
hover: it is taken over where it is and left in Hold. With --vehicle it is flown in this process, in lockstep, as
`sitl fly` does. The vehicle's own gains are back in force at the end, also after Ctrl-C or a lost link.

loops (LOOP):
  position.x|y|z        m      north, east, down: SET_POSITION_TARGET_LOCAL_NED, nothing fed forward
  velocity.x|y|z        m/s    the same, the other axes held in place
  attitude.phi|theta|psi deg   SET_ATTITUDE_TARGET; the paper's angles, each about its body axis in hover
  rate.p|q|r            deg/s  the same with body rates

gains (--gains, --against): own (the vehicle's, the default), paper, tuned, a gains file, or a parameter file
(.yaml of `gcs param save`, .param), of which only the 36 gains count.

Recorded is every control step in this process, and what the link carries elsewhere: 250 samples a second of a vehicle
in real time, fewer at a higher speed. The rate is told. docs/tune.md says how each figure is made.
"""

STEP_EXAMPLES = """\
examples:
  gcs tune step position.x --vehicle yawsitter-real
  gcs tune step position.x --vehicle yawsitter --gains paper --against tuned --plot step.png
  gcs tune step attitude.theta --doublet --size 5 --connect udpout:127.0.0.1:14580
  gcs tune step rate.q --vehicle yawsitter-real --repeat 4 --json

exit status: 0 flown; 1 the vehicle refused, was lost, or could not be flown with a set of gains; 2 for what can't be
used; 130 interrupted.
"""


AUTO = """\
Search for the gains of one loop, of some, or of all, by CMA-ES over flights in this process, several at a time.

    gcs tune auto LOOP…    steps on these loops, one manoeuvre each
    gcs tune auto all      steps on position.x, .y and .z, and a tour of 21 s followed with feed-forward (--course:
                           other missions instead); they shake the inner loops too

The cost of a flight is tracking + overshoot + effort, each about 1 where it goes well:
  step    ∫|e| dt / (size × the loop's time: 1 s position, 0.4 velocity, 0.15 attitude, 0.05 rate)
          + overshoot / 10 % + Σ|du/dt| / 5 per s (motors 0 … 1, flaps −1 … 1)
  course  mean distance / 1 cm + greatest distance / 10 cm + the same effort
A manoeuvre costs what its worst flight does, one for each seed of gusts and noise; gains cost the mean of the
manoeuvres. A flight that fails costs 1000 to 2000, more than any that succeeds.

Sought are the gains that are not 0 (--terms: these terms), on a logarithmic scale up to their declared maximum; a
ten-thousandth of it counts as 0. The same seed finds the same gains with any number of workers. Whenever something
better is found the file is written, so Ctrl-C keeps the best so far; --from goes on from it.
"""

AUTO_EXAMPLES = """\
examples:
  gcs tune auto position.x --from paper
  gcs tune auto all --vehicle yawsitter-real --budget 600 --out found.yaml
  gcs tune auto rate.q attitude.theta --vehicle yawsitter-real --terms PI
  gcs tune auto all --course missions/rectangle.yaml --course missions/circle.yaml --wind 1,0,0
  sitl run --gains found.yaml;  gcs param load found.yaml     use what was found

exit status: 0 searched (a file is written only if it is better than the start); 2 for what can't be used; 130
interrupted, with the best so far kept.
"""


class Raw(argparse.RawDescriptionHelpFormatter):
    pass


def _loop(text: str) -> Any:
    from gcs_tools.tune import loops

    try:
        return loops.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _loops(text: str) -> str:
    return text if text == "all" else str(_loop(text).name)


def _terms(text: str) -> str:
    if not text or set(text.upper()) - set("PID"):
        raise argparse.ArgumentTypeError(f"'{text}' is not some of the letters P, I, D")
    return text.upper()


def number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{text}' is not a finite number")
    return value


def within(low: float, high: float) -> Any:
    def read(text: str) -> float:
        value = number(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is outside {low:g} to {high:g}")
        return value

    return read


def whole(low: int, high: int) -> Any:
    def read(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from {low} to {high}")
        return int(text)

    return read


def _size(text: str) -> float:
    value = number(text)
    if value == 0.0:
        raise argparse.ArgumentTypeError("a step of 0 is none")
    return value


def _wind(text: str) -> tuple[float, float, float]:
    parts = text.split(",")
    if len(parts) != 3:
        raise argparse.ArgumentTypeError(f"'{text}' is not N,E,D (3 numbers with commas between)")
    north, east, down = map(within(-30.0, 30.0), parts)
    return north, east, down


def _setting(text: str) -> tuple[str, float]:
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=VALUE")
    return name.upper(), number(value)


def add(commands: Any, link: argparse.ArgumentParser, parser_class: type[argparse.ArgumentParser]) -> None:
    """`tune` and its actions, below the commands of `gcs`. link: the options of a connection."""
    tune = commands.add_parser("tune", help="step a loop and measure it, compare gains, search for gains")
    actions = tune.add_subparsers(dest="action", required=True, metavar="ACTION", parser_class=parser_class)
    step = actions.add_parser(
        "step",
        help="a step or doublet on one loop, measured; two sets of gains side by side",
        description=STEP,
        epilog=STEP_EXAMPLES,
        parents=[link],
        formatter_class=Raw,
        allow_abbrev=False,
    )
    step.add_argument("loop", type=_loop, metavar="LOOP", help="position.x, velocity.z, attitude.theta, rate.p …")
    step.add_argument("--size", type=_size, metavar="S", help="in the loop's unit (1 m, 1 m/s, 10 deg, 20 deg/s)")
    step.add_argument("--hold", type=within(0.1, 60.0), metavar="S", help="how long a level lasts (8, 4, 2, 0.8 s)")
    step.add_argument("--doublet", action="store_true", help="out, over to the other side, and back")
    step.add_argument("--repeat", type=whole(1, 50), default=1, metavar="N", help="so many times, and take means (1)")
    step.add_argument("--gains", default="own", metavar="NAME|FILE", help="fly with these (own)")
    step.add_argument("--against", metavar="NAME|FILE", help="and then with these, and tell the difference")
    step.add_argument("--band", type=within(0.1, 50.0), default=2.0, metavar="%", help="of settling, of the step (2)")
    step.add_argument("--height", type=within(3.0, 100.0), default=10.0, metavar="M", help="to climb to (10)")
    step.add_argument("--plot", type=Path, metavar="FILE.png", help="draw it; needs the extra [tune]")
    step.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    _add_air(step, None, "fly this one in lockstep in this process, instead of one over the link")

    auto = actions.add_parser(
        "auto",
        help="search for gains with CMA-ES, write a gains file",
        description=AUTO,
        epilog=AUTO_EXAMPLES,
        formatter_class=Raw,
        allow_abbrev=False,
    )
    auto.add_argument("loops", type=_loops, nargs="+", metavar="LOOP|all", help="whose gains are sought")
    auto.add_argument("--from", dest="begin", default="own", metavar="NAME|FILE", help="where to begin (own)")
    auto.add_argument("--terms", type=_terms, metavar="PID", help="seek these terms (those that are not 0)")
    auto.add_argument("--course", type=Path, action="append", metavar="FILE", help="fly this mission too; may repeat")
    auto.add_argument("--seeds", type=whole(1, 100), default=2, metavar="N", help="flights of each manoeuvre (2)")
    auto.add_argument("--budget", type=whole(1, 10**6), default=300, metavar="N", help="candidates to judge (300)")
    auto.add_argument("--workers", type=whole(1, 1024), metavar="N", help="processes (one a core)")
    auto.add_argument("--out", type=Path, default=Path("found.yaml"), metavar="FILE", help="(found.yaml)")
    auto.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    _add_air(auto, "yawsitter", "whose gains (yawsitter)", gust="(0.5)", seed="of the search (1)")
    auto.set_defaults(seed=1)


def _add_air(
    parser: argparse.ArgumentParser,
    vehicle: str | None,
    what: str,
    gust: str = "(0)",
    seed: str = "of gusts and sensor noise (1)",
) -> None:
    group = parser.add_argument_group("in this process")
    group.add_argument("--vehicle", default=vehicle, metavar="NAME|FILE", help=what)
    group.add_argument("--wind", type=_wind, metavar="N,E,D", help="where the air moves, m/s (0,0,0)")
    group.add_argument("--gust", type=within(0.0, 10.0), metavar="M_S", help=f"standard deviation of turbulence {gust}")
    group.add_argument("--seed", type=whole(0, 2**32 - 1), metavar="N", help=seed)
    group.add_argument(
        "--set", type=_setting, action="append", metavar="NAME=VALUE", help="set a parameter; may be given again"
    )


def run(args: argparse.Namespace) -> None:
    """Raises ConfigError, LinkError, OSError, KeyboardInterrupt."""
    if args.action == "step":
        from gcs_tools.tune import stepping

        stepping.run(args)
    else:
        from gcs_tools.tune import auto

        auto.run(args)
