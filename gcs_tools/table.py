"""The error table of a flight, beside the paper's."""

from typing import Any

from rich.console import Console
from rich.table import Table

# Tables "Position Tracking Errors at Key Waypoints and Overall Performance Metrics" of the paper, x, y, z; final errors by size.
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


def show(result: dict[str, Any], paper: str | None, console: Console | None = None) -> None:
    """Print the result of a flight; `paper` names the published table to put beside it."""
    console = console or Console()
    vehicle = result["vehicle"] or "unnamed vehicle"
    table = Table(title=f"{result['mission']} · {vehicle} · {result['duration_s']:g} s", title_justify="left")
    table.add_column("")
    published = PAPER[paper] if paper else None
    for axis in ("x", "y", "z"):
        if published:
            table.add_column(f"{axis} paper", justify="right", style="dim")
        table.add_column(f"{axis} flown", justify="right")
        if published:
            table.add_column("ratio", justify="right")
    for key, label in ROWS:
        cells = [label]
        for k, value in enumerate(result[key]):
            if published:
                printed = published[key][k]
                ratio = value / printed
                mark = "green" if ratio <= 1.0 else "yellow"
                cells += [f"{printed:.4f}", f"{value:.4f}", f"[{mark}]{ratio:.2f}[/]"]
            else:
                cells.append(f"{value:.4f}")
        table.add_row(*cells)
    console.print(table)
    if result["waypoints"]:
        console.print(_waypoints(result["waypoints"]))
    console.print(_ranges(result["ranges"]), f"{result['real_time_factor']:g} × real time", sep="\n", highlight=False)


def _waypoints(waypoints: list[dict[str, Any]]) -> Table:
    table = Table(title="error at key times [m], measured − reference", title_justify="left")
    for heading in ("t [s]", "target (north, east, down)", "x", "y", "z"):
        table.add_column(heading, justify="right")
    for w in waypoints:
        target = ", ".join(f"{v + 0.0:.2f}" for v in w["target"])
        table.add_row(f"{w['t_s']:.1f}", f"({target})", *(f"{e:+.4f}" for e in w["error"]))
    return table


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
