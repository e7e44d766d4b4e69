"""The `gcs` command line: fly missions, read and write parameters, command and watch a vehicle over MAVLink."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

DESCRIPTION = """\
A small ground station: talks MAVLink over UDP to a running vehicle (start one with `sitl run`).

connections (--connect):
  udpin:127.0.0.1:14550     listen where the vehicle sends to ground stations (the default)
  udpin:127.0.0.1:14540     listen where instance 0 sends to onboard computers
  udpout:127.0.0.1:18570    call instance 0's ground-station port; leaves 14550 to another program
"""

EXAMPLES = """\
examples:
  gcs watch
  gcs fly missions/rectangle.yaml
  gcs takeoff --height 3 --wait && gcs land --wait
  gcs param set RATE_Y_P 0.4
  gcs tune step position.x --gains paper --against tuned
  gcs tune auto all --vehicle yawsitter-real --out found.yaml
  gcs watch --signing-key flight.key                    a vehicle that was started with the same key
  gcs param list --impair loss=0.2,dup=0.05,jitter=0.1  over a bad link
  gcs COMMAND --help explains each

exit status: 0 done, 1 the vehicle refused or was lost, 2 the request itself can't be used, 130 interrupted.
"""

_MISSION = "a mission: .yaml, .plan (QGroundControl) or .waypoints (QGC WPL)"
_SIGNING = "sign with this key: 32 bytes, or 64 hexadecimal digits"
MODES = ("position", "takeoff", "hold", "mission", "return", "land", "offboard")


class _Parser(argparse.ArgumentParser):
    """Answers a mistake with one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _connection(text: str) -> Any:
    from gcs_tools.link import parse_connection

    try:
        return parse_connection(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _impairment(text: str) -> Any:
    from gcs_tools import impairment

    try:
        return impairment.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _key(text: str) -> bytes:
    from sitl.mavlink.signing import KeyFileError, read_key

    try:
        return read_key(Path(text))
    except KeyFileError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _home(text: str) -> Any:
    from gcs_tools.plan import Home

    try:
        home = Home(*map(_number, text.split(",")))
    except (TypeError, argparse.ArgumentTypeError):
        home = None
    if home is None or abs(home.lat_deg) > 90.0 or abs(home.lon_deg) > 180.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not LAT,LON,ALT (degrees, metres above mean sea level)")
    return home


def _number(text: str) -> float:
    import math

    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{text}' is not a finite number")
    return value


def _positive(text: str) -> float:
    value = _number(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"'{text}' must be above 0")
    return value


def _system(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 255:
        raise argparse.ArgumentTypeError(f"'{text}' is not a system id (1 to 255)")
    return int(text)


def _instance(text: str) -> int:
    if not text.isdecimal() or int(text) > 254:
        raise argparse.ArgumentTypeError(f"'{text}' is not an instance (0 to 254)")
    return int(text)


def _port(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"'{text}' is not a port (1 to 65535)")
    return int(text)


def parser() -> argparse.ArgumentParser:
    link = argparse.ArgumentParser(add_help=False)
    link.add_argument(
        "--connect",
        type=_connection,
        default="udpin:127.0.0.1:14550",
        metavar="udpin|udpout:HOST:PORT",
        help="where the vehicle is (udpin:127.0.0.1:14550)",
    )
    link.add_argument("--system", type=_system, metavar="ID", help="talk to this system id (the first one heard)")

    link.add_argument("--signing-key", type=_key, metavar="FILE", help=_SIGNING)
    link.add_argument(
        "--impair",
        type=_impairment,
        default="seed=1",
        metavar="loss=P,dup=P,jitter=S,seed=N",
        help="make the link worse, both ways: shares lost and doubled, delays up to S seconds",
    )

    top = _Parser(prog="gcs", description=DESCRIPTION, epilog=EXAMPLES, formatter_class=_Raw, allow_abbrev=False)
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)

    def add(group: Any, name: str, short: str, examples: str = "") -> argparse.ArgumentParser:
        epilog = f"examples:\n{examples}" if examples else None
        made: argparse.ArgumentParser = group.add_parser(
            name, help=short, description=short, epilog=epilog, parents=[link], formatter_class=_Raw, allow_abbrev=False
        )
        return made

    fly = add(
        commands,
        "fly",
        "fly a mission and print its error table",
        "  gcs fly missions/rectangle.yaml\n"
        "  gcs fly missions/circle.yaml --connect udpin:127.0.0.1:14540 --json\n"
        "  gcs fly field.plan --out out/field",
    )
    fly.add_argument("mission", type=Path, metavar="MISSION", help=_MISSION)
    fly.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    fly.add_argument("--out", type=Path, metavar="DIR", help="write result.json, track.csv and flight.tlog here")

    plan = commands.add_parser(
        "plan",
        help="check a mission, print its timeline, convert it",
        description="Check a mission and print its timeline; with --to write it in another format. Needs no vehicle.",
        epilog="examples:\n  gcs plan missions/rectangle-mission.yaml\n  gcs plan field.plan --to field.waypoints\n"
        "  gcs plan missions/rectangle-mission.yaml --home 55.6985,37.3595,190 --to field.plan",
        formatter_class=_Raw,
        allow_abbrev=False,
    )
    plan.add_argument("mission", type=Path, metavar="FILE", help=".yaml, .plan (QGroundControl), .waypoints (QGC WPL)")
    plan.add_argument("--to", type=Path, metavar="FILE", help="write it here, in the format of the ending")
    plan.add_argument(
        "--home", type=_home, metavar="LAT,LON,ALT", help="where the vehicle will stand (the file's own): deg, m AMSL"
    )

    report = commands.add_parser(
        "report",
        help="a flight's report from its log",
        description="A flight's report from its log: tables, plots and events as one HTML page, its numbers as JSON\n"
        "beside it. Needs no vehicle.",
        epilog="examples:\n  gcs report flight.tlog\n  gcs report logs/flight.mcap --out reports\n"
        "  gcs report flight.tlog --mission missions/rectangle.yaml --out rectangle.html",
        formatter_class=_Raw,
        allow_abbrev=False,
    )
    report.add_argument(
        "log", type=Path, metavar="LOG", help=".tlog of any ground station or `sitl run --record`, or its .mcap"
    )
    report.add_argument("--mission", type=Path, metavar="FILE", help="measure against this mission, which was flown")
    report.add_argument("--flight", type=int, metavar="N", help="which flight of the log, from 1 (the longest)")
    report.add_argument("--system", type=_system, metavar="ID", help="which vehicle of the log (the first one heard)")
    report.add_argument(
        "--out", type=Path, metavar="DIR|FILE", help="folder, or file ending in .html (LOG.html beside the log)"
    )
    report.add_argument("--json", action="store_true", help="print the numbers as one JSON object")

    param = commands.add_parser("param", help="list, read, write, save and load parameters", formatter_class=_Raw)
    actions = param.add_subparsers(dest="action", required=True, metavar="ACTION", parser_class=_Parser)
    listing = add(actions, "list", "list parameters", "  gcs param list\n  gcs param list RATE_ --json")
    listing.add_argument("prefix", nargs="?", default="", metavar="PREFIX", help="only names that start so")
    listing.add_argument("--json", action="store_true", help="print one JSON object")
    get = add(actions, "get", "print one parameter", "  gcs param get RATE_Y_P")
    get.add_argument("name", metavar="NAME")
    put = add(actions, "set", "write one parameter", "  gcs param set RATE_Y_P 0.4\n  gcs param set SIM_SPEED 5")
    put.add_argument("name", metavar="NAME")
    put.add_argument("value", type=_number, metavar="VALUE")
    for name, short, examples in (
        ("save", "write all parameters to a YAML file", "  gcs param save mine.yaml"),
        ("load", "write a file's values that differ: YAML, gains file, .param", _LOADS),
    ):
        add(actions, name, short, examples).add_argument("file", type=Path, metavar="FILE")

    log = commands.add_parser("log", help="list, fetch and erase recorded flights", formatter_class=_Raw)
    actions = log.add_subparsers(dest="action", required=True, metavar="ACTION", parser_class=_Parser)
    listing = add(actions, "list", "list the vehicle's logs", "  gcs log list --json")
    listing.add_argument("--json", action="store_true", help="print one JSON array")
    get = add(
        actions, "get", "fetch logs, going on with what was broken off", "  gcs log get\n  gcs log get all --out logs"
    )
    get.add_argument(
        "log",
        nargs="?",
        default="latest",
        metavar="LOG",
        help="a number, the begin of names, all (the latest flight's)",
    )
    get.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="where to (here)")
    add(actions, "erase", "erase all of the vehicle's logs", "  gcs log erase")

    from gcs_tools.tune import command as tune

    tune.add(commands, link, _Parser)

    for name, short in (("arm", "arm the motors"), ("disarm", "disarm the motors")):
        force = add(commands, name, short, f"  gcs {name}")
        force.add_argument("--force", action="store_true", help="even if checks or the air stand against it")
    takeoff = add(commands, "takeoff", "arm if need be, climb and hover", "  gcs takeoff --height 3 --wait")
    takeoff.add_argument("--height", type=_positive, metavar="M", help="above home (the vehicle's MIS_TAKEOFF_ALT)")
    for name, short in (("land", "land where it is"), ("return", "return home and land")):
        add(commands, name, short, f"  gcs {name} --wait").add_argument("--wait", action="store_true", help=_WAIT_DOWN)
    takeoff.add_argument("--wait", action="store_true", help="until it hovers")
    add(commands, "hold", "stop and hover here", "  gcs hold")
    mode = add(commands, "mode", "switch to a mode", "  gcs mode mission")
    mode.add_argument("mode", choices=MODES)
    watch = add(commands, "watch", "show vehicles live: a dashboard on a terminal, lines elsewhere", _WATCHES)
    watch.add_argument("--for", dest="seconds", type=_positive, metavar="S", help="stop after so long")

    view = commands.add_parser(
        "view",
        help="show vehicles and recorded flights on a web page",
        description="Serve a web page on which vehicles are seen flying, fed by their Zenoh telemetry, or a recorded\n"
        "flight (.mcap of `sitl run --record`) is played back. Until Ctrl-C. Needs pip install 'yawsitter-sitl[view]'.",
        epilog="examples:\n  gcs view\n  gcs view --instance 0 --instance 1\n"
        "  gcs view --connect tcp/127.0.0.1:7450 --port 8081\n  gcs view logs/flight.mcap",
        formatter_class=_Raw,
        allow_abbrev=False,
    )
    view.add_argument("file", type=Path, nargs="?", metavar="FILE.mcap", help="play this recording back")
    view.add_argument(
        "--connect",
        action="append",
        metavar="ENDPOINT",
        help="a vehicle's Zenoh endpoint, may be repeated (tcp/127.0.0.1:7447 plus the instance)",
    )
    view.add_argument(
        "--instance", action="append", type=_instance, metavar="N", help="show this vehicle, may be repeated (0)"
    )
    view.add_argument(
        "--mavlink",
        type=_connection,
        default="udpout:127.0.0.1:18570",
        metavar="udpin|udpout:HOST:PORT",
        help="where instance 0 is commanded; ports go up with the instances (udpout:127.0.0.1:18570)",
    )
    view.add_argument("--signing-key", type=_key, metavar="FILE", help=_SIGNING)
    view.add_argument(
        "--mission",
        action="append",
        type=Path,
        default=[],
        metavar="FILE",
        help="offer this mission, beside those in missions/; may be repeated",
    )
    view.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help="serve here (127.0.0.1: this machine)")
    view.add_argument("--port", type=_port, default=8080, metavar="PORT", help="serve here (8080)")
    return top


_WATCHES = (
    "  gcs watch\n  gcs watch --system 3 --connect udpout:127.0.0.1:18300     a swarm, this one of it in full\n"
    "  gcs watch --for 10 | tee flight.txt\n\nkeys: q quits, space pauses drawing, arrows and 1 to 9 choose a vehicle"
)
_WAIT_DOWN = "until it stands disarmed"
_LOADS = "  gcs param load mine.yaml\n  gcs param load sitl/gains/tuned.yaml\n  gcs param load qgroundcontrol.params"
_Raw = argparse.RawDescriptionHelpFormatter


def main(argv: Sequence[str] | None = None) -> int:
    try:
        return _run(argv)
    except KeyboardInterrupt:  # wherever it comes, while modules are loaded too
        return 130


def _run(argv: Sequence[str] | None) -> int:
    args = parser().parse_args(argv)
    from gcs_tools import tasks
    from gcs_tools.client import LinkError
    from sitl.strict_yaml import ConfigError

    name = f"gcs {args.command}"
    try:
        tasks.run(args)
    except ConfigError as error:
        return _complain(name, error, 2)
    except LinkError as error:
        return _complain(name, error, 1)
    except BrokenPipeError:
        sys.stderr.close()  # whoever read our output has gone
        return 1
    except OSError as error:
        return _complain(name, f"{error.filename}: {error.strerror}" if error.filename else error, 2)
    return 0


def _complain(name: str, error: object, code: int) -> int:
    print(f"{name}: {error}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
