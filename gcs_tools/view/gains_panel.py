"""The tab with the gains: a slider for each, and buttons that put it back to the paper's or the tuned value."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import sitl
from gcs_tools.parameter import number_text
from gcs_tools.view.pilot import Pilot
from gcs_tools.view.widgets import Buttons, ParameterSlider, nice
from sitl.vehicle_spec import load_gains

if TYPE_CHECKING:
    from gcs_tools.view.page import Page

SETS = ("paper", "tuned")
ROOM = 2.0  # of a scale beyond the largest value that a set has


class Loop(NamedTuple):
    """A loop's rows: the first part of its parameters' names, its tab's label, axes and terms with their units."""

    name: str
    label: str
    axes: dict[str, str]
    units: dict[str, str]


_NED = {"X": "north", "Y": "east", "Z": "down"}
LOOPS = (
    Loop("POS", "Pos", _NED, {"P": "1/s", "I": "1/s²", "D": ""}),
    Loop("VEL", "Vel", _NED, {"P": "1/s", "I": "1/s²", "D": ""}),
    Loop("ATT", "Att", {"X": "roll φ", "Y": "pitch θ", "Z": "yaw ψ"}, {"P": "1/s", "I": "1/s²", "D": ""}),
    Loop("RATE", "Rate", {"X": "roll p", "Y": "pitch q", "Z": "yaw r"}, {"P": "N·m·s", "I": "N·m", "D": "N·m·s²"}),
)


class GainsPanel:
    def __init__(self, page: "Page", pilot: Callable[[], Pilot | None]) -> None:
        self._gui, self._pilot = page.server.gui, pilot
        folder = Path(sitl.__file__).parent / "gains"
        self._sets = {name: load_gains(folder / f"{name}.yaml") for name in SETS}
        self._sliders: list[ParameterSlider] = []
        self._buttons: list[Buttons] = []
        with page.tabs.add_tab("Gains"):
            self._put_back("all gains", [name for loop in LOOPS for name in _names(loop)])
            loops = self._gui.add_tab_group()
            for loop in LOOPS:
                with loops.add_tab(loop.label):
                    self._loop(loop)

    def _loop(self, loop: Loop) -> None:
        self._put_back("this loop", list(_names(loop)))
        for axis, what in loop.axes.items():
            with self._gui.add_folder(f"{axis.lower()}  {what}"):
                for term, unit in loop.units.items():
                    self._gain(loop, axis, term, unit)

    def _gain(self, loop: Loop, axis: str, term: str, unit: str) -> None:
        name = f"{loop.name}_{axis}_{term}"
        top = self._top(loop, term)
        marks = tuple(sorted({values[name] for values in self._sets.values()}))
        label = f"{term} {unit}".strip()
        self._sliders.append(
            ParameterSlider(self._gui, name, label, 0.0, top, 0.001, marks=marks, hint=f"parameter {name}")
        )
        self._put_back("", [name])

    def _top(self, loop: Loop, term: str) -> float:
        """The same end of the scale for all axes; a term that no set uses gets a tenth of the proportional one's."""
        largest = max(values[f"{loop.name}_{axis}_{term}"] for values in self._sets.values() for axis in loop.axes)
        return nice(ROOM * largest) if largest else nice(0.1 * self._top(loop, "P"))

    def _put_back(self, label: str, names: list[str]) -> None:
        """Buttons that write these gains as a set has them; of a single one they tell the value."""
        actions = {}
        for kind, values in self._sets.items():
            text = f"{kind} {number_text(values[names[0]])}" if len(names) == 1 else kind
            actions[text] = partial(self._write, {name: values[name] for name in names})
        self._buttons.append(Buttons(self._gui, label, actions))

    def _write(self, values: dict[str, float]) -> None:
        pilot = self._pilot()
        for name, value in values.items():
            if pilot is not None and pilot.value(name) != value:
                pilot.write(name, value)

    def update(self, pilot: Pilot, wall_s: float) -> None:
        for slider in self._sliders:
            slider.show(pilot, wall_s)
        for buttons in self._buttons:
            buttons.show(pilot.up)


def _names(loop: Loop) -> Iterator[str]:
    return (f"{loop.name}_{axis}_{term}" for axis in loop.axes for term in loop.units)
