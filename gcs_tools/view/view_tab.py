"""The tab that says what is drawn, and what the colours mean."""

import math
from typing import TYPE_CHECKING

from gcs_tools.view import forces
from gcs_tools.view.overlays import ERROR_FULL_M, Shown
from gcs_tools.view.vehicle import Vehicle

if TYPE_CHECKING:
    from gcs_tools.view.page import Page

PERIOD_S = 0.2
_ERROR_SCALE = (
    '<div style="font-size:12px;margin:.2em 1em .8em"><div style="height:8px;border-radius:4px;background:'
    'linear-gradient(90deg,#009690,#46b41e,#f09600,#dc1414)"></div><div style="display:flex;'
    f'justify-content:space-between;opacity:.7"><span>0</span><span>distance from the reference</span>'
    f"<span>≥ {ERROR_FULL_M * 100:.0f} cm</span></div></div>"
)


class ViewTab:
    def __init__(self, page: "Page") -> None:
        gui = page.server.gui
        self._scene = page.scene
        with page.view_tab:
            self._boxes = {
                "trail": gui.add_checkbox("flown path", True),
                "reference": gui.add_checkbox("reference", True),
                "mission": gui.add_checkbox("mission", True),
                "fence": gui.add_checkbox("fence", True),
                "wind": gui.add_checkbox("wind", True),
                "wake": gui.add_checkbox("slipstreams", True),
                "forces": gui.add_checkbox("forces", False),
            }
            self._legend = gui.add_html("")
        self._due_s = float("-inf")

    def update(self, vehicle: Vehicle | None, wall_s: float) -> None:
        shown = Shown(**{name: box.value for name, box in self._boxes.items()})
        self._scene.show(shown)
        if wall_s >= self._due_s:
            self._due_s = wall_s + PERIOD_S
            text = _ERROR_SCALE + (_forces(vehicle) if shown.forces and vehicle is not None else "")
            if text != self._legend.content:
                self._legend.content = text


def _forces(vehicle: Vehicle) -> str:
    """The forces' colours and sizes."""
    if vehicle.instant is None:
        return ""
    loads = vehicle.instant.loads
    rows = []
    for cause, load in (*loads.causes.items(), ("total", loads.total)):
        r, g, b = forces.colour(cause)
        rows.append(
            f'<tr><td style="color:rgb({r},{g},{b})">■</td><td style="padding:0 1em 0 .4em">'
            f'{cause.replace("_", " ")}</td><td style="text-align:right;font-variant-numeric:tabular-nums">'
            f"{math.hypot(*load.force_B_N):.2f} N</td></tr>"
        )
    return f'<table style="font-size:13px;margin:.2em 1em">{"".join(rows)}</table>'
