"""Other simulators that pip installs, in turn with this one: simulated seconds per second of one core.

Each flies closed loop as its own package offers it, in a process of its own and without drawing; importing, building
and a first short flight are not timed. They live in an environment that is made for the benchmark and thrown away
(set PEERS_PYTHON to the python of one that is there), never among the project's own dependencies.
What each simulates, and what it doesn't, stands in docs/performance.md.
"""

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.figure import Figure, at_least, spread, told
from benchmarks.processes import ROOT

RUNS = 5
LIMIT_S = 300.0
PACKAGES = ("rotorpy", "jsbsim")
_UNIT = "× real time"

_OURS = """
from gcs_tools import plan
from sitl import batch
from sitl.vehicle import load_vehicle
rectangle, spec = plan.load("missions/rectangle.yaml"), load_vehicle("NAME")
def fly(seconds):
    flown = batch.fly(rectangle, spec, seed=1)
    assert not flown.fault, flown.fault
    return flown.end_s
"""

_ROTORPY = """
from rotorpy.controllers.quadrotor_control import SE3Control
from rotorpy.environments import Environment
from rotorpy.trajectories.circular_traj import ThreeDCircularTraj
from rotorpy.vehicles.crazyflie_params import quad_params
from rotorpy.vehicles.multirotor import Multirotor
def fly(seconds):
    world = Environment(Multirotor(quad_params), SE3Control(quad_params), ThreeDCircularTraj(), sim_rate=100)
    return float(world.run(t_final=min(seconds, 5.0), plot=False, terminate=False, verbose=False)["time"][-1])
"""

_JSBSIM = """
import jsbsim
def fly(seconds):
    f = jsbsim.FGFDMExec(None)
    f.set_debug_level(0)
    assert f.load_model("c172x")
    f["ic/h-sl-ft"], f["ic/vc-kts"], f["ic/gamma-deg"] = 4000.0, 100.0, 0.0
    assert f.run_ic()
    f["propulsion/set-running"], f["fcs/mixture-cmd-norm"], f["fcs/throttle-cmd-norm"] = -1, 0.87, 0.8
    f["ap/attitude_hold"], f["ap/altitude_setpoint"], f["ap/altitude_hold"] = 1, 4000.0, 1
    while f.get_sim_time() < seconds:
        f.run()
    assert f["position/h-sl-ft"] > 3000.0, f["position/h-sl-ft"]
    return f.get_sim_time()
"""

_TIMED = """
import contextlib, io, time
with contextlib.redirect_stdout(io.StringIO()):
    fly(2.0)
    begin_s = time.perf_counter()
    flown_s = fly(70.0)
    taken_s = time.perf_counter() - begin_s
import sys
print("\\nRATE", flown_s / taken_s, file=sys.stderr)
"""


def measure(quick: bool) -> Iterator[Figure]:
    with _environment() as python:
        who = {
            "yawsitter": (sys.executable, _OURS.replace("NAME", "yawsitter")),
            "yawsitter-real": (sys.executable, _OURS.replace("NAME", "yawsitter-real")),
            "RotorPy": (python, _ROTORPY),
            "JSBSim": (python, _JSBSIM),
        }
        rates: dict[str, list[float]] = {name: [] for name in who}
        for _ in range(2 if quick else RUNS):
            for name, (interpreter, script) in who.items():
                if interpreter is not None:
                    rates[name].append(_rate(interpreter, script))
    for name, values in rates.items():
        yield told(name, spread(values, _UNIT) if values else "not there, and pip can't install it: left out")
    for peer, least in (("RotorPy", 20.0), ("JSBSim", 5.0)):
        for own in ("yawsitter", "yawsitter-real"):
            if rates[peer]:
                ratio = statistics.median(rates[own]) / statistics.median(rates[peer])
                yield at_least(f"{own} against {peer}", [ratio], least, "×")


def _rate(interpreter: str, script: str) -> float:
    """Of one process. Raises CalledProcessError, TimeoutExpired."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT) if interpreter == sys.executable else ""}
    done = subprocess.run(
        [interpreter, "-c", script + _TIMED],
        cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=True,
    )  # fmt: skip
    return float(done.stderr.rpartition("RATE")[2])


@contextmanager
def _environment() -> Iterator[str | None]:
    """The python that has the peers; None where they can't be installed."""
    given = os.environ.get("PEERS_PYTHON")
    if given:
        yield given
        return
    with tempfile.TemporaryDirectory(prefix="yawsitter-peers-") as folder:
        python = Path(folder) / "bin" / "python"
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        installing = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PACKAGES]
        yield str(python) if subprocess.run(installing, check=False).returncode == 0 else None
