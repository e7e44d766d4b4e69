"""An episode as .mcap: the columns of its trace as JSON messages on one topic, for viewers such as Foxglove."""

import io
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sitl.campaign.results import TRACE, Column

TOPIC = "yawsitter/episode"
_COLUMNS = TRACE[2:]  # behind index and time


def schema() -> dict[str, Any]:
    """The messages' JSON schema, units and frames in the descriptions."""
    return {
        "type": "object",
        "properties": {"t_s": {"type": "number", "description": "[s] from the start of the flight"}}
        | {c.name: {"type": "number", "description": _text(c)} for c in _COLUMNS},
    }


def _text(c: Column) -> str:
    frame = f", in {c.frame}" if c.frame else ""
    return f"[{c.unit or '1'}{frame}] {c.text}"


def recording(trace: list[NDArray[Any]], row: dict[str, Any]) -> bytes:
    """The file. Log times are simulation time from the start of the flight; the row is its metadata. Needs mcap."""
    from mcap.writer import Writer

    file = io.BytesIO()
    writer = Writer(file)
    writer.start(profile="", library="yawsitter-sitl")
    known = writer.register_schema("Episode", "jsonschema", json.dumps(schema()).encode())
    channel = writer.register_channel(TOPIC, "json", known)
    writer.add_metadata("episode", {name: str(value) for name, value in row.items()})
    names = [c.name for c in _COLUMNS]
    t, values = trace[0].tolist(), np.stack(trace[1:], axis=1).astype(float).round(7).tolist()
    for at_s, sample in zip(t, values, strict=True):
        data = json.dumps({"t_s": at_s, **dict(zip(names, sample, strict=True))}).encode()
        at_ns = max(0, round(at_s * 1e9))
        writer.add_message(channel, at_ns, data, at_ns)
    writer.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()
