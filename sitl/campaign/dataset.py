"""`sitl dataset`: episodes for learning. A campaign of which every flight keeps its trace, with splits and a card."""

import argparse
import json
import shlex
from pathlib import Path
from typing import Any

from sitl.atomic import atomically
from sitl.campaign import file, store
from sitl.campaign.card import card
from sitl.campaign.file import Campaign
from sitl.campaign.main import answered
from sitl.campaign.run import RECORD, Plan, fly, need, plan
from sitl.campaign.summary import finite
from sitl.strict_yaml import ConfigError

CARD = "DATACARD.md"
DEFAULT_OUT = Path("out/dataset")
_OWN_OPTIONS = ("episodes", "mission", "vehicle", "rate")  # what a file says itself


def settings(args: argparse.Namespace) -> str:
    """The campaign's file that the options stand for."""
    mission = "{random: {}}" if args.mission is None else json.dumps(args.mission)
    along = "smooth random flights" if args.mission is None else Path(args.mission).stem
    return f"""\
name: YawSitter episodes
description: Episodes of a tail-sitter along {along} in wind with gusts, flown by its own controller.
mission: {mission}
vehicle: {json.dumps(args.vehicle or "yawsitter-real")}
flights: {args.episodes or 100}
trace_rate_hz: {args.rate or 50.0:g}
heading_deg: {{uniform: [-180, 180]}}
wind_speed_m_s: {{uniform: [0, 2]}}
wind_toward_deg: {{uniform: [0, 360]}}
gust_m_s: {{uniform: [0, 0.5]}}
"""


def main(args: argparse.Namespace) -> int:
    """`sitl dataset` with its parsed arguments: the exit status."""
    return answered("dataset", _dataset, args)


def _dataset(args: argparse.Namespace) -> None:
    need("pyarrow", "scipy", extra="campaign")
    if args.mcap:
        need("mcap", extra="record")
    if args.cluster is not None:
        need("distributed", extra="cluster")
    made = planned(args)
    fly(made, args)
    summary = conclude(made)
    if args.json:
        print(json.dumps(finite(summary)))
    else:
        splits = ", ".join(f"{count} {word}" for word, count in summary["splits"].items())
        print(f"{summary['episodes']} episodes, {summary['samples']} samples: {splits}", made.folder / CARD, sep="\n")


def planned(args: argparse.Namespace) -> Plan:
    """The episodes that the arguments ask for. Raises ConfigError."""
    given = [f"--{name}" for name in _OWN_OPTIONS if getattr(args, name) is not None]
    if args.dataset is None:
        campaign, beside, folder = file.loads(settings(args), "the options"), Path("."), args.out or DEFAULT_OUT
        words = [f"{name}={shlex.quote(str(getattr(args, name[2:])))}" for name in given]
    elif given:
        raise ConfigError(f"{', '.join(given)}: say it in {args.dataset}")
    else:
        campaign, beside = file.load(str(args.dataset)), args.dataset.parent
        folder = args.out or Path("out") / args.dataset.stem
        words = [shlex.quote(str(args.dataset))]
    words += ["--mcap"] * args.mcap
    command = " ".join(["sitl dataset", *words, "--out", shlex.quote(str(folder))])
    return plan(_traced(campaign), beside, folder, command, dataset=True, mcap=args.mcap)


def _traced(campaign: Campaign) -> Campaign:
    return campaign._replace(trace_every=1)


def conclude(made: Plan) -> dict[str, Any]:
    """Write the data card; what it counts."""
    import pyarrow.parquet as pq

    flights = store.table(made.folder)
    words = flights["split"].to_pylist()
    parts = {w: sorted((made.folder / store.TRACES / w).glob("*.parquet")) for w in ("train", "validation", "test")}
    samples = {w: sum(pq.read_metadata(path).num_rows for path in paths) for w, paths in parts.items()}
    outcomes = flights["outcome"].to_pylist()
    summary = {
        "name": made.campaign.name,
        "episodes": len(words),
        "samples": sum(samples.values()),
        "splits": {w: words.count(w) for w in parts if w in words},
        "split_samples": samples,
        "outcomes": {o: outcomes.count(o) for o in sorted(set(outcomes))},
        "hours": sum(samples.values()) / made.campaign.trace_rate_hz / 3600.0,
        "bytes": sum(path.stat().st_size for paths in parts.values() for path in paths),
    }
    record = json.loads((made.folder / RECORD).read_text(encoding="utf-8"))
    text = card(made.campaign, summary, record, made.flight_columns(), made.mcap)
    atomically(made.folder / CARD, lambda to: to.write_text(text, encoding="utf-8"))
    return summary
