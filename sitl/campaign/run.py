"""Flying a campaign, or a data set, from its plan to its folder: what is not flown yet."""

import argparse
import importlib.util
import json
import os
import platform
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

from gcs_tools import results as folders
from sitl.atomic import atomically
from sitl.campaign.cases import Case, Equipment, cases, digest, equip
from sitl.campaign.file import Campaign
from sitl.campaign.flight import Flight, Job, fingerprint
from sitl.campaign.progress import Progress
from sitl.campaign.results import FIGURES, HEAD, TAIL, TRACE, Column, schema, setting_column
from sitl.campaign.store import Store
from sitl.campaign.workers import local
from sitl.strict_yaml import ConfigError

RECORD = "campaign.json"
COPY = "campaign.yaml"
FLUSH_FLIGHTS = 50  # between two writings of parts that are not complete
PART_FLIGHTS, TRACED_PART_FLIGHTS = 100, 20
_PACKAGES = ("yawsitter-sitl", "numpy", "numba", "scipy", "pyarrow")


class StoppedError(Exception):
    """Ctrl-C; what was flown until then is on disk. Says how to go on."""


class Plan(NamedTuple):
    """A campaign ready to be flown. command: what was called. dataset: its flights are episodes, each with a split.

    mcap: its traces are written as .mcap too. record: what stands beside its results.
    """

    campaign: Campaign
    equipment: Equipment
    cases: list[Case]
    folder: Path
    command: str
    dataset: bool = False
    mcap: bool = False

    @property
    def record(self) -> dict[str, Any]:
        return {
            "name": self.campaign.name,
            "flights": len(self.cases),
            "cases": digest(self.campaign, self.cases, self.equipment),
            "simulator": fingerprint(),
            "mcap": self.mcap,
            "command": self.command,
            "versions": versions(),
        }

    def job(self, case: Case) -> Job:
        every = self.campaign.trace_every
        hz = self.campaign.trace_rate_hz if every and case.number % every == 0 else 0.0
        return Job(case, hz, tuple(self.campaign.success.items()), self.mcap)

    def split(self, index: int) -> str:
        return split(index, self.campaign.split) if self.dataset else ""

    def flight_columns(self) -> list[Column]:
        varied = [setting_column(name, isinstance(value, str)) for name, value in self.cases[0].varied]
        head = [c for c in HEAD if self.dataset or c.name != "split"]
        return [*head, *varied, *FIGURES, *TAIL]


def versions() -> dict[str, str]:
    return {"python": platform.python_version()} | {name: metadata_version(name) for name in _PACKAGES}


def metadata_version(package: str) -> str:
    try:
        return str(metadata.version(package))
    except metadata.PackageNotFoundError:
        return "not installed as a package"


def need(*packages: str, extra: str) -> None:
    """Raises ConfigError that says what to install."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        raise ConfigError(f"needs {', '.join(missing)}: pip install 'yawsitter-sitl[{extra}]'")


def split(index: int, shares: tuple[int, int, int]) -> str:
    """Of an episode: each block of as many as the shares are together has its shares, in an order of its own."""
    import numpy as np

    words = [w for w, n in zip(("train", "validation", "test"), shares, strict=True) for _ in range(n)]
    block, place = divmod(index, len(words))
    order = np.random.Generator(np.random.PCG64(np.random.SeedSequence((block, len(words))))).permutation(len(words))
    return str(words[order[place]])


def plan(
    campaign: Campaign, beside: Path, folder: Path, command: str, dataset: bool = False, mcap: bool = False
) -> Plan:
    """All cases, checked. beside: where the campaign's relative paths begin. Raises ConfigError."""
    equipment = equip(campaign, beside)
    for name, spec in equipment.vehicles.items():
        rate = spec.control_rate_hz / campaign.trace_rate_hz
        if campaign.trace_every and rate != int(rate):
            campaign.document.fault(
                "trace_rate_hz",
                f"{campaign.trace_rate_hz:g} is no divisor of {name}'s {spec.control_rate_hz} control steps a second",
            )
    return Plan(campaign, equipment, cases(campaign, equipment, beside), folder, command, dataset, mcap)


def open_store(p: Plan, resume: bool) -> tuple[Store, list[dict[str, Any]]]:
    """The store of a plan and the rows that it has already. Raises ConfigError for a folder that is another's."""
    record, at = p.record, p.folder / RECORD
    if at.exists():
        if not resume:
            raise ConfigError(f"{p.folder}: holds a campaign: --resume goes on with it, or choose another --out")
        before = json.loads(at.read_text(encoding="utf-8"))
        for key, what in (
            ("cases", "has other flights than these"),
            ("simulator", "was flown by another version"),
            ("mcap", "was begun with or without --mcap, unlike now"),
        ):
            if before.get(key) != record[key]:
                raise ConfigError(f"{p.folder}: {what}: choose another --out")
    elif p.folder.is_dir() and any(p.folder.iterdir()):
        raise ConfigError(f"{p.folder}: is neither empty nor a campaign's: choose another --out")
    folders.prepare(p.folder)
    about = {k: v if isinstance(v, str) else json.dumps(v) for k, v in record.items() if k != "command"}
    size = TRACED_PART_FLIGHTS if p.campaign.trace_every else PART_FLIGHTS
    store = Store(
        p.folder, len(p.cases), size, schema(p.flight_columns(), about), schema(list(TRACE), about), p.split
    )  # fmt: skip
    if at.exists():
        return store, store.resume()
    for name, text in p.equipment.texts.items():
        _put(p.folder / name, text)
    _put(p.folder / COPY, p.campaign.document.text)
    _put(at, json.dumps(record, indent=1) + "\n")
    return store, []


def _put(path: Path, text: str) -> None:
    atomically(path, lambda to: to.write_text(text, encoding="utf-8"))


def fly(p: Plan, args: argparse.Namespace) -> None:
    """Fly what isn't yet, into the plan's folder. Raises ConfigError, WorkerError, StoppedError, OSError."""
    store, rows = open_store(p, args.resume)
    failures = sum(row["outcome"] != "completed" for row in rows)
    jobs = [p.job(case) for case in p.cases if case.number not in store.done]
    if not jobs:
        return
    try:
        with Progress(len(p.cases), len(store.done), failures, quiet=args.json) as progress:
            for flight in _flights(p.equipment, jobs, args):
                if p.dataset:
                    flight.row["split"] = p.split(flight.number)
                store.add(flight)
                progress.tick(flight)
                if progress.done % FLUSH_FLIGHTS == 0:
                    store.flush()
    except KeyboardInterrupt:
        store.flush()
        done = f"{len(store.done)} of {len(p.cases)} flights are kept in {p.folder}"
        raise StoppedError(f"interrupted; {done}. To go on: {_again(p.command)}") from None
    finally:
        store.flush()


def _again(command: str) -> str:
    return command if "--resume" in command.split() else f"{command} --resume"


def _flights(equipment: Equipment, jobs: Sequence[Job], args: argparse.Namespace) -> Iterator[Flight]:
    if args.cluster is None:
        return local(equipment, jobs, args.workers or os.cpu_count() or 1)
    from sitl.campaign.cluster import cluster

    return cluster(equipment, jobs, args.cluster)
