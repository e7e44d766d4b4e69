"""How a campaign is getting on, on stderr: a bar on a terminal, a plain line now and then elsewhere."""

import sys
from types import TracebackType
from typing import Any

from gcs_tools.link import now_s
from sitl.campaign.flight import Flight

REDRAW_S = 0.2
LINE_S = 10.0  # between plain lines


def clock(seconds: float) -> str:
    """0:07, 12:34, 1:02:03"""
    whole = round(seconds)
    minutes = f"{whole // 60 % 60}:{whole % 60:02d}"
    return minutes if whole < 3600 else f"{whole // 3600}:{minutes:0>5}"


class Progress:
    """total: flights in all, before: of them those flown already. The failures are those of this run and before."""

    def __init__(self, total: int, before: int, failures: int, *, quiet: bool = False) -> None:
        self._total, self._before, self._failures, self._quiet = total, before, failures, quiet
        self._live = not quiet and sys.stderr.isatty()
        self._bar: Any = None
        self._task: Any = None
        self.done, self.simulated_s = before, 0.0
        self._start_s = self._drawn_s = now_s()

    @property
    def took_s(self) -> float:
        return now_s() - self._start_s

    def __enter__(self) -> "Progress":
        if self._live:
            from rich import progress
            from rich.console import Console

            self._bar = progress.Progress(
                progress.BarColumn(30),
                progress.MofNCompleteColumn(),
                progress.TextColumn("{task.description}"),
                console=Console(stderr=True),
                auto_refresh=False,
                transient=True,
            )
            self._task = self._bar.add_task("starting", total=self._total, completed=self._before)
            self._bar.start()
        elif not self._quiet:
            print(f"{self._total - self._before} flights to fly", file=sys.stderr)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.stop()
        if not self._quiet:
            print(f"{self.done}/{self._total} flights, {self._rates()}", file=sys.stderr)

    def tick(self, flight: Flight) -> None:
        self.done += 1
        self.simulated_s += flight.row["simulated_s"]
        self._failures += flight.row["outcome"] != "completed"
        at_s = now_s()
        if at_s - self._drawn_s < (REDRAW_S if self._live else LINE_S) or self._quiet:
            return
        self._drawn_s = at_s
        if self._bar is not None:
            self._bar.update(self._task, completed=self.done, description=self._rates())
            self._bar.refresh()
        else:
            print(f"{self.done}/{self._total} flights, {self._rates()}", file=sys.stderr)

    def _rates(self) -> str:
        took_s, flown = max(self.took_s, 1e-9), self.done - self._before
        left = self._total - self.done
        words = [f"{self.simulated_s / took_s:.0f} × real time", f"{self._failures} not completed"]
        if left and flown:
            words.insert(1, f"{clock(took_s / flown * left)} left")
        elif flown:
            words.insert(1, f"{clock(took_s)} taken")
        return ", ".join(words)
