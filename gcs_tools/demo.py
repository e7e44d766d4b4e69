"""The whole thing at a glance: start a simulator, fly a mission over UDP, print the error table, stop.

python -m gcs_tools.demo [MISSION] [--vehicle NAME|FILE] [--speed FACTOR] [--json] [--out DIR]
"""

import argparse
import contextlib
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType

from gcs_tools import plan
from gcs_tools.client import LinkError
from gcs_tools.fly import fly
from gcs_tools.link import Connection, free_ports
from sitl.strict_yaml import ConfigError

MISSION = Path(__file__).parent.parent / "missions" / "rectangle.yaml"
INSTANCES = 40  # that keep out of each other's ports
GCS_PORT, ONBOARD_PORT, ZENOH_PORT = 18570, 14580, 7447  # of instance 0
STOP_S = 5.0  # granted to the simulator to end in order


def free_instance() -> int:
    """The first instance whose ports nobody listens on."""
    for instance in range(INSTANCES):
        if free_ports(udp=(GCS_PORT + instance, ONBOARD_PORT + instance), tcp=(ZENOH_PORT + instance,)):
            return instance
    raise LinkError(f"the ports of all {INSTANCES} instances are taken")


class Simulator:
    """`sitl run` as a process of our own, and what it has written."""

    def __init__(self, process: "subprocess.Popen[bytes]", instance: int, log: Path) -> None:
        self._process, self._log = process, log
        self.instance = instance
        self.connection = Connection(False, "127.0.0.1", ONBOARD_PORT + instance)

    def check(self) -> None:
        """Raise LinkError if it has ended, with its reason or else the last it had to say."""
        code = self._process.poll()
        if code is None:
            return
        said = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        reasons = [line for line in said if line.startswith("sitl run: ")] or said
        raise LinkError(f"the simulator ended with status {code}{': ' + reasons[-1] if reasons else ''}")


@contextlib.contextmanager
def simulator(vehicle: str, speed: float) -> Iterator[Simulator]:
    """A running simulator with a state folder of its own; both are gone afterwards."""
    instance = free_instance()
    with tempfile.TemporaryDirectory(prefix="yawsitter-") as folder:
        log = Path(folder) / "sitl.log"
        command = [sys.executable, "-m", "sitl", "run", "--vehicle", vehicle, "--speed", f"{speed:g}"]
        command += ["--instance", str(instance), "--state-dir", str(Path(folder) / "state")]
        with log.open("wb") as output:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,  # Ctrl-C is for us; the simulator is stopped below, in order
            )
        try:
            yield Simulator(process, instance, log)
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="gcs_tools.demo", description="Start a simulator, fly a mission, stop it.")
    parser.add_argument("mission", nargs="?", type=Path, default=MISSION, help="mission or plan (the rectangle)")
    parser.add_argument("--vehicle", default="yawsitter", metavar="NAME|FILE", help="which vehicle (yawsitter)")
    parser.add_argument("--speed", type=float, default=1.0, metavar="FACTOR", help="of real time (1)")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write result.json and track.csv here")
    return parser


def _terminate(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def main(argv: Sequence[str] | None = None) -> int:
    """0 flown, 1 not flown, 2 a file that can't be used, 130 interrupted."""
    args = _parser().parse_args(argv)
    signal.signal(signal.SIGTERM, _terminate)
    try:
        flight = plan.load(args.mission)
        with simulator(args.vehicle, args.speed) as running:
            if not args.json:
                print(f"simulator started, instance {running.instance}; flying {flight.name}", file=sys.stderr)
            fly(
                flight,
                running.connection,
                system=running.instance + 1,
                out=args.out,
                as_json=args.json,
                check=running.check,
            )
    except ConfigError as error:
        return _complain(error, 2)
    except LinkError as error:
        return _complain(error, 1)
    except OSError as error:
        return _complain(f"{error.filename}: {error.strerror}" if error.filename else error, 2)
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        return 130
    return 0


def _complain(message: object, code: int) -> int:
    print(f"demo: {message}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
