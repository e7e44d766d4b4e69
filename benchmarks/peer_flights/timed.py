"""How a flight is timed, in whatever environment: for the scripts in this folder, which import it beside them.

Each script is a process of its own. It flies a moment to warm up, says that it is ready, waits for a line (so that
several can begin at once) and then flies again and again. Needs nothing but Python.
"""

import sys
import time
from collections.abc import Callable

MEASURED_S = 2.0  # of wall time at least, in whole flights


def tell(fly: Callable[[float], float], seconds: float) -> None:
    """Measure `fly`, which flies for so many simulated seconds and returns how many vehicle-seconds that came to.

    Printed to stderr: vehicle-seconds per second of processor time (of all threads), and per second of wall time.
    """
    fly(min(2.0, seconds))
    print("READY", file=sys.stderr, flush=True)
    sys.stdin.readline()
    begin_s, busy_s, flown_s = time.perf_counter(), time.process_time(), 0.0
    while time.perf_counter() - begin_s < MEASURED_S:
        flown_s += fly(seconds)
    rates = flown_s / (time.process_time() - busy_s), flown_s / (time.perf_counter() - begin_s)
    print("RATES", *rates, file=sys.stderr, flush=True)
