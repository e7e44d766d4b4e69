"""JSBSim: one of the aircraft that its package brings, flown by that aircraft's own control laws, in C++.

Arguments: aircraft, steps per second. c172x: a Cessna under its altitude and wing hold at 120 Hz by its author.
F450: a quadrotor of 450 mm whose rate controller keeps it level in a climb, 500 Hz by its author. ball: a sphere
that falls, with nothing to control: what a step costs at least. Each step evaluates the forces once.
The Cessna's file has a record of the flight opened in the working directory, even where that is disabled.
"""

import sys

import jsbsim
import timed

aircraft, rate_Hz = sys.argv[1], float(sys.argv[2])
BEGINNINGS = {
    "c172x": {"ic/h-sl-ft": 4000.0, "ic/vc-kts": 100.0, "ic/gamma-deg": 0.0},
    "F450": {"ic/h-agl-ft": 100.0},
    "ball": {"ic/h-sl-ft": 100_000.0},
}
CONTROLS = {
    "c172x": {
        "propulsion/set-running": -1, "fcs/mixture-cmd-norm": 0.87, "fcs/throttle-cmd-norm": 0.8,
        "ap/attitude_hold": 1, "ap/altitude_setpoint": 4000.0, "ap/altitude_hold": 1,
    },
    "F450": {"propulsion/set-running": -1, "fcs/ScasEngage": 1, "fcs/throttle-cmd-norm": 0.49},
    "ball": {},
}  # fmt: skip
WITHIN_FT = {"c172x": (3500.0, 4500.0), "F450": (1000.0, 3000.0), "ball": (0.0, 100_000.0)}  # after 70 s


def fly(seconds: float) -> float:
    f = jsbsim.FGFDMExec(None)
    f.set_debug_level(0)
    f.set_dt(1.0 / rate_Hz)
    assert f.load_model(aircraft), aircraft
    f.disable_output()
    for name, value in BEGINNINGS[aircraft].items():
        f[name] = value
    assert f.run_ic()
    for name, value in CONTROLS[aircraft].items():
        f[name] = value
    for _ in range(round(seconds * rate_Hz)):
        f.run()
    least, most = WITHIN_FT[aircraft]
    height_ft = f["position/h-sl-ft"]
    assert seconds < 70.0 or least < height_ft < most, height_ft
    assert abs(f["attitude/phi-rad"]) < 0.1 or aircraft == "ball", f["attitude/phi-rad"]
    return f.get_sim_time()


timed.tell(fly, 70.0)
