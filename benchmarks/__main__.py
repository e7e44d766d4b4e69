"""`python -m benchmarks [NAME …]`: measure the figures and print them as one table."""

import argparse
import importlib
import os
import platform
import sys
import time

from rich.console import Console

from benchmarks.figure import Figure, show

NAMES = {
    "tracking": "both flights by both vehicles against the paper's errors; 2.5 min, 10 s with --quick",
    "robustness": "model errors, wind, recovery, turns and steps, in lockstep; a minute, 15 s with --quick",
    "speed": "simulated seconds per second, without the link and with it",
    "process": "a whole `sitl fly` process",
    "start": "process start to first heartbeat and to arming",
    "cpu": "the daemon's share of a core at 1 × real time",
    "gains": "from a gain's write to the control step that uses it",
    "transfers": "the parameter list, 500 mission items up and down, a log of 1 MB, over UDP",
    "lateness": "the loop's deadlines beside a bare sleep loop's: recording, and with a listener that never reads",
    "view": "the viewer's share of a core, its updates, the loop's deadlines with it and without; 2 min",
    "flood": "20,000 messages a second from one address: heartbeats to another, the loop's deadlines; 1 min",
    "fuzz": "a million hostile datagrams against a hovering vehicle; 4 min, 50,000 with --quick",
    "soak": "30 simulated hours of missions; 10 min, 3 hours with --quick",
    "swarm": "50 vehicles in one process at 1 × real time: processor time for each, deadlines; 1.5 min",
    "crossing": "50 vehicles' turn in compiled code, entered one by one and in one call",
    "peers": "other simulators in turn with this one, those that benchmarks.peer_environments has installed; 10 min",
    "costs": "one message, put, tick, crossing, record and turn of the daemon, in µs; half a minute",
    "native": "the compiled step beside the same arithmetic written by hand in C",
    "arithmetic": "operations of a control step's parts, counted, and their time",
    "shares": "where the time of a simulated second goes",
}

WIDTH = 160  # of the table where no terminal sets it


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure what the simulator is to reach, and print it as a table.",
        epilog="benchmarks:\n" + "\n".join(f"  {name:<11}{what}" for name, what in NAMES.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="these alone (all)")
    parser.add_argument("--quick", action="store_true", help="leave the flights in real time out")
    args = parser.parse_args()
    if unknown := set(args.names) - set(NAMES):
        parser.error(f"no benchmark is called {', '.join(sorted(unknown))}: there are {', '.join(NAMES)}")
    console = Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH)
    figures: list[Figure] = []
    failed = False
    for name in args.names or NAMES:
        print(f"measuring {name} ...", file=sys.stderr)
        start_s = time.perf_counter()
        try:
            for figure in importlib.import_module(f"benchmarks.{name}").measure(args.quick):
                figures.append(figure)
        except Exception as error:  # the others are still worth measuring
            failed = True
            figures.append(Figure(name, "", f"not measured: {type(error).__name__}: {error}", None))
        print(f"  {time.perf_counter() - start_s:.0f} s", file=sys.stderr)
    show(figures, console)
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    console.print(f"{platform.machine()}, {os.cpu_count()} cores{load}, Python {platform.python_version()}")
    if args.quick:
        console.print("left out with --quick: the flights over UDP in real time")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
