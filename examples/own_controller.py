"""A controller of one's own in place of the position and velocity loops: `python examples/own_controller.py`.

`outer_loop` is called before each of the 500 control steps a second; it returns the attitude and the thrust that it
wants, and the vehicle's own attitude and rate loops hold them. Prints the error of a flight with the built-in loops and
with this one, and the wall time that each took: a call of Python for each control step has its price.
"""

import math
import time
from pathlib import Path

from sitl import attitude, fly, load_vehicle
from sitl.control.attitude import attitude_of
from sitl.control.feedforward import heading_frame, invert
from sitl.quaternion import rotate_back

MISSIONS = Path(__file__).parents[1] / "missions"
AIRFRAME, G = load_vehicle("yawsitter").airframe.airframe, 9.80665
P, D = 4.0, 3.0  # 1/s², 1/s


def outer_loop(t_s, nav, ref):
    """PD on position and the reference's acceleration give a force; its trim gives pitch and lean."""
    north, east, down = (
        AIRFRAME.mass_kg * (ref[6 + i] + P * (ref[i] - nav[i]) + D * (ref[3 + i] - nav[3 + i])) for i in range(3)
    )
    force_N = (north, east, down - AIRFRAME.mass_kg * G)
    trim = invert(
        AIRFRAME, heading_frame(ref.heading_rad, *force_N), heading_frame(ref.heading_rad, *nav[3:6]),
        0.0, 0.5 * math.pi, AIRFRAME.mass_kg * G, 8,
    )  # fmt: skip
    return attitude(attitude_of(ref.heading_rad, trim.pitch_rad, trim.lean_rad), rotate_back(nav[6:10], force_N)[0])


def main() -> None:
    for name, controller in (("built in", None), ("own", outer_loop)):
        begin = time.perf_counter()
        flown = fly(MISSIONS / "hover.yaml", controller=controller)
        took = time.perf_counter() - begin
        errors = " / ".join(f"{error:.4f}" for error in flown.true["mae"])
        print(f"{name:>9}: mean |error| {errors} m (north / east / down), {took:.1f} s")


if __name__ == "__main__":
    main()
