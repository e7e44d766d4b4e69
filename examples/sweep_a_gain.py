"""Fly the same gusts with several values of a gain: `python examples/sweep_a_gain.py [NAME VALUE VALUE ...]`.

Prints a table: the gain's value, and the mean absolute error of the true position north, east and down in metres. A
flight that fails says why in its row. Without arguments: the position gain north, POS_X_P, at three values.
"""

import sys
from pathlib import Path

from sitl import FlightError, fly

MISSIONS = Path(__file__).parents[1] / "missions"


def main(arguments: list[str]) -> None:
    name, *values = arguments or ["POS_X_P", "0.5", "1", "2"]
    print(f"{name:>12}    north     east     down   mean |error| [m]")
    for value in map(float, values):
        try:
            flown = fly(MISSIONS / "hover.yaml", seed=1, wind_N=(1.5, 0.0, 0.0), gust_m_s=0.5, parameters={name: value})
        except FlightError as failed:
            print(f"{value:12g}    {failed}")
        else:
            print(f"{value:12g} " + " ".join(f"{error:8.4f}" for error in flown.true["mae"]))


if __name__ == "__main__":
    main(sys.argv[1:])
