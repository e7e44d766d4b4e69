"""What the vehicle tells of itself, a line a second: for files, pipes and terminals that can't be drawn on."""

import math

from gcs_tools.client import Client, Script
from gcs_tools.link import UdpLink
from gcs_tools.vehicle_state import LANDED, VehicleState

LINE_S = 1.0


def until(client: Client, seconds: float) -> Script[None]:
    """Stay connected for so long."""
    yield from client.connect()
    yield from client.pause(seconds)


def rows(client: Client) -> list[tuple[str, str]]:
    """Label and value of everything known."""
    v = client.vehicle
    told = [
        ("vehicle", f"{v.name or 'unnamed'}, system {client.system}"),
        ("mode", f"{v.mode or '?'}, {'armed' if v.armed else 'disarmed'}{_place(v)}"),
        ("ready", {None: "?", True: "yes", False: "no"}[v.ready]),
    ]
    if v.clock.newest_s is not None:
        told.append(("time", f"{v.clock.newest_s:.1f} s, {v.clock.rate:.2f} × real time"))
    if v.position_m is not None:
        told.append(("position", _vector(v.position_m, "m")))
        if v.reference_m is not None and v.armed:
            error = tuple(a - b for a, b in zip(v.position_m, v.reference_m, strict=True))
            told.append(("reference", _vector(v.reference_m, "m")))
            told.append(("error", f"{_vector(error, 'm')}, {math.hypot(*error):.3f} m in all"))
        told.append(("velocity", _vector(v.velocity_m_s, "m/s")))
    if v.angles_deg is not None:
        told.append(("φ θ ψ", "  ".join(f"{x:7.2f}°" for x in v.angles_deg)))
    if v.thrust_N is not None:
        told.append(("thrust", f"{v.thrust_N:.2f} N"))
    if v.mission_item is not None and v.mode == "mission":
        told.append(("item", str(v.mission_item)))
    if v.battery >= 0:
        told.append(("battery", f"{v.battery} % {_bar(v.battery)}"))
    return told


def _place(v: VehicleState) -> str:
    where = LANDED.get(v.landed)
    return f", {where}" if where else ""


def _bar(percent: int) -> str:
    """Ten cells, as many filled as tens of percent."""
    return "█" * round(percent / 10) + "░" * (10 - round(percent / 10))


def _vector(x: tuple[float, float, float], unit: str) -> str:
    return f"north {x[0]:8.3f}  east {x[1]:8.3f}  down {x[2]:8.3f} {unit}"


def line(client: Client) -> str:
    return "  ".join(f"{label}: {' '.join(value.split())}" for label, value in rows(client))


def follow(link: UdpLink, client: Client, seconds: float) -> None:
    """Print a line a second for so long. Raises LinkError where there is no vehicle, or it is lost."""
    printed_s = -math.inf

    def update(wall_s: float) -> None:
        nonlocal printed_s
        if client.vehicle.mode is not None and wall_s - printed_s >= LINE_S:
            printed_s = wall_s
            print(line(client), flush=True)

    client.start(until(client, seconds))
    link.run(client, update)
