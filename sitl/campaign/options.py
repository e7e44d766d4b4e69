"""The options of `sitl campaign` and `sitl dataset`. Light: nothing is imported that flies."""

import argparse
from pathlib import Path

from sitl.daemon.config import parse_number
from sitl.options import Command, reader

CAMPAIGN = """\
Fly a mission many times: Monte Carlo, grids, Latin hypercubes and Sobol sequences over wind, seeds, parameters, the
airframe's numbers, heading, mission and vehicle. The campaign's file says what varies (docs/campaigns.md). Each flight
is a function of the file and its index, bit for bit, whoever flies it, and has the `sitl fly` command that flies it
again.

Needs pip install 'yawsitter-sitl[campaign]', for --cluster [cluster].
"""

CAMPAIGN_EXAMPLES = """\
examples:
  sitl campaign examples/campaigns/wind-and-noise.yaml            one process a core, into out/wind-and-noise
  sitl campaign examples/campaigns/two-gains.yaml --workers 2 --out out/gains
  sitl campaign examples/campaigns/airframe.yaml --resume         go on after Ctrl-C
  sitl campaign examples/campaigns/airframe.yaml --cluster tcp://10.0.0.1:8786    a dask cluster's scheduler
  sitl campaign --report out/airframe                             write the report again

It writes flights/*.parquet, traces/*.parquet where the file asks for them, report.html and summary.json.

exit status: 0 when all flights are flown and kept, also those that failed; 1 when the workers gave up; 2 for settings
that can't be used; 130 after Ctrl-C.
"""

DATASET = """\
Fly episodes for learning: state, reference, action and wind of each at a fixed rate, as Parquet with units and frames,
split into train, validation and test by episode, with a data card. Without a file: yawsitter-real along smooth random
flights in wind with gusts, from any heading. With one: whatever a campaign's file says (docs/campaigns.md).

Needs pip install 'yawsitter-sitl[campaign]', for --mcap [record], for --cluster [cluster].
"""

DATASET_EXAMPLES = """\
examples:
  sitl dataset --episodes 100                                     random flights at 50 Hz, into out/dataset
  sitl dataset --episodes 1000 --mission missions/rectangle.yaml --rate 100 --out out/rectangles
  sitl dataset examples/campaigns/episodes.yaml --mcap            with one .mcap for each episode too
  sitl dataset --episodes 10000 --resume                          go on after Ctrl-C

exit status: as 'sitl campaign'.
"""

_HELP_DATASET = "fly episodes of state, reference, action and wind for learning"
_HELP_CAMPAIGN = "fly a mission many times, vary what you like, and report"


def _whole(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if not 1 <= value <= 1_000_000:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number from 1 to 1000000")
    return value


def _rate(text: str) -> float:
    return parse_number(text, 1.0, 500.0, "Hz")


def _add_workers(parser: argparse.ArgumentParser) -> None:
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=_whole, metavar="N", help="processes on this machine (one a core)")
    where.add_argument("--cluster", metavar="ADDRESS", help="scheduler of a dask.distributed cluster: tcp://HOST:8786")
    parser.add_argument("--resume", action="store_true", help="go on with what the folder holds")


def add(command: Command) -> None:
    """Add both commands."""
    campaign = command("campaign", _HELP_CAMPAIGN, CAMPAIGN, CAMPAIGN_EXAMPLES)
    campaign.add_argument("campaign", type=Path, nargs="?", metavar="CAMPAIGN", help="the campaign's file (.yaml)")
    _add_workers(campaign)
    campaign.add_argument("--out", type=Path, metavar="DIR", help="the results' folder (out/ and the file's name)")
    campaign.add_argument("--report", type=Path, metavar="DIR", help="only write the report of a campaign's folder")
    campaign.add_argument("--json", action="store_true", help="print the summary as one JSON object")

    dataset = command("dataset", _HELP_DATASET, DATASET, DATASET_EXAMPLES)
    dataset.add_argument("dataset", type=Path, nargs="?", metavar="DATASET", help="a campaign's file (.yaml)")
    dataset.add_argument("--episodes", type=_whole, metavar="N", help="without a file: how many (100)")
    dataset.add_argument("--mission", metavar="MISSION", help="without a file: a mission's file (random flights)")
    dataset.add_argument("--vehicle", metavar="NAME|FILE", help="without a file: which vehicle (yawsitter-real)")
    dataset.add_argument("--rate", type=reader(_rate), metavar="HZ", help="without a file: samples a second (50)")
    dataset.add_argument("--mcap", action="store_true", help="write each episode as .mcap too")
    _add_workers(dataset)
    dataset.add_argument(
        "--out", type=Path, metavar="DIR", help="the data set's folder (out/dataset, or the file's name)"
    )
    dataset.add_argument("--json", action="store_true", help="print a summary as one JSON object")
