"""The parts behind the sockets put together. Heavy to import: numba and the kernels come with it."""

import gc
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from sitl.daemon.boot import Boot
from sitl.daemon.clock import SLICE_US, SWARM_TURN_S, TURN_S
from sitl.daemon.config import Place, Port, RunConfig, SettingError, Setup
from sitl.daemon.files import FolderArea
from sitl.daemon.flight_recorder import FlightRecorder
from sitl.daemon.loop import Loop
from sitl.daemon.member import Member
from sitl.daemon.recorder import Recorder
from sitl.daemon.udp import Sockets
from sitl.geodesy import to_global
from sitl.mavlink.endpoint import Endpoint
from sitl.mavlink.identity import Identity
from sitl.mavlink.limits import DAEMON, shared
from sitl.mavlink.peers import PortKind
from sitl.mavlink.shared import SharedPort
from sitl.mavlink.signing import Signer
from sitl.mavlink.streams import FULL, Profile
from sitl.onboard.store import FolderStore
from sitl.strict_yaml import ConfigError
from sitl.telemetry import keys
from sitl.telemetry.feed import Feed
from sitl.telemetry.publisher import Publisher, Session, ZenohUnavailableError, default_endpoint
from sitl.vehicle import DEFAULT_HOME, Vehicle, load_vehicle
from sitl.vehicle_spec import VehicleSpec, gains_named


class Built(NamedTuple):
    """What takes a while: the vehicles, and the Zenoh session with one publisher for each (none of either)."""

    vehicles: list[Vehicle]
    session: Session | None
    publishers: list[Publisher]

    def close(self) -> None:
        for publisher in self.publishers:
            publisher.close()
        if self.session is not None:
            self.session.close()


def build(setup: Setup) -> Built:
    """Raises SettingError."""
    session = open_session(setup)
    publishers = [Publisher(session, config.instance) for config in setup.vehicles] if session is not None else []
    try:
        spec = load_spec(setup.first)
        return Built([build_vehicle(config, spec) for config in setup.vehicles], session, publishers)
    except BaseException:
        Built([], session, publishers).close()
        raise


def load_spec(config: RunConfig) -> VehicleSpec:
    """Raises SettingError."""
    try:
        return load_vehicle(config.vehicle)
    except ConfigError as error:
        raise SettingError(str(error)) from None


def build_vehicle(config: RunConfig, spec: VehicleSpec | None = None) -> Vehicle:
    """The vehicle of the settings, with its kernels compiled. Raises SettingError."""
    assert config.state_dir is not None
    point, heading_rad = config.home or (DEFAULT_HOME, 0.0)
    lat_deg, lon_deg = to_global(point, *config.place_N_m)
    try:
        return Vehicle(
            spec or load_spec(config),
            home=point._replace(lat_deg=lat_deg, lon_deg=lon_deg),
            heading_rad=heading_rad,
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


def build_endpoint(
    config: RunConfig, vehicle: Vehicle, recorder: Recorder | None, signer: Signer | None, profile: Profile = FULL
) -> Endpoint:
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
        profile=profile,
    )


def open_session(setup: Setup) -> Session | None:
    """Zenoh telemetry, if it is wanted. Raises SettingError."""
    if not setup.first.zenoh:
        return None
    try:
        return Session(zenoh_endpoint(setup.first), [config.instance for config in setup.vehicles])
    except ZenohUnavailableError as error:
        raise SettingError(f"{error}; choose another address with --zenoh-endpoint, or --no-zenoh") from None


def zenoh_endpoint(config: RunConfig) -> str:
    return config.zenoh_endpoint or default_endpoint(config.instance)


def build_loop(
    setup: Setup,
    vehicles: Sequence[Vehicle],
    sockets: Sockets[Place],
    publishers: Sequence[Publisher],
    recorders: Sequence[Recorder],
    clock: Callable[[], float],
    signer: Signer | None = None,
) -> Loop[Place]:
    """The loop with everything attached, and each function in it run once so that none compiles in flight.

    publishers, recorders: one for each vehicle, or none at all.
    A vehicle of several that is told to reboot is built again in its place; a lone one ends the loop.
    """
    swarming = setup.shared is not None
    settings = {config.system_id: config for config in setup.vehicles}
    recorded = {recorder.instance: recorder for recorder in recorders}

    def member(config: RunConfig, vehicle: Vehicle, publisher: Publisher | None) -> Member[Place]:
        phase_us = (config.instance - setup.first.instance) * SLICE_US  # not all in the same turn
        profile = Profile(setup.rate_max_Hz, (PortKind.ONBOARD,), phase_us) if swarming else FULL
        recorder = recorded.get(config.instance)
        endpoint = build_endpoint(config, vehicle, recorder, signer, profile)
        ports = [*config.local_ports, *([Port.SHARED] if swarming else [])]
        places = {PortKind(port.value): setup.place(config, port) for port in ports}
        name = f"system {config.system_id}" if swarming else ""
        made = Member(vehicle, endpoint, places, publisher=publisher, name=name)
        made.feed = Feed(vehicle, config.instance, lambda: loop.figures(made), phase_us)
        if recorder is not None:
            made.recorder = FlightRecorder(vehicle, made.feed, recorder)
        return made

    def restart(old: Member[Place]) -> Member[Place]:
        config = settings[old.endpoint.system_id]
        fresh = member(config, build_vehicle(config, old.vehicle.spec), old.publisher)
        _attach(fresh)
        return fresh

    silent: list[Publisher | None] = [None] * len(vehicles)
    members = [member(*parts) for parts in zip(setup.vehicles, vehicles, publishers or silent, strict=True)]
    dealer = None
    if swarming:
        limits = shared(DAEMON, len(members))
        dealer = (
            setup.shared_place,
            SharedPort((m.endpoint for m in members), limits, signer, forward=setup.first.forward),
        )
    loop = Loop(
        members,
        sockets,
        clock,
        shared=dealer,
        restart=restart if swarming else None,
        turn_s=SWARM_TURN_S if swarming else TURN_S,
    )
    feed = members[0].feed
    assert feed is not None
    for topic in keys.TOPICS:
        if topic.queryable:
            feed.latest(topic)
    for made in members:
        _attach(made)
    return loop


def _attach(member: Member[Place]) -> None:
    if member.publisher is not None:
        member.publisher.attach(member.feed)


def introduce(loop: Loop[Place], boot: Boot[Place], wall_s: float) -> None:
    """Let the vehicles learn whom the boot phase heard."""
    for (place, address), data in boot.heard.items():
        loop.receive(place, address, data, wall_s)
    boot.heard.clear()


def settle_garbage() -> None:
    """Take what was built so far out of the garbage collector's rounds: a full one would hold the loop up for 20 ms."""
    gc.collect()
    gc.freeze()


def banner(setup: Setup, vehicle: Vehicle, zenoh: bool) -> str:
    first, last = setup.first, setup.vehicles[-1]
    several = len(setup.vehicles) > 1

    def link(port: Port) -> str:
        host, number = first.local_ports[port]
        numbers = f"{number}" if not several else f"{number} ... {last.local_ports[port][1]}"
        whom = ", ".join(dict.fromkeys(f"{h}:{n}" for v in setup.vehicles for h, n in v.static_peers.get(port, ())))
        return f"UDP {host}:{numbers}" + (f" -> {whom}" if whom else ", for those who call")

    def folders(of: Callable[[RunConfig], Path | None]) -> str:
        return f"{of(first)} ... {of(last)}" if several else f"{of(first)}"

    speed = f"{first.speed:g} x real time" if first.speed else "as fast as possible"
    who = f"instance {first.instance}, system id {first.system_id}"
    if several:
        who = f"instances {first.instance} ... {last.instance}, system ids {first.system_id} ... {last.system_id}"
    keys_of = f"{first.instance}" if not several else f"{first.instance} ... {last.instance}"
    shared_link = []
    if setup.shared is not None:
        whom = ", ".join(f"{host}:{number}" for host, number in first.ground_peers)
        shared_link = [f"  all together     UDP {setup.shared[0]}:{setup.shared[1]} -> {whom}"]
    lines = [
        f"{f'{len(setup.vehicles)} vehicles' if several else 'vehicle'} {vehicle.spec.name}, {who}, {speed}",
        *shared_link,
        f"  ground stations  {link(Port.GCS)}",
        f"  onboard          {link(Port.ONBOARD)}",
        *([f"  viewer           {link(Port.VIEWER)}"] if first.hil_viewer else []),
        f"  Zenoh            {f'{zenoh_endpoint(first)}, keys yawsitter/{keys_of}/...' if zenoh else 'off'}",
        f"  state            {folders(lambda v: v.state_dir)}",
        *([f"  signing key      {first.signing_key}"] if first.signing_key else []),
        *(["  forwarding       between all peers"] if first.forward else []),
        *([f"  recording        each flight, in {folders(lambda v: v.log_dir)}"] if first.record else []),
    ]
    return "\n".join(lines)
