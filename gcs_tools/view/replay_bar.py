"""The replay's controls: time slider, play and pause, speed, in a window of their own over the scene."""

from typing import TYPE_CHECKING, Any

from gcs_tools.view.replay import Replay
from gcs_tools.view.vehicle import Vehicle

if TYPE_CHECKING:
    from gcs_tools.view.page import Page

SPEEDS = {"0.1 ×": 0.1, "0.25 ×": 0.25, "0.5 ×": 0.5, "1 ×": 1.0, "2 ×": 2.0, "5 ×": 5.0, "20 ×": 20.0}
STEP_S = 0.02
FOLLOW_S = 0.1  # how far the slider may be behind


class ReplayBar:
    def __init__(self, page: "Page", replay: Replay) -> None:
        self._replay = replay
        gui = page.server.gui
        panel = gui.add_panel()
        with panel.add_tab("Replay"):
            self._slider = gui.add_slider("time [s]", 0.0, max(STEP_S, round(replay.duration_s, 2)), STEP_S, 0.0)
            self._button = gui.add_button("Play")
            self._speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value="1 ×")
        panel.float(x=12.0, y=-12.0, width=460.0)

        @self._slider.on_update
        def _(event: Any) -> None:
            if event.client_id is not None:  # a hand moved it
                replay.seek(self._slider.value)

        @self._button.on_click
        def _(_event: Any) -> None:
            replay.toggle()

        @self._speed.on_update
        def _(_event: Any) -> None:
            replay.speed = SPEEDS[self._speed.value]

    def update(self, _vehicle: Vehicle | None, _wall_s: float) -> None:
        label = "Pause" if self._replay.playing else "Play"
        if self._button.label != label:
            self._button.label = label
        if self._replay.playing and abs(self._slider.value - self._replay.time_s) > FOLLOW_S:
            self._slider.value = round(self._replay.time_s, 2)
