"""A station of `gcs watch` among stand-in vehicles, and its screen as text: no sockets, no terminal, no clock."""

import io

from gcs_tools_stand_in import TURN_S, StandIn
from rich.console import Console

from gcs_tools.client import Client
from gcs_tools.watch.layout import Scene, lines
from gcs_tools.watch.seen import Seen
from gcs_tools.watch.station import Station


class Air:
    """Vehicles that hear all that the station says, and it them. speed: their seconds per second of the station's."""

    def __init__(self, *vehicles: StandIn, system: int | None = None, speed: float = 1.0) -> None:
        self.station = Station(Client, system)
        self.vehicles = list(vehicles)
        self.wall_s = 1000.0
        self.speed = speed
        self.lost: set[int] = set()  # numbers of datagrams that don't arrive
        self.datagrams = 0

    def fly(self, seconds: float) -> "Air":
        for _ in range(round(seconds / TURN_S)):
            self.wall_s += TURN_S
            for data in self.station.poll(self.wall_s):
                for vehicle in self.vehicles:
                    vehicle.receive(data)
            for vehicle in self.vehicles:
                for data in vehicle.turn((self.wall_s - 1000.0) * self.speed):
                    self.datagrams += 1
                    if self.datagrams not in self.lost:
                        self.station.receive(data, self.wall_s)
        return self

    @property
    def seen(self) -> Seen:
        found = self.station.chosen
        assert found is not None
        return found

    def scene(self, **changes: object) -> Scene:
        station = self.station
        began_s = station.began_s or self.wall_s
        scene = Scene(station.order, station.chosen, self.wall_s, "udpin:127.0.0.1:14550", began_s, station.wanted)
        return scene._replace(**changes)  # type: ignore[arg-type]

    def screen(self, width: int = 80, height: int = 24, **changes: object) -> str:
        """What stands on it, a line a line."""
        made = lines(self.scene(**changes), width, height)
        assert len(made) == height
        assert all(line.cell_len <= width for line in made)
        return "\n".join(line.plain.rstrip() for line in made)

    def styled(self, width: int = 80, height: int = 24) -> str:
        """With its colours."""
        console = Console(
            file=io.StringIO(), record=True, width=width, height=height, force_terminal=True, color_system="standard"
        )
        for line in lines(self.scene(), width, height):
            console.print(line, no_wrap=True, crop=True)
        return console.export_text(styles=True)


def row(screen: str, label: str) -> str:
    """The line that has this label, blanks as one."""
    found = [squeezed for line in screen.splitlines() if label in (squeezed := " ".join(line.split()))]
    assert found, f"no {label!r} in\n{screen}"
    return found[0]
