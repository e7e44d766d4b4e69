"""The error table of a flight, beside the paper's."""

from typing import Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

# The paper's two tables "Position Tracking Errors at Key Waypoints and Overall Performance Metrics": x, y, z, final
# errors without their sign.
PAPER = {
    "rectangle": {
        "mae": (0.0317, 0.0135, 0.0099),
        "rmse": (0.0501, 0.0236, 0.0187),
        "iae": (2.2225, 0.9445, 0.6901),
        "max_overshoot": (0.2360, 0.1183, 0.0855),
        "final_error": (0.0007, 0.0023, 0.0026),
    },
    "circle": {
        "mae": (0.0178, 0.0162, 0.0056),
        "rmse": (0.0238, 0.0242, 0.0066),
        "iae": (0.9788, 0.8933, 0.3061),
        "max_overshoot": (0.0728, 0.1330, 0.0143),
        "final_error": (0.0037, 0.0056, 0.0009),
    },
}
ROWS = (
    ("mae", "MAE [m]"),
    ("rmse", "RMSE [m]"),
    ("iae", "IAE [m·s]"),
    ("max_overshoot", "max |error| [m]"),
    ("final_error", "final |error| [m]"),
)


AXES = ("x", "y", "z")


def show(result: dict[str, Any], paper: str | None, console: Console | None = None) -> None:
    """Print the result of a flight; `paper` names the published table to put beside it."""
    console = console or Console()
    published = PAPER[paper] if paper else None
    title = f"{result['mission']} · {result['vehicle'] or 'unnamed vehicle'} · {result['duration_s']:g} s"
    table = plain(f"{title} · paper, flown, ratio" if published else title)
    table.add_column("")
    for axis in AXES:
        if published:
            table.add_column(axis, justify="right", style="dim")
        table.add_column("" if published else axis, justify="right")
        if published:
            table.add_column("", justify="right")
    for key, label in ROWS:
        cells = [escape(label)]
        for k, value in enumerate(result[key]):
            cells += _beside(value, published[key][k]) if published else [f"{value:.4f}"]
        table.add_row(*cells)
    console.print(table)
    if result["waypoints"]:
        console.print(_waypoints(result["waypoints"]))
    if "true" in result:
        console.print(_true(result["true"]), highlight=False)
    console.print(_ranges(result["ranges"]), f"{result['real_time_factor']:g} × real time", sep="\n", highlight=False)


def _beside(flown: float, printed: float) -> list[str]:
    ratio = flown / printed
    return [f"{printed:.4f}", f"{flown:.4f}", f"[{'green' if ratio <= 1.0 else 'yellow'}]{ratio:.2f}×[/]"]


def plain(title: str | None) -> Table:
    """A table in the style of all of them."""
    return Table(title=title and escape(title), title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 0))


def _waypoints(waypoints: list[dict[str, Any]]) -> Table:
    table = plain("error at key times [m], measured − reference")
    for heading in ("t [s]", "target (north, east, down) [m]", *AXES):
        table.add_column(escape(heading), justify="right")
    for w in waypoints:
        target = ", ".join(f"{round(v, 2) + 0.0:.2f}" for v in w["target"])
        table.add_row(f"{w['t_s']:.1f}", f"({target})", *(f"{e:+.4f}" for e in w["error"]))
    return table


def _true(true: dict[str, Any]) -> str:
    """One line: the errors that the vehicle itself doesn't know of."""
    mae = " / ".join(f"{v:.4f}" for v in true["mae"])
    return (
        f"true position: MAE {mae} m; in space {true['mean_distance']:.4f} m, {true['max_distance']:.4f} m at its worst"
    )


def _ranges(ranges: dict[str, list[float] | None]) -> str:
    """One line: what the angles (paper's YXZ), the thrust and the flaps went through while airborne."""
    parts = []
    for key, label, unit in (
        ("roll_deg", "roll φ", "°"),
        ("pitch_deg", "pitch θ", "°"),
        ("yaw_deg", "yaw ψ", "°"),
        ("thrust_N", "thrust", " N"),
        ("flap_deg", "flaps", "°"),
    ):
        pair = ranges[key]
        parts.append(f"{label} {pair[0]:.2f} … {pair[1]:.2f}{unit}" if pair else f"{label} not heard")
    return "airborne: " + ", ".join(parts)
