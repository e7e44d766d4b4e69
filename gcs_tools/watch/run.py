"""`gcs watch` from its arguments to its end: the dashboard on a terminal, a line a second elsewhere."""

import math
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from gcs_tools.client import Client, LinkError
from gcs_tools.impairment import Impairment
from gcs_tools.link import Connection, UdpLink
from gcs_tools.watch import plain
from sitl.mavlink.signing import Signer

if TYPE_CHECKING:
    from gcs_tools.watch.keys import Keys
    from gcs_tools.watch.screen import Screen
    from gcs_tools.watch.station import Station

REDRAW_S = 0.25
KEYS_S = 0.05
HINT_S = 3.0  # without a vehicle, after which it is said what may be wrong


def watch(
    connection: Connection, impairment: Impairment, system: int | None, signer: Signer | None, seconds: float
) -> None:
    """Until Ctrl-C, the key, or so many seconds have passed. Raises LinkError, KeyboardInterrupt."""
    with UdpLink(connection, impairment) as link:
        if sys.stdout.isatty() and os.environ.get("TERM", "dumb") != "dumb":
            _dashboard(link, connection, system, lambda: Client(None, signer), seconds)
        else:
            plain.follow(link, Client(system, signer), seconds)


def _dashboard(
    link: UdpLink, connection: Connection, system: int | None, client: Callable[[], Client], seconds: float
) -> None:
    from gcs_tools.watch.keys import Keys
    from gcs_tools.watch.screen import Screen
    from gcs_tools.watch.station import Station

    station = Station(client, system, seconds)
    with Screen() as screen, Keys() as keys:
        dashboard = Dashboard(station, screen, keys, connection)
        try:
            link.run(station, dashboard.update)
        finally:
            station.leave()
            link.flush(station)
    if station.chosen is None:
        which = "vehicle" if system is None else f"vehicle with system id {system}"
        raise LinkError(f"no {which} was heard at {connection}")


class Dashboard:
    """Draws, and does what the keys say; give it the chance to by calling `update` often."""

    def __init__(self, station: "Station", screen: "Screen", keys: "Keys", connection: Connection) -> None:
        self._station, self._screen, self._keys, self._connection = station, screen, keys, connection
        self._frozen = False
        self._drawn_s = self._read_s = -math.inf

    def update(self, wall_s: float) -> None:
        changed = False
        if wall_s - self._read_s >= KEYS_S:
            self._read_s = wall_s
            pressed = self._keys.read()
            for key in pressed:
                self._obey(key)
            changed = bool(pressed) or self._screen.is_resized()
        if changed or (wall_s - self._drawn_s >= REDRAW_S and not self._frozen):
            self._drawn_s = wall_s
            self._draw(wall_s)

    def _obey(self, key: str) -> None:
        if key == "quit":
            self._station.leave()
        elif key == "pause":
            self._frozen = not self._frozen
        elif key == "next":
            self._station.move(1)
        elif key == "previous":
            self._station.move(-1)
        else:
            self._station.choose(int(key) - 1)

    def _draw(self, wall_s: float) -> None:
        from gcs_tools.watch.layout import Scene, lines

        station = self._station
        since_s = station.began_s if station.began_s is not None else wall_s
        scene = Scene(
            vehicles=station.order,
            chosen=station.chosen,
            wall_s=wall_s,
            where=str(self._connection),
            since_s=since_s,
            wanted=station.wanted,
            hint=self._hint() if wall_s - since_s > HINT_S else "",
            frozen=self._frozen,
            keys=self._keys.are_read,
        )
        self._screen.draw(lines(scene, *self._screen.size))

    def _hint(self) -> str:
        """Why nobody may be heard."""
        station, c = self._station, self._connection
        if station.unauthentic:
            return "what is heard has another key than --signing-key"
        if station.vehicles:
            return "others are heard: choose one by its number"
        if c.listens:
            return (
                f"nothing arrives at {c.host}:{c.port}: `sitl run` sends to 127.0.0.1:14550 and 14540,\n"
                "or is called: --connect udpout:127.0.0.1:18570 (plus its instance)"
            )
        return (
            f"nobody answers at {c.host}:{c.port}: `sitl run` listens at 18570 plus its instance,\n"
            "`sitl swarm` at 18300; one started with --signing-key answers no other key"
        )
