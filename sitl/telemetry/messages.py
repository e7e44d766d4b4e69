"""The messages: pure functions from the vehicle's snapshot to the structures of the schema."""

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Protocol

import msgspec

from sitl.frames import heading, quaternion_to_yxz
from sitl.geodesy import to_global
from sitl.onboard.fence import Area
from sitl.onboard.mission_items import ItemCommand, has_place
from sitl.onboard.modes import Event
from sitl.telemetry.keys import TOPICS
from sitl.telemetry.schema import (
    VERSION,
    ActuatorsMessage,
    AreaMessage,
    AttitudeMessage,
    EventMessage,
    EventsMessage,
    LoadMessage,
    LoadsMessage,
    MissionItemMessage,
    MissionMessage,
    ModeMessage,
    ParameterMessage,
    ParametersMessage,
    SetpointMessage,
    StateMessage,
    Triple,
)

if TYPE_CHECKING:
    from sitl.control.cascade import Command
    from sitl.control.reference import Reference
    from sitl.geodesy import GeoPoint
    from sitl.model.rigid_body import State
    from sitl.navigation import NavState
    from sitl.onboard.parameters import Parameters
    from sitl.onboard.plans import Plans
    from sitl.snapshot import Snapshot

ITEMS_MAX = 500  # of a mission told; building more takes longer than the loop has
_RPM = 60.0 / (2.0 * math.pi)

encode = msgspec.json.Encoder().encode


class Instant(Protocol):
    """What the sampled messages need of a moment; a Snapshot has it."""

    @property
    def now_us(self) -> int: ...
    @property
    def origin(self) -> "GeoPoint": ...
    @property
    def truth(self) -> "State": ...
    @property
    def nav(self) -> "NavState": ...
    @property
    def acceleration_B(self) -> Triple: ...
    @property
    def acceleration_N(self) -> Triple: ...
    @property
    def wind_N(self) -> Triple: ...
    @property
    def reference(self) -> "Reference": ...
    @property
    def command(self) -> "Command": ...
    @property
    def feet_down(self) -> int: ...


class LoadLike(Protocol):
    """A force [N] and moment [N m] in B about the centre of mass."""

    @property
    def force_B(self) -> Triple: ...
    @property
    def moment_B(self) -> Triple: ...


def _yxz_deg(w: float, x: float, y: float, z: float) -> Triple:
    phi, theta, psi = quaternion_to_yxz(w, x, y, z)
    return math.degrees(phi), math.degrees(theta), math.degrees(psi)


def state(s: Instant) -> StateMessage:
    t, n = s.truth, s.nav
    lat_deg, lon_deg = to_global(s.origin, t.north_m, t.east_m)
    return StateMessage(
        now_us=s.now_us,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_amsl_m=s.origin.alt_amsl_m - t.down_m,
        position_N_m=(t.north_m, t.east_m, t.down_m),
        velocity_N_m_s=(t.v_north_m_s, t.v_east_m_s, t.v_down_m_s),
        acceleration_N_m_s2=s.acceleration_N,
        specific_force_B_m_s2=s.acceleration_B,
        wind_N_m_s=s.wind_N,
        feet_down=s.feet_down,
        nav_position_N_m=(n.north_m, n.east_m, n.down_m),
        nav_velocity_N_m_s=(n.v_north_m_s, n.v_east_m_s, n.v_down_m_s),
    )


def attitude(s: Instant) -> AttitudeMessage:
    t, n = s.truth, s.nav
    phi_deg, theta_deg, psi_deg = _yxz_deg(t.qw, t.qx, t.qy, t.qz)
    return AttitudeMessage(
        now_us=s.now_us,
        q_NB=(t.qw, t.qx, t.qy, t.qz),
        phi_deg=phi_deg,
        theta_deg=theta_deg,
        psi_deg=psi_deg,
        heading_deg=math.degrees(heading(t.qw, t.qx, t.qy, t.qz)),
        rates_B_rad_s=(t.p_rad_s, t.q_rad_s, t.r_rad_s),
        nav_q_NB=(n.qw, n.qx, n.qy, n.qz),
        nav_rates_B_rad_s=(n.p_rad_s, n.q_rad_s, n.r_rad_s),
    )


def setpoint(s: Instant) -> SetpointMessage:
    r, c = s.reference, s.command
    phi_deg, theta_deg, psi_deg = _yxz_deg(c.qw, c.qx, c.qy, c.qz)
    return SetpointMessage(
        now_us=s.now_us,
        position_N_m=(r.north_m, r.east_m, r.down_m),
        velocity_N_m_s=(r.v_north_m_s, r.v_east_m_s, r.v_down_m_s),
        acceleration_N_m_s2=(r.a_north_m_s2, r.a_east_m_s2, r.a_down_m_s2),
        heading_deg=math.degrees(r.heading_rad),
        heading_rate_deg_s=math.degrees(r.heading_rate_rad_s),
        velocity_command_N_m_s=(c.v_north_m_s, c.v_east_m_s, c.v_down_m_s),
        attitude_command_q_NB=(c.qw, c.qx, c.qy, c.qz),
        phi_command_deg=phi_deg,
        theta_command_deg=theta_deg,
        psi_command_deg=psi_deg,
        rates_command_B_rad_s=(c.p_rad_s, c.q_rad_s, c.r_rad_s),
        saturated=c.saturated > 0.0,
    )


def actuators(s: Instant) -> ActuatorsMessage:
    t, c = s.truth, s.command
    return ActuatorsMessage(
        now_us=s.now_us,
        thrust_left_command_N=c.thrust_left_N,
        thrust_right_command_N=c.thrust_right_N,
        flap_left_command_deg=math.degrees(c.flap_left_rad),
        flap_right_command_deg=math.degrees(c.flap_right_rad),
        rotor_left_rpm=t.rotor_left_rad_s * _RPM,
        rotor_right_rpm=t.rotor_right_rad_s * _RPM,
        flap_left_deg=math.degrees(t.flap_left_rad),
        flap_right_deg=math.degrees(t.flap_right_rad),
    )


def _total(parts: Iterable[Triple]) -> Triple:
    x = y = z = 0.0
    for part in parts:
        x, y, z = x + part[0], y + part[1], z + part[2]
    return x, y, z


def loads(now_us: int, causes: Mapping[str, LoadLike]) -> LoadsMessage:
    return LoadsMessage(
        now_us=now_us,
        causes={name: LoadMessage(load.force_B, load.moment_B) for name, load in causes.items()},
        total=LoadMessage(
            _total(load.force_B for load in causes.values()), _total(load.moment_B for load in causes.values())
        ),
    )


def mode(s: "Snapshot", speed_factor: float, paused: bool) -> ModeMessage:
    """`speed_factor` 0: as fast as possible."""
    return ModeMessage(
        now_us=s.now_us,
        mode=s.mode.value,
        armed=s.armed,
        landed=s.landed.value,
        tipped_over=s.tipped_over,
        failsafe=s.failsafe,
        ready_to_arm=s.ready_to_arm,
        mission_state=s.mission_state.name.lower().replace("_", " "),
        mission_current=s.mission_current,
        mission_total=s.mission_total,
        mission_plan_id=s.plan_id,
        home_lat_deg=s.home.lat_deg,
        home_lon_deg=s.home.lon_deg,
        home_alt_amsl_m=s.home.alt_amsl_m,
        home_N_m=s.home_N,
        home_heading_deg=math.degrees(s.home_heading_rad),
        origin_lat_deg=s.origin.lat_deg,
        origin_lon_deg=s.origin.lon_deg,
        origin_alt_amsl_m=s.origin.alt_amsl_m,
        speed_factor=speed_factor,
        paused=paused,
        battery_voltage_V=s.battery.voltage_V,
        battery_current_A=s.battery.current_A,
        battery_remaining=s.battery.remaining,
    )


def mode_trigger(s: "Snapshot") -> tuple[Any, ...]:
    """What in a snapshot makes the mode message go out at once when it changes."""
    return (
        s.mode,
        s.armed,
        s.landed,
        s.tipped_over,
        s.failsafe,
        s.ready_to_arm,
        s.mission_state,
        s.mission_current,
        s.plan_id,
        s.home,
    )


def event(e: Event) -> EventMessage:
    return EventMessage(e.number, e.now_us, e.kind.value, int(e.severity), e.text, e.value)


def events(next_number: int, log: Iterable[Event]) -> EventsMessage:
    return EventsMessage(next_number, [event(e) for e in log])


def mission(now_us: int, plans: "Plans") -> MissionMessage:
    """The first ITEMS_MAX of everything: items, with the point of those that have one, areas and rally points."""
    stored, places, items = plans.mission, plans.places, []
    for index, item in enumerate(stored.items[:ITEMS_MAX]):
        point = places.of(item, places.home_N) if has_place(item) else None
        if point is not None and not all(map(math.isfinite, point)):
            point = None
        items.append(MissionItemMessage(index, ItemCommand(item.command).name.lower().replace("_", " "), point))
    areas = [_area(area) for area in plans.fence.areas[:ITEMS_MAX]]
    rally = plans.rally.points_N(places)[:ITEMS_MAX]
    return MissionMessage(now_us, stored.plan_id, len(stored.items), items, areas, rally)


def _area(area: Area) -> AreaMessage:
    if area.sides is None:
        return AreaMessage(area.item, area.inclusion, area.group, [area.centre_N], area.radius_m)
    corners = list(zip(area.sides.north_m.tolist(), area.sides.east_m.tolist(), strict=True))
    return AreaMessage(area.item, area.inclusion, area.group, corners, None)


def parameters(now_us: int, p: "Parameters", names: Iterable[str] | None = None) -> ParametersMessage:
    """Those of `names`, or all."""
    entries = []
    for name in p.names if names is None else names:
        d = p.declaration(name)
        entries.append(
            ParameterMessage(
                name=name,
                value=p[name],
                default=d.default,
                minimum=d.minimum,
                maximum=d.maximum,
                unit=d.unit,
                group=d.group,
                is_int=d.is_int,
                read_only=d.read_only,
                description=f"{d.short}. {d.long}" if d.long else d.short,
                values={str(number): meaning for number, meaning in d.values},
            )
        )
    return ParametersMessage(now_us, p.generation, entries)


def description(vehicle: Mapping[str, Any], instance: int, rate_Hz: float) -> dict[str, Any]:
    """The vehicle's own description together with what can be heard of it."""
    topics = {t.name: {"cadence": t.cadence.value, "encoding": t.encoding, "queryable": t.queryable} for t in TOPICS}
    return {
        "schema_version": VERSION,
        "instance": instance,
        "rate_Hz": rate_Hz,
        "topics": topics,
        "vehicle": dict(vehicle),
    }
