"""What each client was seen to say: `clients.yaml`, written by the tests that run the clients."""

import os
from pathlib import Path

import msgspec
import yaml

from conformance.observation import UNSUPPORTED, Observation

CLIENTS: dict[str, str | None] = {
    "QGroundControl": None,  # a script after its sources: see tests/e2e/test_client_qgroundcontrol.py
    "MAVSDK 3": "mavsdk-grpc",
    "MAVSDK 4": "mavsdk",
    "MAVProxy": "MAVProxy",
    "pymavlink": "pymavlink",
}
"""By name: the package that it comes in."""

PATH = Path(__file__).with_name("clients.yaml")
WRITE = "CONFORMANCE_WRITE"  # environment variable: take what is seen down instead of comparing


def load() -> dict[str, Observation]:
    """By client."""
    return msgspec.convert(yaml.safe_load(PATH.read_text()), dict[str, Observation]) if PATH.exists() else {}


def note(client: str, seen: Observation) -> None:
    """Compare what was seen with what is written down, or take it down. Raises AssertionError for a new refusal."""
    known = load()
    if os.environ.get(WRITE):
        known[client] = seen
        PATH.write_text(yaml.safe_dump(msgspec.to_builtins(known), default_flow_style=None, width=120))
        return
    assert client in known, f"{client} is not in {PATH.name} yet; `make docs` takes it down"
    news = _news(known[client], seen)
    assert not news, f"{client} got no answer, or unsupported: {news}; `make docs` takes it down if it is to be so"


def _news(known: Observation, seen: Observation) -> list[str]:
    """What goes without an answer, or is answered with unsupported, and isn't known to be."""
    news = [name for name, answered in seen.messages.items() if not answered and known.messages.get(name, True)]
    for kind in ("commands", "requests", "rates"):
        before, now = getattr(known, kind), getattr(seen, kind)
        news += [what for what in now if UNSUPPORTED in now[what] and UNSUPPORTED not in before.get(what, ())]
    return news
