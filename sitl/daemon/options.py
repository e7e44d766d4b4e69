"""The options of `sitl run` and `sitl swarm`, and what they come to. Light: nothing is imported that flies."""

import argparse
from pathlib import Path

from sitl.daemon import config, swarm
from sitl.options import VEHICLES, Command, add_simulation, add_vehicle, reader

_IN_STATE = Path()  # --record without a folder

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
  UDP 19450+I+k    with --hil-viewer, sending vehicle k's true state to 127.0.0.1:19410+I+k (instances 0 to 39)
  TCP 7447+I       one Zenoh session with the keys yawsitter/I/... to yawsitter/I+N-1/...

{VEHICLES}"""

SWARM_EXAMPLES = """\
examples:
  sitl swarm 9                                     nine vehicles on a grid, three metres apart
  sitl swarm 50 --vehicle yawsitter-real --rate 5  fifty, with five messages a second of each stream
  sitl swarm 9 --formation examples/formations/v.yaml
  sitl swarm 4 --instance 20 --speed max --no-zenoh
  sitl swarm 9 --record logs                       each vehicle's flights in a folder of its own in logs
  gcs fly missions/rectangle.yaml --system 3       the third of them flies (in another terminal)
  python examples/formation.py v                   all of them fly in formation

SIM_SPEED, SIM_PAUSE and SIM_STEP_MS, set on any vehicle, change the pace of all. A vehicle that is told to reboot
starts again by itself; one that is told to shut down is switched off while the others go on.

exit status: 0 after Ctrl-C, SIGTERM or the last vehicle's shutdown; 2 for settings that can't be used.
"""

_HELP_RUN = "run a vehicle behind MAVLink and Zenoh, in real time or faster"
_HELP_SWARM = "run many vehicles in one process, on one port and on ports of their own"


def add(command: Command) -> None:
    """Add both commands."""
    run = command("run", _HELP_RUN, RUN, RUN_EXAMPLES)
    _add_daemon(run)
    flock = command("swarm", _HELP_SWARM, SWARM, SWARM_EXAMPLES)
    flock.add_argument("count", type=reader(swarm.parse_count), metavar="N", help="how many vehicles, up to 250")
    _add_daemon(flock)
    where = flock.add_mutually_exclusive_group()
    where.add_argument(
        "--spacing",
        type=reader(swarm.parse_spacing),
        default=3.0,
        metavar="M",
        help="of the square grid on which they stand, its first corner at --home (3)",
    )
    where.add_argument("--formation", type=Path, metavar="FILE", help="where they stand: docs/swarm.md")
    flock.add_argument(
        "--rate",
        type=reader(swarm.parse_rate),
        default=10.0,
        metavar="HZ",
        help="of each MAVLink stream that nobody asked for more of, at most, and SIM_TLM_RATE (10)",
    )
    flock.add_argument(
        "--port", type=reader(swarm.parse_port), metavar="PORT", help="the UDP port of all of them (18300+I)"
    )


def _add_daemon(parser: argparse.ArgumentParser) -> None:
    """What `sitl run` and `sitl swarm` have in common."""
    add_vehicle(parser)
    parser.add_argument(
        "--instance",
        type=reader(config.parse_instance),
        default=0,
        metavar="I",
        help="its ports, system id and state folder; of a swarm the first vehicle's (0)",
    )
    add_simulation(parser, "1")
    parser.add_argument(
        "--home",
        type=reader(config.parse_home),
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
        type=reader(config.parse_peer),
        default=[],
        action="append",
        metavar="HOST:PORT",
        help="another ground station to serve from the start; may be given again",
    )
    parser.add_argument(
        "--listen",
        type=reader(config.parse_listen),
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
    parser.add_argument(
        "--hil-viewer",
        action="store_true",
        help="send HEARTBEAT and HIL_STATE_QUATERNION (25 Hz, true state) to 127.0.0.1:19410+I for jMAVSim or Hawkeye",
    )
    parser.add_argument(
        "--forward", action="store_true", help="pass messages on between peers, as MAVLink's routing rules have it"
    )
    parser.add_argument(
        "--record",
        type=Path,
        nargs="?",
        const=_IN_STATE,
        metavar="DIR",
        help="keep each flight in DIR (logs in the state folder; of a swarm a folder for each vehicle in it): "
        "MAVLink frames as .tlog, control steps as .mcap",
    )
    parser.add_argument("--verbose", action="store_true", help="log more")


def run_setup(args: argparse.Namespace) -> config.Setup:
    """Of `sitl run`. Raises SettingError."""
    return config.Setup((_common(args),))


def swarm_setup(args: argparse.Namespace) -> config.Setup:
    """Of `sitl swarm`. Raises SettingError, and ConfigError for a formation that can't be used."""
    places_m = swarm.grid(args.count, args.spacing)
    if args.formation is not None:
        from sitl.daemon import formation

        places_m = formation.load(args.formation, args.count)
    return swarm.setup(_common(args), places_m, args.rate, args.port)


def _common(args: argparse.Namespace) -> config.RunConfig:
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
        record=args.record is not None,
        record_dir=None if args.record is _IN_STATE else args.record,
        hil_viewer=args.hil_viewer,
        forward=args.forward,
    )
