"""The parts behind the sockets put together. Heavy to import: numba and the kernels come with it."""

import gc
from collections.abc import Callable

from sitl.daemon.boot import Boot
from sitl.daemon.config import Port, RunConfig, SettingError
from sitl.daemon.files import FolderArea
from sitl.daemon.flight_recorder import FlightRecorder
from sitl.daemon.loop import Loop
from sitl.daemon.recorder import Recorder
from sitl.daemon.udp import Sockets
from sitl.mavlink.endpoint import Endpoint
from sitl.mavlink.identity import Identity
from sitl.mavlink.limits import DAEMON
from sitl.mavlink.peers import PortKind
from sitl.mavlink.signing import Signer
from sitl.onboard.store import FolderStore
from sitl.strict_yaml import ConfigError
from sitl.telemetry import keys
from sitl.telemetry.feed import Feed
from sitl.telemetry.publisher import Publisher, ZenohUnavailableError, default_endpoint, open_session
from sitl.vehicle import DEFAULT_HOME, Vehicle, load_vehicle
from sitl.vehicle_spec import gains_named


def build_vehicle(config: RunConfig) -> Vehicle:
    """The vehicle of the settings, with its kernels compiled. Raises SettingError."""
    assert config.state_dir is not None
    home = config.home
    try:
        return Vehicle(
            load_vehicle(config.vehicle),
            home=home.point if home else DEFAULT_HOME,
            heading_rad=home.heading_rad if home else 0.0,
            seed=config.seed,
            wind_N=config.wind_N_m_s,
            gust_m_s=config.gust_m_s,
            store=FolderStore(config.state_dir),
            overrides={"SIM_SPEED": config.speed, **_gains(config), **dict(config.settings)},
        )
    except ConfigError as error:
        raise SettingError(str(error)) from None


def _gains(config: RunConfig) -> dict[str, float]:
    return gains_named(config.gains) if config.gains is not None else {}


def build_endpoint(config: RunConfig, vehicle: Vehicle, recorder: Recorder | None, signer: Signer | None) -> Endpoint:
    assert config.state_dir is not None
    peers = [(PortKind(port.value), each) for port, addresses in config.static_peers.items() for each in addresses]
    return Endpoint(
        vehicle,
        identity=Identity(config.identity),
        system_id=config.system_id,
        static_peers=peers,
        logs=FolderArea(config.log_dir, in_use=recorder.writes if recorder else lambda _name: False),
        scratch=FolderArea(config.state_dir / "scratch"),
        limits=DAEMON,
        signer=signer,
        forward=config.forward,
    )


def open_publisher(config: RunConfig) -> Publisher | None:
    """Zenoh telemetry, if it is wanted. Raises SettingError."""
    if not config.zenoh:
        return None
    try:
        return Publisher(open_session(zenoh_endpoint(config)), config.instance)
    except ZenohUnavailableError as error:
        raise SettingError(f"{error}; choose another address with --zenoh-endpoint, or --no-zenoh") from None


def zenoh_endpoint(config: RunConfig) -> str:
    return config.zenoh_endpoint or default_endpoint(config.instance)


def build_loop(
    config: RunConfig,
    vehicle: Vehicle,
    sockets: Sockets,
    publisher: Publisher | None,
    recorder: Recorder | None,
    clock: Callable[[], float],
    signer: Signer | None = None,
) -> tuple[Loop, Endpoint]:
    """The loop with everything attached, and each function in it run once so that none compiles in flight."""
    endpoint = build_endpoint(config, vehicle, recorder, signer)
    loop = Loop(vehicle, endpoint, sockets, clock, publisher=publisher)
    feed = Feed(vehicle, config.instance, loop.figures)
    for topic in keys.TOPICS:
        if topic.queryable:
            feed.latest(topic)
    if recorder is not None:
        loop.record_with(FlightRecorder(vehicle, feed, recorder))
    if publisher is not None:
        loop.feed_from(feed)
        publisher.attach(feed)
    return loop, endpoint


def introduce(endpoint: Endpoint, boot: Boot, wall_s: float) -> None:
    """Let the endpoint learn whom the boot phase heard."""
    for (port, address), data in boot.heard.items():
        endpoint.receive(data, address, PortKind(port.value), wall_s)


def settle_garbage() -> None:
    """Take what was built so far out of the garbage collector's rounds: a full one would hold the loop up for 20 ms."""
    gc.collect()
    gc.freeze()


def banner(config: RunConfig, vehicle: Vehicle, publisher: Publisher | None, recorder: Recorder | None) -> str:
    def link(port: Port) -> str:
        host, number = config.local_ports[port]
        return f"UDP {host}:{number} -> " + ", ".join(f"{host}:{number}" for host, number in config.static_peers[port])

    speed = f"{config.speed:g} x real time" if config.speed else "as fast as possible"
    lines = [
        f"vehicle {vehicle.spec.name}, instance {config.instance}, system id {config.system_id}, {speed}",
        f"  ground stations  {link(Port.GCS)}",
        f"  onboard          {link(Port.ONBOARD)}",
        *([f"  viewer           {link(Port.VIEWER)}"] if config.hil_viewer else []),
        f"  Zenoh            {zenoh_endpoint(config)}, keys yawsitter/{config.instance}/..."
        if publisher
        else "  Zenoh            off",
        f"  state            {config.state_dir}",
        *([f"  signing key      {config.signing_key}"] if config.signing_key else []),
        *(["  forwarding       between all peers"] if config.forward else []),
    ]
    if recorder is not None:
        lines.append(f"  recording        each flight, in {recorder.folder}")
    return "\n".join(lines)
