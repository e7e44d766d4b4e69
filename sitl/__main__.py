"""The `sitl` command line: run the vehicle behind its links, fly in lockstep, find a trim, reproduce the paper."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from sitl.campaign import options as campaign
from sitl.daemon import config
from sitl.daemon import options as daemon
from sitl.options import VEHICLES, add_simulation, add_vehicle, reader

FLY = f"""\
Fly a mission: vehicle and client in one process, in lockstep, through the same MAVLink bytes as over UDP, as fast as
the machine can. The same seed and settings give the same flight, bit for bit.

{VEHICLES}"""

FLY_EXAMPLES = """\
examples:
  sitl fly missions/rectangle.yaml
  sitl fly missions/circle.yaml --vehicle yawsitter-real --seed 3
  sitl fly missions/rectangle.yaml --wind 1,0,0 --gust 0.5 --json
  sitl fly missions/hover.yaml --set RATE_Y_P=0.4 --out out/hover
  sitl fly missions/circle.yaml --plant air_density_kg_m3=1.0     in air thinner than the controller believes
  sitl fly plan.plan                               a QGroundControl plan

exit status: 0 when the mission was flown, 1 when it was not, 2 for settings that can't be used.
"""

TRIM = f"""\
Find the steady state of level flight at an airspeed (0: hover): pitch, thrust and flap deflection.

{VEHICLES}"""

TRIM_EXAMPLES = """\
examples:
  sitl trim
  sitl trim --airspeed 5 --json
"""

REPRODUCE = """\
Fly the paper's evaluation in lockstep and write a report: its two error tables and its ranges beside the measured ones,
figures, ablations, the loops' poles and margins in hover, and flights beyond the paper: model errors, wind, recovery,
steps. Takes less than two minutes on two cores; needs matplotlib, which the extra [report] installs.
"""

REPRODUCE_EXAMPLES = """\
examples:
  sitl reproduce                                   everything, into out/reproduce
  sitl reproduce --quick --out /tmp/report         one seed, fewer ablations
  sitl reproduce --json                            also print all numbers

It writes report.html (one file, figures inside), figures/*.svg and *.png, numbers.json, numbers.csv, commands.txt and
flights/*.csv.

exit status: 0 when the report is written, 1 when a flight failed, 2 for settings that can't be used.
"""

_HELP_FLY = "fly a mission in one process and print the error table"
_MISSION = "a mission: .yaml, .plan (QGroundControl) or .waypoints (QGC WPL)"
_HELP_TRIM = "find hover or level-flight trim"
_HELP_REPRODUCE = "fly the paper's evaluation and write a report"


class _Parser(argparse.ArgumentParser):
    """Answers a mistake with one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _airspeed(text: str) -> float:
    return config.parse_number(text, 0.0, 50.0, "m/s")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="sitl",
        description=__doc__,
        epilog="'sitl COMMAND --help' explains each, with examples.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)

    def command(name: str, short: str, long: str, examples: str) -> argparse.ArgumentParser:
        return commands.add_parser(
            name,
            help=short,
            description=long,
            epilog=examples,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )

    daemon.add(command)

    fly = command("fly", _HELP_FLY, FLY, FLY_EXAMPLES)
    fly.add_argument("mission", type=Path, metavar="MISSION", help=_MISSION)
    add_vehicle(fly)
    add_simulation(fly, "max")
    for option, whose in (("--plant", "the vehicle that flies"), ("--believed", "what the controller takes it to be")):
        fly.add_argument(
            option,
            type=reader(config.parse_airframe),
            default=[],
            action="append",
            metavar="NAME=VALUE",
            help=f"change an airframe number of {whose}; may be given again",
        )
    fly.add_argument(
        "--heading",
        type=reader(config.parse_heading),
        default=0.0,
        metavar="DEG",
        help="where the belly faces at the start, degrees from north towards east (0)",
    )
    fly.add_argument("--out", type=Path, metavar="DIR", help="write the flight's logs and figures here")
    fly.add_argument("--json", action="store_true", help="print one JSON object")

    trim = command("trim", _HELP_TRIM, TRIM, TRIM_EXAMPLES)
    add_vehicle(trim)
    trim.add_argument(
        "--airspeed", type=reader(_airspeed), default=0.0, metavar="M_S", help="of level flight, m/s (0: hover)"
    )
    trim.add_argument("--json", action="store_true", help="print one JSON object")

    reproduce = command("reproduce", _HELP_REPRODUCE, REPRODUCE, REPRODUCE_EXAMPLES)
    reproduce.add_argument(
        "--out", type=Path, default=Path("out/reproduce"), metavar="DIR", help="the report's folder (out/reproduce)"
    )
    reproduce.add_argument("--quick", action="store_true", help="one seed, ablations with the default vehicle only")
    reproduce.add_argument("--json", action="store_true", help="print all numbers as one JSON object")

    campaign.add(command)
    return parser


def _run(args: argparse.Namespace) -> int:
    from sitl.daemon import main

    return main.main(daemon.run_setup(args), verbose=args.verbose)


def _swarm(args: argparse.Namespace) -> int:
    from sitl.daemon import main

    return main.main(daemon.swarm_setup(args), verbose=args.verbose)


def _fly(args: argparse.Namespace) -> int:
    from gcs_tools import lockstep

    return int(lockstep.main(args) or 0)


def _trim(args: argparse.Namespace) -> int:
    from sitl.model import trim
    from sitl.vehicle_spec import load_vehicle

    return trim.main(args, load_vehicle(args.vehicle).airframe.airframe)


def _reproduce(args: argparse.Namespace) -> int:
    from sitl.reproduce import main as reproduction

    return reproduction.main(args)


def _campaign(args: argparse.Namespace) -> int:
    from sitl.campaign import main as campaigns

    return campaigns.main(args)


def _dataset(args: argparse.Namespace) -> int:
    from sitl.campaign import dataset

    return dataset.main(args)


def _is_mistake(error: ValueError) -> bool:
    """Whether the person at the keyboard can mend it; files that can't be used say so with a ConfigError."""
    from sitl.strict_yaml import ConfigError

    return isinstance(error, config.SettingError | ConfigError)


def main(argv: Sequence[str] | None = None) -> int:
    args = _parser().parse_args(argv)
    commands = {
        "run": _run,
        "swarm": _swarm,
        "fly": _fly,
        "trim": _trim,
        "reproduce": _reproduce,
        "campaign": _campaign,
        "dataset": _dataset,
    }
    try:
        return commands[args.command](args)
    except ValueError as error:
        if not _is_mistake(error):
            raise
        print(f"sitl {args.command}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
