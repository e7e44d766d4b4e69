"""The tab to fly from: motors, modes, missions; the wind the vehicle flies in, and how time passes for it."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from gcs_tools import commands
from gcs_tools import plan as plans
from gcs_tools.plan import Streamed
from gcs_tools.view.pilot import Task
from gcs_tools.view.pilot_thread import PilotThread
from gcs_tools.view.widgets import Buttons, ParameterSlider
from sitl.mavlink.codec import mav
from sitl.strict_yaml import ConfigError

if TYPE_CHECKING:
    from gcs_tools.view.page import Page

HEIGHT_M = 2.5
SPEEDS = {"0.2": 0.2, "1": 1.0, "2": 2.0, "10": 10.0, "max": 0.0}
STEPS_MS = (2.0, 20.0, 100.0, 1000.0)
WIND_M_S = 8.0
GUST_M_S = 3.0


class FlightPanel:
    def __init__(self, page: "Page", thread: Callable[[], PilotThread | None], missions: Mapping[str, Path]) -> None:
        self._thread = thread
        self._missions = missions
        gui = self._gui = page.server.gui
        self._buttons: list[Buttons] = []
        with page.tabs.add_tab("Fly"):
            with gui.add_folder("Flight"):
                self._row("Motors", {"Arm": commands.arm, "Disarm": commands.disarm})
                self._height = gui.add_number("Height m", HEIGHT_M, min=0.5, max=120.0, step=0.5)
                self._row(
                    "",
                    {
                        "Take off": lambda client: commands.takeoff(client, height_m=self._height.value, wait=False),
                        "Hold": lambda client: commands.mode(client, "hold"),
                        "Land": lambda client: commands.land(client, wait=False),
                        "Return": lambda client: commands.return_home(client, wait=False),
                    },
                )
            with gui.add_folder("Mission"):
                self._mission = gui.add_dropdown("File", tuple(self._missions) or ("none here",))
                self._start = Buttons(gui, "", {"Fly it": self._fly})
                self._stop = Buttons(gui, "", {"Stop and land": self._give_up})
                self._progress = gui.add_progress_bar(0.0, visible=False)
            with gui.add_folder("Wind m/s"):
                self._sliders = [
                    ParameterSlider(gui, name, label, -WIND_M_S, WIND_M_S, 0.1, hint=f"the air moves so, {name}")
                    for label, name in (("north", "SIM_WIND_N"), ("east", "SIM_WIND_E"), ("down", "SIM_WIND_D"))
                ]
                self._sliders.append(ParameterSlider(gui, "SIM_GUST", "gusts", 0.0, GUST_M_S, 0.1, hint="SIM_GUST"))
                self._write_row("", {"Calm": {s.name: 0.0 for s in self._sliders}})
            with gui.add_folder("Time"):
                self._run = Buttons(gui, "", {"Pause": partial(self._write, {"SIM_PAUSE": 1.0})})
                self._go_on = Buttons(gui, "", {"Go on": partial(self._write, {"SIM_PAUSE": 0.0})})
                self._write_row("Speed ×", {text: {"SIM_SPEED": value} for text, value in SPEEDS.items()})
                self._write_row("Step ms", {f"{ms:g}": {"SIM_PAUSE": 1.0, "SIM_STEP_MS": ms} for ms in STEPS_MS})

    def _row(self, label: str, tasks: dict[str, Task]) -> None:
        self._buttons.append(Buttons(self._gui, label, {text: partial(self._ask, tasks[text]) for text in tasks}))

    def _write_row(self, label: str, writes: dict[str, dict[str, float]]) -> None:
        self._buttons.append(Buttons(self._gui, label, {text: partial(self._write, writes[text]) for text in writes}))

    def _ask(self, task: Task) -> None:
        thread = self._thread()
        if thread is not None:
            thread.pilot.ask(task)

    def _write(self, values: dict[str, float]) -> None:
        thread = self._thread()
        if thread is not None:
            for name, value in values.items():
                thread.pilot.write(name, value)

    def _fly(self) -> None:
        """Read the file as it is now, and fly it."""
        thread, path = self._thread(), self._missions.get(self._mission.value)
        if thread is None or path is None:
            return
        try:
            plan = plans.load(path)
        except ConfigError as error:
            thread.pilot.note(mav.MAV_SEVERITY_WARNING, str(error))
            return
        if isinstance(plan, Streamed):
            thread.stream(plan)
        else:
            thread.pilot.ask(lambda client: commands.mission(client, plan))

    def _give_up(self) -> None:
        thread = self._thread()
        if thread is not None and thread.sortie is not None:
            thread.sortie.give_up()

    def update(self, thread: PilotThread, wall_s: float) -> None:
        pilot = thread.pilot
        for buttons in self._buttons:
            buttons.show(pilot.up)
        paused = bool(pilot.value("SIM_PAUSE"))
        self._run.show(enabled=pilot.up, visible=not paused)
        self._go_on.show(enabled=pilot.up, visible=paused)
        for slider in self._sliders:
            slider.show(pilot, wall_s)
        streams, known = thread.streams, self._mission.value in self._missions
        self._start.show(enabled=pilot.up and known, visible=not streams)
        self._stop.show(enabled=True, visible=streams)
        flight = thread.sortie.flight if streams and thread.sortie is not None else None
        self._progress.visible = flight is not None
        if flight is not None:
            self._progress.value = round(100.0 * flight.progress, 1)
