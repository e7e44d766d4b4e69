"""What several commands of `sitl` take. Light: nothing is imported that flies."""

import argparse
from collections.abc import Callable
from typing import TypeVar

from sitl.daemon import config

T = TypeVar("T")
Command = Callable[[str, str, str, str], argparse.ArgumentParser]
"""Makes a command's parser of its name, help, description and examples."""

VEHICLES = """\
vehicles:
  yawsitter         the paper's gains, ideal actuators and sensors, 500 Hz (default)
  yawsitter-real    motor and flap lag, sensor noise, retuned gains
  FILE.yaml         your own: airframe, gains, actuators and sensors
"""


def reader(parse: Callable[[str], T]) -> Callable[[str], T]:
    """`parse` as an argparse type: its refusal becomes argparse's."""

    def read(text: str) -> T:
        try:
            return parse(text)
        except config.SettingError as refusal:
            raise argparse.ArgumentTypeError(str(refusal)) from None

    return read


def add_vehicle(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--vehicle", default="yawsitter", metavar="NAME|FILE", help="which vehicle (yawsitter)")


def add_simulation(parser: argparse.ArgumentParser, speed: str) -> None:
    parser.add_argument(
        "--speed",
        type=reader(config.parse_speed),
        default=config.parse_speed(speed),
        metavar="FACTOR|max",
        help=f"of real time, or max: as fast as possible ({speed})",
    )
    parser.add_argument(
        "--wind",
        type=reader(config.parse_wind),
        default=(0.0, 0.0, 0.0),
        metavar="N,E,D",
        help="where the air moves, m/s north, east, down (0,0,0)",
    )
    parser.add_argument(
        "--gust",
        type=reader(config.parse_gust),
        default=0.0,
        metavar="M_S",
        help="standard deviation of turbulence, m/s (0)",
    )
    parser.add_argument(
        "--seed",
        type=reader(config.parse_seed),
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
        type=reader(config.parse_setting),
        default=[],
        action="append",
        metavar="NAME=VALUE",
        help="set a parameter; may be given again",
    )
