"""docs/link.md's part about clients: made of what the code declares and of what the clients were seen to do."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from conformance.clients import CLIENTS
from conformance.observation import Observation, command_name
from sitl.mavlink.actions import TABLE
from sitl.mavlink.codec import by_id
from sitl.mavlink.endpoint import Endpoint
from sitl.mavlink.identity import MODE_CODES
from sitl.mavlink.requests import ONE_SHOT
from sitl.mavlink.streams import STREAMS, PortKind
from sitl.vehicle import Vehicle
from sitl.vehicle_spec import load_vehicle

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "link.md"
BEGIN, END = "<!-- made by `make docs`: begin -->", "<!-- made by `make docs`: end -->"
YES, SILENCE = "✓", "no answer"

Row = tuple[str, ...]


def page(text: str, seen: Mapping[str, Observation]) -> str:
    """The page with its made part made afresh."""
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n\n{as_markdown(seen)}\n{END}{after}"


def as_markdown(seen: Mapping[str, Observation]) -> str:
    takes = Endpoint(Vehicle(load_vehicle("yawsitter"))).takes
    parts = [
        "### Modes",
        _table(("mode", "main/sub", "custom_mode"), _modes()),
        "### Versions seen",
        _table(("client", "version"), _versions()),
        "### Messages that the vehicle takes",
        f"{YES} sent by the client, and answered where an answer is due.",
        _matrix("message", sorted(takes), lambda name, o: _answered(name, o), seen),
        "### Messages that clients send and the vehicle leaves alone",
        _matrix("message", _others(takes, (o.messages for o in seen.values())), _sent, seen),
        "### Commands",
        "The results that each client was seen to get. Reasons for refusals are in [commands](commands.md).",
        _matrix("command", _commands(seen), lambda name, o: ", ".join(o.commands.get(name.split(" ")[0], ())), seen),
        "### Messages on request",
        "REQUEST_MESSAGE and its relatives, of these and of the streams below; what else clients ask for is denied.",
        _matrix("message", _requested(seen), lambda name, o: ", ".join(o.requests.get(name, ())), seen),
        "### Streams",
        f"Default rates in Hz of simulation time, ground stations' port / onboard port; {YES} the client set a rate.",
        _matrix("message", _streams(), _rate, seen),
    ]
    return "\n\n".join(parts) + "\n"


def _matrix(head: str, rows: Iterable[str], cell: object, seen: Mapping[str, Observation]) -> str:
    body = [(row, *(cell(row, seen[client]) if client in seen else "" for client in CLIENTS)) for row in rows]
    return _table((head, *CLIENTS), body)


def _table(head: Row, rows: Iterable[Row]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _modes() -> list[Row]:
    return [(code.name, f"{code.main}/{code.sub}", str(code.custom_mode)) for code in MODE_CODES.values()]


def _versions() -> list[Row]:
    pins = dict(re.findall(r"^([\w.-]+)==(\S+)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE))
    return [
        (client, f"`{package}` {pins[package]}" if package else "a script after its sources")
        for client, package in CLIENTS.items()
    ]


def _answered(name: str, o: Observation) -> str:
    return "" if name not in o.messages else YES if o.messages[name] else SILENCE


def _sent(name: str, o: Observation) -> str:
    return "sent" if name in o.messages else ""


def _others(known: Sequence[str], asked: Iterable[Iterable[str]]) -> list[str]:
    return sorted({name for names in asked for name in names} - set(known))


def _commands(seen: Mapping[str, Observation]) -> list[str]:
    known = [f"{command_name(number)} ({number})" for number in sorted(TABLE)]
    names = [name.split(" ")[0] for name in known]
    return known + _others(names, (o.commands for o in seen.values()))


def _requested(seen: Mapping[str, Observation]) -> list[str]:
    known = sorted(by_id(number).name for number in ONE_SHOT)
    return known + _others(known, (o.requests for o in seen.values()))


def _streams() -> list[str]:
    rows = {}
    for stream in STREAMS:
        gcs, onboard = (stream.rates_Hz.get(kind, 0) for kind in (PortKind.GCS, PortKind.ONBOARD))
        rows[f"{stream.definition.name} {gcs:g} / {onboard:g}"] = None
    return list(rows)


def _rate(row: str, o: Observation) -> str:
    return YES if "accepted" in o.rates.get(row.split(" ")[0], ()) else ""
