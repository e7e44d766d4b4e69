"""The `sitl` command line: run the vehicle behind its links, fly in lockstep, find a trim, reproduce the paper."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn, TypeVar

from sitl.campaign import options
from sitl.daemon import config, swarm

T = TypeVar("T")

_IN_STATE = Path()  # --record without a folder

VEHICLES = """\
vehicles:
  yawsitter         the paper's gains, ideal actuators and sensors, 500 Hz (default)
  yawsitter-real    motor and flap lag, sensor noise, retuned gains
  FILE.yaml         your own: airframe, gains, actuators and sensors
"""

RUN = f"""\
Run one vehicle: it is simulated in real time and spoken to over MAVLink (UDP) and Zenoh, until Ctrl-C.

Instance I (default 0) uses, like PX4's simulator:
  UDP 18570+I  for ground stations, sending to 127.0.0.1:14550 from the start (QGroundControl finds it by itself)
  UDP 14580+I  for onboard computers, sending to 127.0.0.1:14540+I from the start (MAVSDK's default is 14540);
               all instances from 9 on send to 14549, and are told apart by their system ids
  UDP 19450+I  with --hil-viewer, sending the true state to 127.0.0.1:19410+I (instances 0 to 39)
  TCP 7447+I   Zenoh telemetry, keys yawsitter/I/... (docs/telemetry.md)
Whoever writes to a UDP port is served too. The MAVLink system id is I+1. Everything listens on this machine only,
unless --listen says otherwise. Each vehicle needs a state folder of its own.

{VEHICLES}"""

RUN_EXAMPLES = """\
examples:
  sitl run                                         the default vehicle in real time
  sitl run --vehicle yawsitter-real --speed 10     ten times real time
  sitl run --speed max --no-zenoh                  as fast as the machine can
  sitl run --home 47.3977,8.5456,488,90            latitude, longitude, altitude AMSL [m], heading [deg]
  sitl run --wind 1,0,0 --gust 0.5 --seed 7        air moving north at 1 m/s, with gusts
  sitl run --listen 0.0.0.0 --gcs 192.168.1.20:14550    a ground station on another machine
  sitl run --set RATE_Y_P=0.4 --set SIM_TLM_RATE=100    parameters, as if written over the link
  sitl run --gains found.yaml                      the gains that 'gcs tune auto' has found
  sitl run --hil-viewer                            shown by a viewer made for PX4's simulation in hardware
  sitl run --record                                every flight kept as .tlog and .mcap (`gcs log list` shows them)
  sitl run --instance 1 --record logs              a second vehicle, its flights kept in the folder logs

While it runs, the parameters SIM_SPEED (0: as fast as possible), SIM_PAUSE and SIM_STEP_MS (run so many milliseconds
while paused) change its pace, and SIM_WIND_N, SIM_WIND_E, SIM_WIND_D and SIM_GUST the air.

exit status: 0 after Ctrl-C, SIGTERM or a shutdown command; 2 for settings that can't be used.
"""

SWARM = f"""\
Run N vehicles in one process, on one clock, until Ctrl-C. Each is a MAVLink system as `sitl run` makes it: vehicle k
has the ports, system id and state folder of instance I+k, and flies as it would alone with the same seed (S+k).

  UDP 18300+I      all of them on one port, sending to 127.0.0.1:14550 from the start: a ground station there sees the
                   whole swarm. What is sent to this port goes to the vehicle that it names, or to all if it names none
  UDP 18570+I+k    vehicle k alone, for whoever calls
  UDP 14580+I+k    vehicle k for onboard computers, heartbeating to 127.0.0.1:14540+I+k (14549 at most); streams to
                   whoever answers
  TCP 7447+I       one Zenoh session with the keys yawsitter/I/... to yawsitter/I+N-1/...

{VEHICLES}"""

SWARM_EXAMPLES = """\
examples:
  sitl swarm 9                                     nine vehicles on a grid, three metres apart
  sitl swarm 50 --vehicle yawsitter-real --rate 5  fifty, with five messages a second of each stream
  sitl swarm 9 --formation examples/formations/v.yaml
  sitl swarm 4 --instance 20 --speed max --no-zenoh
  gcs fly missions/rectangle.yaml --system 3       the third of them flies (in another terminal)
  python examples/formation.py v                   all of them fly in formation

SIM_SPEED, SIM_PAUSE and SIM_STEP_MS, set on any vehicle, change the pace of all. A vehicle that is told to reboot
starts again by itself; one that is told to shut down is switched off while the others go on.

exit status: 0 after Ctrl-C, SIGTERM or the last vehicle's shutdown; 2 for settings that can't be used.
"""

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

_HELP_RUN = "run a vehicle behind MAVLink and Zenoh, in real time or faster"
_HELP_SWARM = "run many vehicles in one process, on one port and on ports of their own"
_HELP_FLY = "fly a mission in one process and print the error table"
_HELP_TRIM = "find hover or level-flight trim"
_HELP_REPRODUCE = "fly the paper's evaluation and write a report"


class _Parser(argparse.ArgumentParser):
    """Answers a mistake with one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _reader(parse: Callable[[str], T]) -> Callable[[str], T]:
    """`parse` as an argparse type: its refusal becomes argparse's."""

    def read(text: str) -> T:
        try:
            return parse(text)
        except config.SettingError as refusal:
            raise argparse.ArgumentTypeError(str(refusal)) from None

    return read


def _airspeed(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 50.0:
        raise config.SettingError(f"'{text}' is not a speed from 0 to 50 m/s")
    return value


def _add_vehicle(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--vehicle", default="yawsitter", metavar="NAME|FILE", help="which vehicle (yawsitter)")


def _add_simulation(parser: argparse.ArgumentParser, speed: str) -> None:
    parser.add_argument(
        "--speed",
        type=_reader(config.parse_speed),
        default=config.parse_speed(speed),
        metavar="FACTOR|max",
        help=f"of real time, or max: as fast as possible ({speed})",
    )
    parser.add_argument(
        "--wind",
        type=_reader(config.parse_wind),
        default=(0.0, 0.0, 0.0),
        metavar="N,E,D",
        help="where the air moves, m/s north, east, down (0,0,0)",
    )
    parser.add_argument(
        "--gust",
        type=_reader(config.parse_gust),
        default=0.0,
        metavar="M_S",
        help="standard deviation of turbulence, m/s (0)",
    )
    parser.add_argument(
        "--seed",
        type=_reader(config.parse_seed),
        default=1,
        metavar="N",
        help="of gusts and sensor noise (1)",
    )
    parser.add_argument(
        "--gains",
        metavar="NAME|FILE",
        help="fly with these gains instead of the vehicle's: paper, tuned, or a YAML file",
    )
    parser.add_argument(
        "--set",
        type=_reader(config.parse_setting),
        default=[],
        action="append",
        metavar="NAME=VALUE",
        help="set a parameter; may be given again",
    )


def _add_daemon(parser: argparse.ArgumentParser) -> None:
    """What `sitl run` and `sitl swarm` have in common."""
    _add_vehicle(parser)
    parser.add_argument(
        "--instance",
        type=_reader(config.parse_instance),
        default=0,
        metavar="I",
        help="its ports, system id and state folder; of a swarm the first vehicle's (0)",
    )
    _add_simulation(parser, "1")
    parser.add_argument(
        "--home",
        type=_reader(config.parse_home),
        metavar="LAT,LON,ALT,HDG",
        help="where it stands: degrees, metres above mean sea level, degrees from north",
    )
    parser.add_argument(
        "--identity",
        choices=("px4", "generic"),
        default="px4",
        help="autopilot that it reports (px4): ground stations know px4's modes; generic claims none",
    )
    parser.add_argument(
        "--gcs",
        type=_reader(config.parse_peer),
        default=[],
        action="append",
        metavar="HOST:PORT",
        help="another ground station to serve from the start; may be given again",
    )
    parser.add_argument(
        "--listen",
        type=_reader(config.parse_listen),
        default=config.LOOPBACK,
        metavar="ADDRESS",
        help="where the UDP ports listen (127.0.0.1); 0.0.0.0 lets everyone on the network command the vehicle",
    )
    parser.add_argument(
        "--state-dir",
        type=Path,
        metavar="DIR",
        help="parameters and plan are kept here ($XDG_STATE_HOME or ~/.local/state, yawsitter/instance-I)",
    )
    parser.add_argument("--no-zenoh", action="store_true", help="no Zenoh telemetry")
    parser.add_argument(
        "--zenoh-endpoint",
        metavar="ENDPOINT",
        help="where Zenoh listens (tcp/127.0.0.1:7447+I)",
    )
    parser.add_argument(
        "--signing-key",
        type=Path,
        metavar="FILE",
        help="sign every message and take none that isn't signed with this key: 32 bytes, or 64 hexadecimal digits",
    )
    parser.add_argument("--verbose", action="store_true", help="log more")


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

    run = command("run", _HELP_RUN, RUN, RUN_EXAMPLES)
    _add_daemon(run)
    run.add_argument(
        "--hil-viewer",
        action="store_true",
        help="send HEARTBEAT and HIL_STATE_QUATERNION (25 Hz, true state) to 127.0.0.1:19410+I for jMAVSim or Hawkeye",
    )
    run.add_argument(
        "--forward", action="store_true", help="pass messages on between peers, as MAVLink's routing rules have it"
    )
    run.add_argument(
        "--record",
        type=Path,
        nargs="?",
        const=_IN_STATE,
        metavar="DIR",
        help="keep each flight in DIR (logs in the state folder): MAVLink frames as .tlog, control steps as .mcap",
    )

    flock = command("swarm", _HELP_SWARM, SWARM, SWARM_EXAMPLES)
    flock.add_argument("count", type=_reader(swarm.parse_count), metavar="N", help="how many vehicles, up to 250")
    _add_daemon(flock)
    where = flock.add_mutually_exclusive_group()
    where.add_argument(
        "--spacing",
        type=_reader(swarm.parse_spacing),
        default=3.0,
        metavar="M",
        help="of the square grid on which they stand, its first corner at --home (3)",
    )
    where.add_argument("--formation", type=Path, metavar="FILE", help="where they stand: docs/swarm.md")
    flock.add_argument(
        "--rate",
        type=_reader(swarm.parse_rate),
        default=10.0,
        metavar="HZ",
        help="of each MAVLink stream that nobody asked for more of, at most, and SIM_TLM_RATE (10)",
    )
    flock.add_argument(
        "--port", type=_reader(swarm.parse_port), metavar="PORT", help="the UDP port of all of them (18300+I)"
    )

    fly = command("fly", _HELP_FLY, FLY, FLY_EXAMPLES)
    fly.add_argument("mission", type=Path, metavar="MISSION", help="a mission (.yaml) or QGroundControl plan (.plan)")
    _add_vehicle(fly)
    _add_simulation(fly, "max")
    for option, whose in (("--plant", "the vehicle that flies"), ("--believed", "what the controller takes it to be")):
        fly.add_argument(
            option,
            type=_reader(config.parse_airframe),
            default=[],
            action="append",
            metavar="NAME=VALUE",
            help=f"change an airframe number of {whose}; may be given again",
        )
    fly.add_argument(
        "--heading",
        type=_reader(config.parse_heading),
        default=0.0,
        metavar="DEG",
        help="where the belly faces at the start, degrees from north towards east (0)",
    )
    fly.add_argument("--out", type=Path, metavar="DIR", help="write the flight's logs and figures here")
    fly.add_argument("--json", action="store_true", help="print one JSON object")

    trim = command("trim", _HELP_TRIM, TRIM, TRIM_EXAMPLES)
    _add_vehicle(trim)
    trim.add_argument(
        "--airspeed", type=_reader(_airspeed), default=0.0, metavar="M_S", help="of level flight, m/s (0: hover)"
    )
    trim.add_argument("--json", action="store_true", help="print one JSON object")

    reproduce = command("reproduce", _HELP_REPRODUCE, REPRODUCE, REPRODUCE_EXAMPLES)
    reproduce.add_argument(
        "--out", type=Path, default=Path("out/reproduce"), metavar="DIR", help="the report's folder (out/reproduce)"
    )
    reproduce.add_argument("--quick", action="store_true", help="one seed, ablations with the default vehicle only")
    reproduce.add_argument("--json", action="store_true", help="print all numbers as one JSON object")

    options.add(command)
    return parser


def _daemon(args: argparse.Namespace) -> config.RunConfig:
    """What `_add_daemon` has read."""
    return config.RunConfig(
        vehicle=args.vehicle,
        instance=args.instance,
        speed=args.speed,
        home=args.home,
        wind_N_m_s=args.wind,
        gust_m_s=args.gust,
        seed=args.seed,
        identity=args.identity,
        ground_stations=tuple(args.gcs),
        gains=args.gains,
        settings=tuple(args.set),
        state_dir=args.state_dir,
        zenoh_endpoint=args.zenoh_endpoint,
        zenoh=not args.no_zenoh,
        listen=args.listen,
        signing_key=args.signing_key,
    )


def _run(args: argparse.Namespace) -> int:
    from sitl.daemon import main as daemon

    settings = _daemon(args)._replace(
        record=args.record is not None,
        record_dir=None if args.record is _IN_STATE else args.record,
        hil_viewer=args.hil_viewer,
        forward=args.forward,
    )
    return daemon.main(config.Setup((settings,)), verbose=args.verbose)


def _swarm(args: argparse.Namespace) -> int:
    from sitl.daemon import main as daemon

    places_m = swarm.grid(args.count, args.spacing)
    if args.formation is not None:
        from sitl.daemon import formation

        places_m = formation.load(args.formation, args.count)
    return daemon.main(swarm.setup(_daemon(args), places_m, args.rate, args.port), verbose=args.verbose)


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
