"""The data card: what a data set is, how it was made, and what it is not."""

from collections.abc import Sequence
from typing import Any

from sitl.campaign.cases import FIRST_SEED
from sitl.campaign.file import Campaign
from sitl.campaign.results import TRACE, Column

_CARD = """\
# {name}

{description}

{episodes} episodes, {samples} samples at {rate_hz:g} Hz, {hours:.2f} hours of flight, {megabytes:.1f} MB.
Outcomes: {outcomes}.

| split | episodes | samples | files |
|---|---|---|---|
{splits}
Each block of {block} episodes has its {shares} of train, validation and test; more episodes leave those that are
there in their split.

## Load

```python
import pyarrow.parquet as pq

train = pq.read_table("traces/train").to_pandas()
episodes = pq.read_table("flights").to_pandas().set_index("index")
one = train[train["index"] == train["index"].iloc[0]]
```

`datasets.load_dataset("parquet", data_files={{"train": "traces/train/*.parquet"}})` reads it too.{mcap}

## Samples: `traces`

N is north-east-down with its origin where the vehicle stood; B is the aeroplane's forward-right-down (x out of the
nose, which points up in hover). q_NB is w x y z and takes B to N. Units and frames stand in the columns' Parquet
metadata too.

{sample_columns}
## Episodes: `flights`

{episode_columns}
## How it was made

    {command}

with these settings (`campaign.yaml`):

```yaml
{settings}
```

Settings are drawn with the seed {draws_seed}; unless said otherwise episode k has the seed k + {first_seed} for gusts
and sensor noise, and for its mission where that is made up. The column `command` flies an episode again from this
folder, to the last bit.

{versions}; sources {sources}, episodes {digest}.

## Known limits

- It comes from a simulator. The airframe's numbers are those of the YawSitter paper where it prints them, and readings
  of it where it doesn't; no flight of the real vehicle has been compared with it.
- The actions are those of one controller, the vehicle's own cascade with feed-forward, observer and, in
  `yawsitter-real`, a navigation filter. They are good actions near the reference: nobody explored.
- A sample is the vehicle at the begin of a control step and the action computed from it. Below the control rate (500 a
  second in the bundled vehicles) the actions between two samples are not in the data.
- Raw sensor readings are not in it; `nav_*` is what the navigation filter made of them, `specific_force_*` has no
  noise.
- Wind is the same everywhere but for gusts (Dryden's spectra), and the ground is flat.
- Episodes that went wrong are kept and end where they were given up: filter by `outcome` in `flights`.
"""


def card(
    campaign: Campaign, summary: dict[str, Any], record: dict[str, Any], flights: Sequence[Column], mcap: bool
) -> str:
    """DATACARD.md. summary: counts of `dataset.conclude`; flights: columns of the table of episodes."""
    return _CARD.format(
        name=campaign.name,
        description=campaign.description or "Simulated flights of the YawSitter tail-sitter.",
        episodes=summary["episodes"],
        samples=summary["samples"],
        rate_hz=campaign.trace_rate_hz,
        hours=summary["hours"],
        megabytes=summary["bytes"] / 1e6,
        outcomes=", ".join(f"{count} {word}" for word, count in summary["outcomes"].items()),
        splits="".join(
            f"| {word} | {count} | {summary['split_samples'][word]} | `traces/{word}/*.parquet` |\n"
            for word, count in summary["splits"].items()
        ),
        block=sum(campaign.split),
        shares=" : ".join(map(str, campaign.split)),
        mcap="\n`mcap/*/episode-*.mcap` have the same columns, a file an episode." if mcap else "",
        sample_columns=_columns(TRACE),
        episode_columns=_columns(flights),
        command=record["command"],
        settings=campaign.document.text.rstrip(),
        draws_seed=campaign.draws_seed,
        first_seed=FIRST_SEED,
        versions=", ".join(f"{name} {version}" for name, version in record["versions"].items()),
        sources=record["simulator"],
        digest=record["cases"],
    )


def _columns(columns: Sequence[Column]) -> str:
    head = "| column | type | unit | frame | |\n|---|---|---|---|---|\n"
    return head + "".join(f"| `{c.name}` | {c.kind} | {c.unit} | {c.frame} | {c.text} |\n" for c in columns)
