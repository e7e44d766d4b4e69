"""The page: what is on it, and its update thirty times a second.

The layout: plots in a column on the left, the 3D scene in the middle, on the right the main panel with the choice of
vehicle and tabs. Whatever is chosen there is shared by all browsers; the camera is each browser's own.

Where others plug in: a part gets the page when it is built, adds its tab with `page.tabs.add_tab(...)`, and hangs a
function on `page.each_tick`, which is called with the wall time, thirty times a second, in the page's thread. It looks
at `page.selected`, the vehicle that is shown (None before there is one), each time anew: another may be chosen, or the
same one started again (`vehicle.epoch` then has changed). Parts are built in `run.run`, after the page. What takes
longer than a millisecond, a MAVLink conversation say, runs in a thread of its own and only leaves its results to the
tick. A part that commands vehicles is left out where `page.live` is false: a recording can't be commanded.
"""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import viser

from gcs_tools.view.feed import Status
from gcs_tools.view.replay import Replay
from gcs_tools.view.vehicle import Vehicle

BRAND_RGB = (37, 99, 170)


class Source(Protocol):
    """Where vehicles come from: feed.Feed or replay.Replay."""

    @property
    def vehicles(self) -> Mapping[int, Vehicle]: ...
    @property
    def status(self) -> Status: ...
    def poll(self, wall_s: float) -> None: ...
    def close(self) -> None: ...


class Page:
    CAMERA_ORDER = 2.0  # of each browser's own row of buttons, between the choice of vehicle and the tabs

    def __init__(self, server: viser.ViserServer, source: Source) -> None:
        from gcs_tools.view.cameras import Cameras
        from gcs_tools.view.plots import Plots
        from gcs_tools.view.readouts import Readouts
        from gcs_tools.view.replay_bar import ReplayBar
        from gcs_tools.view.scene import Scene
        from gcs_tools.view.view_tab import ViewTab

        self.server, self.source = server, source
        self.live = not isinstance(source, Replay)
        self.each_tick: list[Callable[[float], None]] = []
        self.selected: Vehicle | None = None
        self.wall_s = 0.0  # of the tick under way, or the last
        gui = server.gui
        gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, brand_color=BRAND_RGB)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(340.0)
        self._status = gui.add_markdown("", order=0.0)
        self._said = ""
        self._choice = gui.add_dropdown("Vehicle", ("none yet",), visible=False, order=1.0)
        self._offered: tuple[str, ...] = ()
        self.tabs = gui.add_tab_group(order=3.0)
        self.scene = Scene(server)
        readouts = Readouts(self)
        self.view_tab = self.tabs.add_tab("View")
        self._parts: list[Any] = [readouts, ViewTab(self), Plots(self), Cameras(self)]
        if isinstance(source, Replay):
            self._parts.append(ReplayBar(self, source))

    def tick(self, wall_s: float) -> None:
        """Take what the source has, and bring the page up to it."""
        self.wall_s = wall_s
        self.source.poll(wall_s)
        with self.server.atomic():
            self._choose()
            self._say()
            self.scene.update(self.source.vehicles, self.selected, wall_s)
            for part in self._parts:
                part.update(self.selected, wall_s)
            for function in self.each_tick:
                function(wall_s)

    def _choose(self) -> None:
        """Offer the vehicles that were ever there, and keep to the chosen one."""
        vehicles = self.source.vehicles
        names = tuple(vehicles[k].name for k in sorted(vehicles))
        if names != self._offered:
            before = self.selected.instance if self.selected else None
            self._offered = names
            self._choice.options = names or ("none yet",)
            self._choice.visible = len(names) > 1
            if before is not None:
                self._choice.value = vehicles[before].name
        if names:
            self.selected = next(v for v in vehicles.values() if v.name == self._choice.value)

    def _say(self) -> None:
        """One line that tells how things stand where they are not as usual."""
        vehicle, status = self.selected, self.source.status
        if vehicle is None:
            text = f"**Waiting for a vehicle.** {status.text}"
        elif not vehicle.alive:
            text = f"**{vehicle.name} is gone.** What is shown is its last state. {status.text}"
        elif vehicle.instant is None:
            text = f"**{vehicle.name}** is starting."
        else:
            text = ""
        if text != self._said:
            self._said = text
            self._status.content = text
            self._status.visible = bool(text)
