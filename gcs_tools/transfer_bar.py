"""How a download is getting on, on stderr: a bar on a terminal, nothing elsewhere."""

import sys
from types import TracebackType
from typing import Any

from gcs_tools.blocks import Blocks

REDRAW_S = 0.1


class TransferBar:
    """`show` notes what has come; `update`, called often, draws it ten times a second at most."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._tasks: dict[str, Any] = {}
        self._news: tuple[str, Blocks] | None = None
        self._drawn_s = 0.0

    def __enter__(self) -> "TransferBar":
        if sys.stderr.isatty():
            from rich import progress
            from rich.console import Console

            self._bar = progress.Progress(
                progress.TextColumn("{task.description}"),
                progress.BarColumn(),
                progress.DownloadColumn(),
                progress.TransferSpeedColumn(),
                console=Console(stderr=True),
                auto_refresh=False,
            )
            self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._bar is not None:
            self._draw()
            self._bar.stop()

    def show(self, name: str, blocks: Blocks) -> None:
        self._news = name, blocks
        if not blocks.left:
            self._draw()

    def update(self, wall_s: float) -> None:
        if wall_s - self._drawn_s >= REDRAW_S:
            self._drawn_s = wall_s
            self._draw()

    def _draw(self) -> None:
        if self._bar is None or self._news is None:
            return
        name, blocks = self._news
        if name not in self._tasks:
            self._tasks[name] = self._bar.add_task(name, total=blocks.size)
        self._bar.update(self._tasks[name], completed=round(blocks.share * blocks.size))
        self._bar.refresh()
