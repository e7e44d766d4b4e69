"""What the control panels are made of: rows of buttons that can be switched off, sliders that follow a parameter."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from gcs_tools.view.pilot import Pilot

HELD_S = 0.4  # after a drag, in which a slider stays where it was put: its writes are on the way
_STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
_DIGITS = 6


class Buttons:
    """A row of buttons with a label before it. viser can't switch such a row off: another that is off stands by."""

    def __init__(self, gui: Any, label: str, actions: Mapping[str, Callable[[], None]]) -> None:
        self._on = gui.add_button_group(label, tuple(actions), visible=False)
        self._off = gui.add_button_group(label, tuple(actions), disabled=True)
        self._shown = (False, True)
        self._on.on_click(lambda event: actions[event.target.value]())

    def show(self, enabled: bool, visible: bool = True) -> None:
        if (enabled, visible) != self._shown:
            self._shown = enabled, visible
            self._on.visible, self._off.visible = enabled and visible, not enabled and visible


class ParameterSlider:
    """Shows a parameter of whichever pilot `show` is given, and writes it when it is dragged.

    low, top: the scale's ends, which move if the value is beyond. Call `show` often, with the page's wall time.
    """

    def __init__(
        self,
        gui: Any,
        name: str,
        label: str,
        low: float,
        top: float,
        step: float,
        *,
        marks: tuple[float, ...] | None = None,
        hint: str | None = None,
    ) -> None:
        self.name = name
        self._pilot: Pilot | None = None
        self._touched = False
        self._held_s = -math.inf
        start = min(max(low, 0.0), top)
        self._slider = gui.add_slider(label, low, top, step, start, marks=marks, hint=hint, disabled=True)
        self._slider.on_update(self._moved)

    async def _moved(self, event: Any) -> None:
        """In the server's own thread, before anything else is heard of the slider."""
        if event.client is not None and self._pilot is not None:
            self._touched = True
            self._pilot.write(self.name, self._slider.value)

    def show(self, pilot: Pilot, wall_s: float) -> None:
        self._pilot = pilot if pilot.up else None
        if self._slider.disabled == pilot.up:
            self._slider.disabled = not pilot.up
        if self._touched:
            self._touched, self._held_s = False, wall_s + HELD_S
        if wall_s < self._held_s:
            return
        value = pilot.value(self.name)
        if value is None or value == self._slider.value:
            return
        if value > self._slider.max:
            self._slider.max = nice(value)
        if value < self._slider.min:
            self._slider.min = -nice(-value)
        self._slider.precision = max(self._slider.precision, digits(value))
        self._slider.value = value


def nice(x: float) -> float:
    """The end of a scale that reaches x > 0."""
    decade = 10.0 ** math.floor(math.log10(x))
    return next(round(k * decade, _DIGITS) for k in _STEPS if k * decade >= x * (1.0 - 1e-9))


def digits(x: float) -> int:
    """Decimals that x needs."""
    return next((k for k in range(_DIGITS) if round(x, k) == x), _DIGITS)
