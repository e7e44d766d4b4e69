"""The settings of one daemon, and how the command line's values are read into them. No heavy imports."""

import ipaddress
import math
import os
import socket
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from sitl.geodesy import GeoPoint

INSTANCE_MAX = 249  # system id = instance + 1, and MAVLink's end at 255 with 251..255 for ground stations
SHARED_PORT = 18300  # plus the first instance: where all vehicles of a swarm are spoken to
GCS_PORT = 18570  # local ports of instance 0, and the peers they serve from the start
GCS_PEER_PORT = 14550
ONBOARD_PORT = 14580
ONBOARD_PEER_PORT = 14540
ONBOARD_PEER_LAST = 14549  # shared by instance 9 and all above, as PX4's simulator does: 14550 is the ground stations'
VIEWER_PORT = 19450  # as PX4's simulation in hardware
VIEWER_PEER_PORT = 19410
VIEWER_LAST = VIEWER_PORT - VIEWER_PEER_PORT - 1  # instance with a viewer: the next one's would be instance 0
LOOPBACK = "127.0.0.1"
WIND_MAX_M_S = 30.0
GUST_MAX_M_S = 10.0
SPEED_MAX = 1000.0

Address = tuple[str, int]
Place = tuple[int, "Port"]  # one of the sockets: the port of this instance


class Port(StrEnum):
    """Whom a socket is for; the values are those of the link's PortKind, which this module is too light to import."""

    GCS = "gcs"
    ONBOARD = "onboard"
    VIEWER = "viewer"
    SHARED = "shared"


class SettingError(ValueError):
    """A setting that can't be used; the message is one line for the person at the keyboard."""


class Home(NamedTuple):
    point: GeoPoint
    heading_rad: float


class RunConfig(NamedTuple):
    vehicle: str = "yawsitter"
    instance: int = 0
    speed: float = 1.0  # 0: as fast as possible
    home: Home | None = None  # None: the vehicle's own default
    wind_N_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gust_m_s: float = 0.0
    seed: int = 1
    identity: str = "px4"
    ground_stations: tuple[Address, ...] = ()
    gains: str | None = None  # a bundled set or a file; None: the vehicle's own, and what is stored
    settings: tuple[tuple[str, float], ...] = ()
    state_dir: Path | None = None  # None: default_state_dir
    zenoh_endpoint: str | None = None  # None: the instance's own loopback port
    zenoh: bool = True
    record: bool = False
    record_dir: Path | None = None  # None: in the state folder
    listen: str = LOOPBACK
    hil_viewer: bool = False
    signing_key: Path | None = None  # the file
    forward: bool = False
    place_N_m: tuple[float, float] = (0.0, 0.0)  # where it stands, north and east of `home`
    swarming: bool = False  # ground stations are served over the port that it shares

    @property
    def system_id(self) -> int:
        return self.instance + 1

    @property
    def log_dir(self) -> Path:
        """Where recorded flights are, to be written and to be read over the link."""
        assert self.state_dir is not None
        return self.record_dir or self.state_dir / "logs"

    @property
    def local_ports(self) -> dict[Port, Address]:
        """What to listen on."""
        ports = {Port.GCS: GCS_PORT, Port.ONBOARD: ONBOARD_PORT}
        if self.hil_viewer:
            ports[Port.VIEWER] = VIEWER_PORT
        return {port: (self.listen, number + self.instance) for port, number in ports.items()}

    @property
    def ground_peers(self) -> tuple[Address, ...]:
        """The ground stations among them."""
        return tuple(dict.fromkeys(((LOOPBACK, GCS_PEER_PORT), *self.ground_stations)))

    @property
    def static_peers(self) -> dict[Port, tuple[Address, ...]]:
        """Who is served whether or not it was heard."""
        onboard = min(ONBOARD_PEER_PORT + self.instance, ONBOARD_PEER_LAST)
        peers = {
            Port.SHARED if self.swarming else Port.GCS: self.ground_peers,
            Port.ONBOARD: ((LOOPBACK, onboard),),
        }
        if self.hil_viewer:
            peers[Port.VIEWER] = ((LOOPBACK, VIEWER_PEER_PORT + self.instance),)
        return peers


class Setup(NamedTuple):
    """Everything that one process runs: a vehicle, or several with a port that they share."""

    vehicles: tuple[RunConfig, ...]
    shared: Address | None = None  # where that port listens
    rate_max_Hz: float = math.inf  # of a stream that nobody asked for

    @property
    def first(self) -> RunConfig:
        return self.vehicles[0]

    @property
    def shared_place(self) -> "Place":
        return self.first.instance, Port.SHARED

    @property
    def sockets(self) -> "dict[Place, Address]":
        """What to listen on."""
        own = {(v.instance, port): address for v in self.vehicles for port, address in v.local_ports.items()}
        return own if self.shared is None else {**own, self.shared_place: self.shared}

    @property
    def voices(self) -> "dict[Place, tuple[int, ...]]":
        """The system ids that speak there."""
        voices: dict[Place, tuple[int, ...]]
        voices = {(v.instance, port): (v.system_id,) for v in self.vehicles for port in v.local_ports}
        if self.shared is not None:
            voices[self.shared_place] = tuple(v.system_id for v in self.vehicles)
        return voices

    @property
    def static_peers(self) -> "list[tuple[Place, Address]]":
        """Who is served there whether or not it was heard."""
        peers = [
            (self.place(v, port), address)
            for v in self.vehicles
            for port, addresses in v.static_peers.items()
            for address in addresses
        ]
        return list(dict.fromkeys(peers))

    def place(self, vehicle: RunConfig, port: Port) -> "Place":
        """Which socket is that vehicle's port."""
        return self.shared_place if port is Port.SHARED else (vehicle.instance, port)

    def resolved(self) -> "Setup":
        """With a state folder for each vehicle."""
        vehicles = (v._replace(state_dir=v.state_dir or default_state_dir(v.instance)) for v in self.vehicles)
        return self._replace(vehicles=tuple(vehicles))


def default_state_dir(instance: int) -> Path:
    base = os.environ.get("XDG_STATE_HOME")
    return (Path(base) if base else Path.home() / ".local" / "state") / "yawsitter" / f"instance-{instance}"


def _numbers(text: str, names: str) -> list[float]:
    """The finite numbers of a comma-separated list with as many members as `names` has."""
    count = names.count(",") + 1
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(v) for v in values):
        raise SettingError(f"'{text}' is not {names} ({count} numbers with commas between)")
    return values


def _within(value: float, low: float, high: float, what: str) -> float:
    if not low <= value <= high:
        raise SettingError(f"{what} {value:g} is outside {low:g} to {high:g}")
    return value


def parse_number(text: str, low: float, high: float, unit: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise SettingError(f"'{text}' is not a number from {low:g} to {high:g} {unit}")
    return value


def parse_home(text: str) -> Home:
    lat, lon, alt, heading = _numbers(text, "LAT,LON,ALT_AMSL,HEADING")
    _within(lat, -90.0, 90.0, "latitude")
    _within(lon, -180.0, 180.0, "longitude")
    _within(alt, -500.0, 9000.0, "altitude")
    _within(heading, -360.0, 360.0, "heading")
    return Home(GeoPoint(lat, lon, alt), math.radians(heading))


def parse_heading(text: str) -> float:
    (heading,) = _numbers(text, "DEG")
    return _within(heading, -360.0, 360.0, "heading")


def parse_wind(text: str) -> tuple[float, float, float]:
    north, east, down = (
        _within(v, -WIND_MAX_M_S, WIND_MAX_M_S, "wind component") for v in _numbers(text, "NORTH,EAST,DOWN")
    )
    return north, east, down


def parse_gust(text: str) -> float:
    (gust,) = _numbers(text, "M_S")
    return _within(gust, 0.0, GUST_MAX_M_S, "gust")


def parse_speed(text: str) -> float:
    """A factor of real time; 'max' reads as 0, which is how the parameter SIM_SPEED spells it."""
    if text == "max":
        return 0.0
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0.0 < speed <= SPEED_MAX:
        raise SettingError(f"'{text}' is neither a factor above 0 and up to {SPEED_MAX:g} nor 'max'")
    return speed


def parse_instance(text: str) -> int:
    try:
        instance = int(text)
    except ValueError:
        instance = -1
    if not 0 <= instance <= INSTANCE_MAX:
        raise SettingError(f"'{text}' is not a whole number from 0 to {INSTANCE_MAX}")
    return instance


def parse_seed(text: str) -> int:
    try:
        seed = int(text)
    except ValueError:
        seed = -1
    if not 0 <= seed < 2**32:
        raise SettingError(f"'{text}' is not a whole number from 0 to {2**32 - 1}")
    return seed


def parse_setting(text: str) -> tuple[str, float]:
    """A parameter's name, in the capitals that all have, and its value."""
    name, number = _named_number(text, "RATE_Y_P=0.4")
    return name.upper(), number


def parse_airframe(text: str) -> tuple[str, float]:
    """The name of an airframe number, as the airframe file has it, and its value."""
    return _named_number(text, "mass_kg=1.2")


def _named_number(text: str, example: str) -> tuple[str, float]:
    name, separator, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not name or not separator or not math.isfinite(number):
        raise SettingError(f"'{text}' is not NAME=VALUE with a number as value (for example {example})")
    return name.strip(), number


def parse_peer(text: str) -> Address:
    host, separator, port = text.rpartition(":")
    if not separator or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise SettingError(f"'{text}' is not HOST:PORT (for example 192.168.1.20:14550)")
    try:
        found = socket.getaddrinfo(host, int(port), socket.AF_INET, socket.SOCK_DGRAM)
    except OSError:
        raise SettingError(f"'{host}' is no IPv4 address and no name that resolves to one") from None
    return str(found[0][4][0]), int(port)


def parse_listen(text: str) -> str:
    try:
        return str(ipaddress.IPv4Address(text))
    except ValueError:
        raise SettingError(
            f"'{text}' is not an IPv4 address (127.0.0.1 this machine only, 0.0.0.0 every network)"
        ) from None


def check(setup: Setup) -> Setup:
    """Raise SettingError for settings that are right each by itself but not together."""
    for config in setup.vehicles:
        if config.hil_viewer and config.instance > VIEWER_LAST:
            port, other = VIEWER_PEER_PORT + config.instance, config.instance - VIEWER_LAST - 1
            raise SettingError(
                f"--hil-viewer: instance {config.instance} would send to UDP {port}, where instance {other} listens: "
                f"only instances 0 to {VIEWER_LAST} can be viewed"
            )
        if ipaddress.IPv4Address(config.listen).is_loopback:
            for host, port in config.ground_stations:
                if not ipaddress.IPv4Address(host).is_loopback:
                    raise SettingError(
                        f"--gcs {host}:{port} can't be reached from {config.listen}: add --listen 0.0.0.0"
                    )
    return setup
