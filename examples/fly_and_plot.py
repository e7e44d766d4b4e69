"""Fly a mission in wind and plot where the vehicle went: `python examples/fly_and_plot.py [PICTURE.png]`.

Prints the flight and its largest error; with a file's name it also writes a picture, which needs matplotlib
(`pip install 'yawsitter-sitl[report]'`).
"""

import sys
from pathlib import Path

import numpy as np

from sitl import fly

MISSIONS = Path(__file__).parents[1] / "missions"


def main(arguments: list[str]) -> None:
    flown = fly(MISSIONS / "circle.yaml", "yawsitter-real", seed=3, wind_N=(1.0, 0.0, 0.0), gust_m_s=0.3)
    print(flown)
    error = np.linalg.norm(flown.position_m - flown.reference_m, axis=1)
    print(f"largest error {error.max():.3f} m, at t = {flown.t_s[error.argmax()]:.1f} s")
    if arguments:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9, 4), layout="constrained")
        above, over_time = figure.subplots(1, 2)
        for name, track in (("reference", flown.reference_m), ("true", flown.position_m)):
            above.plot(track[:, 1], track[:, 0], label=name)
        above.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
        above.legend()
        over_time.plot(flown.t_s, flown.position_m - flown.reference_m, label=("north", "east", "down"))
        over_time.set(xlabel="t [s]", ylabel="error [m]")
        over_time.legend()
        figure.savefig(arguments[0])
        print(f"drawn in {arguments[0]}")


if __name__ == "__main__":
    main(sys.argv[1:])
