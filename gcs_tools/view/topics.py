"""The telemetry's messages as the page reads them: the fields it shows of those in docs/telemetry.md.

Fields that are not named here are passed over, so a vehicle may send more.
"""

from typing import Any

import msgspec

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]


class State(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    position_N_m: Triple
    velocity_N_m_s: Triple
    wind_N_m_s: Triple
    feet_down: int


class Attitude(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    q_NB: Quadruple
    phi_deg: float
    theta_deg: float
    psi_deg: float
    heading_deg: float
    rates_B_rad_s: Triple


class Setpoint(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    position_N_m: Triple
    velocity_N_m_s: Triple
    heading_deg: float
    phi_command_deg: float
    theta_command_deg: float
    psi_command_deg: float
    saturated: bool


class Actuators(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    thrust_left_command_N: float
    thrust_right_command_N: float
    flap_left_command_deg: float
    flap_right_command_deg: float
    rotor_left_rpm: float
    rotor_right_rpm: float
    flap_left_deg: float
    flap_right_deg: float


class Load(msgspec.Struct, frozen=True, gc=False):
    force_B_N: Triple
    moment_B_N_m: Triple


class Loads(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    causes: dict[str, Load]
    total: Load


class Mode(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    mode: str
    armed: bool
    landed: str
    tipped_over: bool
    failsafe: str
    ready_to_arm: bool
    mission_state: str
    mission_current: int
    mission_total: int
    mission_plan_id: int
    home_N_m: Triple
    home_heading_deg: float
    origin_lat_deg: float
    origin_lon_deg: float
    origin_alt_amsl_m: float
    speed_factor: float
    paused: bool
    battery_voltage_V: float
    battery_current_A: float
    battery_remaining: float


class Loop(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    real_time_factor: float
    overruns: int
    worst_late_ms: float


class Event(msgspec.Struct, frozen=True, gc=False):
    number: int
    now_us: int
    kind: str
    severity: int
    text: str
    value: int


class Events(msgspec.Struct, frozen=True):
    next_number: int
    events: list[Event]


class Parameter(msgspec.Struct, frozen=True, gc=False):
    name: str
    value: float
    default: float
    minimum: float
    maximum: float
    unit: str
    group: str
    is_int: bool
    read_only: bool
    description: str
    values: dict[str, str]


class Parameters(msgspec.Struct, frozen=True):
    now_us: int
    generation: int
    parameters: list[Parameter]


class Item(msgspec.Struct, frozen=True, gc=False):
    index: int
    command: str
    position_N_m: Triple | None


class Area(msgspec.Struct, frozen=True, gc=False):
    inclusion: bool
    corners_N_m: list[tuple[float, float]]
    radius_m: float | None


class Mission(msgspec.Struct, frozen=True):
    now_us: int
    plan_id: int
    items: list[Item]
    fence: list[Area] = []
    rally_N_m: list[Triple] = []


class Description(msgspec.Struct, frozen=True):
    instance: int
    vehicle: dict[str, Any]


Message = (
    State | Attitude | Setpoint | Actuators | Loads | Mode | Loop | Event | Events | Parameters | Mission | Description
)

TYPES: dict[str, type] = {
    "state": State,
    "attitude": Attitude,
    "setpoint": Setpoint,
    "actuators": Actuators,
    "loads": Loads,
    "mode": Mode,
    "loop": Loop,
    "event": Event,
    "events": Events,
    "parameters": Parameters,
    "mission": Mission,
    "description": Description,
}
SAMPLED = ("state", "attitude", "setpoint", "actuators", "loads")
"""Sent together: those of one instant carry the same `now_us`."""

_DECODERS = {topic: msgspec.json.Decoder(kind) for topic, kind in TYPES.items()}


def decode(topic: str, payload: bytes) -> Any:
    """The message of a topic in TYPES. Raises msgspec.DecodeError (a field is missing, or a number does not exist)."""
    return _DECODERS[topic].decode(payload)
