"""`gcs tune auto`: from the parsed arguments to a gains file and what it gains."""

import argparse
import importlib.util
import json
import os
import sys
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.markup import escape

from gcs_tools.client import LinkError
from gcs_tools.link import now_s
from gcs_tools.table import plain
from gcs_tools.tune import cost, gain_sets, loops
from gcs_tools.tune.cost import Air, Task
from gcs_tools.tune.search import Candidate, Space, Standing, population, processes, search
from sitl.strict_yaml import ConfigError
from sitl.vehicle import Vehicle, load_vehicle

ALL = "all"
_ALL_STEPS = ("position.x", "position.y", "position.z")  # they shake the loops inside too


def run(args: argparse.Namespace) -> None:
    """Raises ConfigError for what can't be used, LinkError where nothing could be judged, KeyboardInterrupt."""
    if importlib.util.find_spec("cmaes") is None:
        raise ConfigError("the search needs cmaes: pip install 'yawsitter-sitl[tune]'")
    if not args.out.parent.is_dir():
        raise ConfigError(f"--out {args.out}: there is no folder {args.out.parent}")
    settings = tuple(args.set or ())
    vehicle = Vehicle(load_vehicle(args.vehicle), overrides=dict(settings))
    own = {name: vehicle.parameters[name] for name in loops.GAIN_NAMES}
    begin = gain_sets.load(args.begin)
    start = {name: float(f"{value:.5g}") for name, value in (own | dict(begin.gains or {})).items()}
    space = _space(vehicle, start, args.loops, args.terms)
    task = Task(args.vehicle, settings, _manoeuvres(args.loops, args.course), _airs(args))
    for name in task.manoeuvres:
        if name not in loops.LOOPS:
            cost.course(name)  # what can't be read is told before anything is flown
    standing: Standing | None = None
    total = 1 + -(-(max(args.budget, 2) - 1) // population(len(space.names))) * population(len(space.names))
    try:
        workers = args.workers or os.cpu_count() or 1
        with processes(workers) as pool, _Bar(total, quiet=args.json) as bar:
            for standing in search(task, start, space, budget=args.budget, seed=args.seed, pool=pool):
                bar.tick(standing)
                if standing.best.total < standing.start.total:
                    _keep(args, standing)
    except KeyboardInterrupt:
        if standing is not None:
            _conclude(args, task, space, standing)
        raise
    except BrokenProcessPool:
        raise LinkError(
            "a process that judges candidates was ended from outside; what was found until then is kept"
        ) from None
    assert standing is not None
    _conclude(args, task, space, standing)


def _manoeuvres(chosen: list[str], courses: list[Path] | None) -> tuple[str, ...]:
    steps = _ALL_STEPS if ALL in chosen else tuple(chosen)
    flown = tuple(map(str, courses)) if courses else (cost.TOUR,) if ALL in chosen else ()
    return (*steps, *flown)


def _airs(args: argparse.Namespace) -> tuple[Air, ...]:
    wind, gust = args.wind or (0.0, 0.0, 0.0), 0.5 if args.gust is None else args.gust
    return tuple(Air(seed, wind, gust) for seed in range(1, args.seeds + 1))


def _space(vehicle: Vehicle, start: dict[str, float], chosen: list[str], terms: str | None) -> Space:
    """The gains of the chosen loops: those terms, or those that are not 0. A rate's D counts only where it acts."""
    names = loops.GAIN_NAMES if ALL in chosen else [g for name in chosen for g in loops.parse(name).gains]
    kept = [name for name in names if (name[-1] in terms if terms else start[name] > 0.0)]
    if vehicle.parameters["CTL_RATE_D_TAU"] == 0.0:
        kept = [name for name in kept if not (name.startswith("RATE") and name.endswith("D"))]
    if not kept:
        raise ConfigError("there is no gain to seek: all of them are 0, or act on nothing; --terms names others")
    return Space(tuple(kept), tuple(vehicle.parameters.declaration(name).maximum for name in kept))


def _keep(args: argparse.Namespace, standing: Standing) -> None:
    told = (
        f"Found by gcs tune auto {' '.join(args.loops)} on {args.vehicle}, from {args.begin}, seed {args.seed}: cost "
    )
    told += f"{standing.start.total:.4g} -> {standing.best.total:.4g}"
    gain_sets.write(args.out, standing.best.gains, told)


def _conclude(args: argparse.Namespace, task: Task, space: Space, standing: Standing) -> None:
    better = standing.best.total < standing.start.total
    if args.json:
        print(json.dumps(_result(task, space, standing)))
    else:
        _show(args, task, space, standing)
    where = f"written to {args.out}" if better else "nothing better than the start was found: no file is written"
    print(where, file=sys.stderr if args.json else sys.stdout)


def _worst(candidate: Candidate, k: int) -> Any:
    return max(candidate.costs[k], key=lambda flight: flight.total)


def _result(task: Task, space: Space, standing: Standing) -> dict[str, Any]:
    def told(candidate: Candidate) -> dict[str, Any]:
        return {
            "cost": candidate.total,
            "gains": candidate.gains,
            "manoeuvres": {name: _worst(candidate, k)._asdict() for k, name in enumerate(task.manoeuvres)},
        }

    start, best = told(standing.start), told(standing.best)
    return {"vehicle": task.vehicle, "sought": space.names, "judged": standing.judged, "start": start, "best": best}


def _show(args: argparse.Namespace, task: Task, space: Space, standing: Standing) -> None:
    console, start, best = Console(), standing.start, standing.best
    flights = len(task.manoeuvres) * len(task.airs)
    title = f"{' '.join(args.loops)} · {args.vehicle} · {standing.judged} candidates, {flights} flights each"
    console.print(title, highlight=False, markup=False)
    table = plain(None)
    for heading in ("gain", args.begin, "found", "factor"):
        table.add_column(escape(heading), justify="left" if heading == "gain" else "right")
    for name in space.names:
        was, now = start.gains[name], best.gains[name]
        table.add_row(name, f"{was:.4g}", f"{now:.4g}", f"{now / was:.2f}" if was else "")
    console.print(table)
    table = plain(None)
    for heading in ("cost, worst flight", "tracking", "", "overshoot", "", "effort", "", "total", ""):
        table.add_column(heading, justify="left" if heading.startswith("cost") else "right")
    for k, name in enumerate(task.manoeuvres):
        a, b = _worst(start, k), _worst(best, k)
        cells = [f"{x:.3g}" for pair in zip(a[:3], b[:3], strict=True) for x in pair]
        table.add_row(escape(name), *cells, f"{a.total:.3g}", f"{b.total:.3g}")
    table.add_row("mean", *[""] * 6, f"{start.total:.4g}", f"{best.total:.4g}")
    console.print(table)
    for k, name in enumerate(task.manoeuvres):
        if _worst(start, k).fault:
            console.print(f"{name} with {args.begin}: {_worst(start, k).fault}", highlight=False, markup=False)


class _Bar:
    """On stderr: a bar on a terminal, a line a generation elsewhere, nothing when quiet."""

    def __init__(self, total: int, *, quiet: bool) -> None:
        self._total, self._quiet = total, quiet
        self._bar: Any = None
        self._task: Any = None
        self._start_s = now_s()

    def __enter__(self) -> "_Bar":
        if not self._quiet and sys.stderr.isatty():
            from rich import progress

            self._bar = progress.Progress(
                progress.BarColumn(30),
                progress.MofNCompleteColumn(),
                progress.TextColumn("{task.description}"),
                progress.TimeRemainingColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self._task = self._bar.add_task("judging the start", total=self._total)
            self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.stop()

    def tick(self, standing: Standing) -> None:
        rate = standing.judged / max(now_s() - self._start_s, 1e-9)
        told = f"best {standing.best.total:.4g} (start {standing.start.total:.4g}), {rate:.2g} candidates/s"
        if self._bar is not None:
            self._bar.update(self._task, completed=standing.judged, description=told)
        elif not self._quiet:
            print(f"{standing.judged}/{self._total} judged, {told}", file=sys.stderr)
