"""Two ends of the link in memory: the real vehicle behind its endpoint, stations, and wires that lose things.

All time is injected.
"""

from collections.abc import Callable, Sequence
from typing import Any

from gcs_tools import impairment
from gcs_tools.client import Client, Script
from gcs_tools.impairment import Impairment
from sitl.mavlink.codec import Encoder, Frame, Parser, mav, message
from sitl.mavlink.endpoint import Datagram, Endpoint, Identity, PortKind
from sitl.onboard.plan import MissionItem
from sitl.vehicle import Vehicle
from sitl.vehicle_spec import VehicleSpec

STEP_S = 0.01


def Wire(*, drop: float = 0.0, duplicate: float = 0.0, jitter_s: float = 0.0, seed: int = 1) -> impairment.Wire[bytes]:
    """One direction of a link."""
    return impairment.Wire(Impairment(drop, duplicate, jitter_s, seed))


class Station:
    """A ground station or onboard computer: sends, and keeps what it hears."""

    def __init__(
        self,
        world: "World",
        port: int = 5000,
        kind: PortKind = PortKind.ONBOARD,
        system: int = 255,
        component: int = 190,
        up: impairment.Wire[bytes] | None = None,
        down: impairment.Wire[bytes] | None = None,
    ) -> None:
        self.address = ("127.0.0.1", port)
        self.kind = kind
        self.encoder = Encoder(system, component)
        self.parser = Parser()
        self.heard: list[Frame] = []
        self.react: Callable[[Frame], None] | None = None
        self._world = world
        self.up, self.down = up or Wire(), down or Wire()
        world.stations.append(self)

    def send(self, name: str, **fields: Any) -> None:
        self.send_bytes(self.encoder.encode(message(name, **fields)))

    def send_bytes(self, data: bytes) -> None:
        self.up.put(self._world.wall_s, data)

    def command(self, command: int, *params: float, confirmation: int = 0, target_system: int = 1) -> None:
        """COMMAND_LONG with params 1, 2, …"""
        fields = {f"param{k}": float(value) for k, value in enumerate(params, 1)}
        self.send(
            "COMMAND_LONG",
            target_system=target_system,
            target_component=1,
            command=command,
            confirmation=confirmation,
            **fields,
        )

    def take(self, data: bytes) -> None:
        for frame in self.parser.feed(data):
            self.heard.append(frame)
            if self.react is not None:
                self.react(frame)

    def all(self, name: str) -> list[Any]:
        """The messages of one name heard so far."""
        return [frame.message for frame in self.heard if frame.name == name]

    def texts(self) -> list[str]:
        """Whole texts, chunks put together."""
        whole: list[str] = []
        for m in self.all("STATUSTEXT"):
            if m.chunk_seq:
                whole[-1] += m.text
            else:
                whole.append(m.text)
        return whole

    def forget(self) -> None:
        self.heard.clear()

    def ask(self, command: int, *params: float, confirmation: int = 0) -> list[int]:
        """Send a COMMAND_LONG, go on for 50 ms, and return the results of its acknowledgements."""
        before = len(self.heard)
        self.command(command, *params, confirmation=confirmation)
        self._world.run(0.05)
        acks = [frame.message for frame in self.heard[before:] if frame.name == "COMMAND_ACK"]
        return [ack.result for ack in acks if ack.command == command]


class World:
    """A vehicle, its endpoint and the stations around it. `speed`: simulated seconds per second; 0 stands still.

    Further settings are the endpoint's.
    """

    def __init__(
        self,
        spec: VehicleSpec,
        *,
        identity: Identity = Identity.PX4,
        static_peers: Sequence[tuple[PortKind, tuple[str, int]]] = (),
        speed: float = 1.0,
        vehicle: Any = None,
        wall_s: float = 0.0,
        **settings: Any,
    ) -> None:
        self.vehicle = vehicle or Vehicle(spec)
        self.endpoint = Endpoint(self.vehicle, identity=identity, static_peers=static_peers, **settings)
        self.stations: list[Station] = []
        self.wall_s = wall_s
        self.speed = speed
        self.sent: list[Datagram] = []
        self._simulated_us = 0.0

    def station(self, *, greeting: bool = True, **settings: Any) -> Station:
        """A station that has said hello, and has heard what the vehicle says to that."""
        station = Station(self, port=5000 + len(self.stations), **settings)
        if greeting:
            station.send("HEARTBEAT", type=mav.MAV_TYPE_GCS, autopilot=mav.MAV_AUTOPILOT_INVALID)
            self.run(0.02)
        return station

    def step(self, dt_s: float = STEP_S) -> None:
        self.wall_s += dt_s
        self._simulated_us += dt_s * self.speed * 1e6
        self.vehicle.advance(int(self._simulated_us))
        for station in self.stations:
            for data in station.up.take(self.wall_s):
                self.endpoint.receive(data, station.address, station.kind, self.wall_s)
        for datagram in self.endpoint.poll(self.wall_s):
            self.sent.append(datagram)
            for station in self.stations:
                if (datagram.kind, datagram.address) == (station.kind, station.address):
                    station.down.put(self.wall_s, datagram.data)
        for station in self.stations:
            for data in station.down.take(self.wall_s):
                station.take(data)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.step()

    def run_until(self, condition: Callable[[], bool], limit_s: float) -> float:
        """Go on until `condition` holds; returns how long it took. Fails after `limit_s`."""
        start_s = self.wall_s
        while not condition():
            assert self.wall_s - start_s < limit_s, f"not within {limit_s} s"
            self.step()
        return self.wall_s - start_s

    def converse(self, station: Station, talk: Callable[[Client], Script[Any]], limit_s: float) -> Any:
        """Run a script of the tools' own client over a station's wires; its result, or its fault raised."""
        client = Client(1)
        station.take = lambda data: client.receive(data, self.wall_s)  # type: ignore[method-assign]
        client.start(talk(client))
        start_s = self.wall_s
        while not client.finished:
            assert self.wall_s - start_s < limit_s, f"not within {limit_s} s"
            for data in client.poll(self.wall_s):
                station.send_bytes(data)
            self.step()
        if client.fault is not None:
            raise client.fault
        return client.result

    def take_off(self, station: Station, height_m: float = 2.0) -> None:
        """Into the air and to Hold."""
        amsl = self.vehicle.commander.home.alt_amsl_m + height_m
        nan = float("nan")
        assert station.ask(mav.MAV_CMD_NAV_TAKEOFF, -1, 0, 0, nan, nan, nan, amsl) == [0]
        assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [0]
        speed, self.speed = self.speed, 10.0
        self.run_until(lambda: self.vehicle.commander.mode.value == "hold", 10.0)
        self.speed = speed


class Uploader:
    """The sending side of a plan upload: answers what it is asked, repeats the count until it is asked first."""

    def __init__(self, station: Station, items: Sequence[MissionItem], kind: int = 0) -> None:
        self.station, self.items, self.kind = station, items, kind
        self.result: Any = None
        self.asked: list[int] = []
        station.react = self._react

    def start(self) -> None:
        address = {"target_system": 1, "target_component": 1, "mission_type": self.kind}
        self.station.send("MISSION_COUNT", count=len(self.items), **address)

    def _react(self, frame: Frame) -> None:
        if frame.name == "MISSION_REQUEST_INT":
            self.asked.append(frame.message.seq)
            send_item(self.station, frame.message.seq, self.items[frame.message.seq])
        elif frame.name == "MISSION_ACK":
            self.result = frame.message

    def finish(self, world: World, limit_s: float) -> Any:
        """Until the ACK; returns it."""
        self.start()
        patience = 0
        start_s = world.wall_s
        while self.result is None:
            assert world.wall_s - start_s < limit_s, f"not within {limit_s} s, at item {self.asked[-1:]}"
            world.step()
            patience += 1
            if patience % 100 == 0:  # a second without the end: as real stations do, say the last thing again
                if self.asked:
                    send_item(self.station, self.asked[-1], self.items[self.asked[-1]])
                else:
                    self.start()
        return self.result


class Downloader:
    """The receiving side of a plan download."""

    def __init__(self, station: Station, kind: int = 0) -> None:
        self.station, self.kind = station, kind
        self.count: Any = None
        self.items: list[MissionItem] = []
        self.complete = False
        station.react = self._react

    def ask(self) -> None:
        address = {"target_system": 1, "target_component": 1, "mission_type": self.kind}
        if self.count is None:
            self.station.send("MISSION_REQUEST_LIST", **address)
        elif len(self.items) < self.count.count:
            self.station.send("MISSION_REQUEST_INT", seq=len(self.items), **address)
        else:
            self.complete = True
            self.station.send("MISSION_ACK", type=0, **address)

    def _react(self, frame: Frame) -> None:
        m = frame.message
        if frame.name == "MISSION_COUNT" and self.count is None:
            self.count = m
            self.ask()
        elif frame.name == "MISSION_ITEM_INT" and m.seq == len(self.items):
            self.items.append(item_of(m))
            self.ask()

    def finish(self, world: World, limit_s: float) -> list[MissionItem]:
        start_s = last_s = world.wall_s
        self.ask()
        while not self.complete:
            assert world.wall_s - start_s < limit_s, f"not within {limit_s} s, {len(self.items)} items"
            world.step()
            if world.wall_s - last_s > 0.5:
                last_s = world.wall_s
                self.ask()
        return self.items


def send_item(station: Station, seq: int, item: MissionItem) -> None:
    fields = item._asdict()
    station.send("MISSION_ITEM_INT", target_system=1, target_component=1, seq=seq, **fields)


def item_of(m: Any) -> MissionItem:
    params = m.param1, m.param2, m.param3, m.param4
    return MissionItem(m.frame, m.command, m.current, m.autocontinue, *params, m.x, m.y, m.z, m.mission_type)
