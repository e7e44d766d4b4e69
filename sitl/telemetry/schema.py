"""The messages' structures, as they encode to JSON.

Every field says its unit; N is north-east-down, B the aeroplane's forward-right-down, quaternions are (w, x, y, z)
and take B to N. Motion is the plant's truth; fields that begin with `nav_` are what the vehicle believes.
"""

import msgspec

VERSION = 1  # goes up when a field changes its meaning or goes away, not when one is added

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]


class StateMessage(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    lat_deg: float
    lon_deg: float
    alt_amsl_m: float
    position_N_m: Triple
    velocity_N_m_s: Triple
    acceleration_N_m_s2: Triple
    specific_force_B_m_s2: Triple
    wind_N_m_s: Triple
    feet_down: int
    nav_position_N_m: Triple
    nav_velocity_N_m_s: Triple


class AttitudeMessage(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    q_NB: Quadruple
    phi_deg: float
    theta_deg: float
    psi_deg: float
    heading_deg: float
    rates_B_rad_s: Triple
    nav_q_NB: Quadruple
    nav_rates_B_rad_s: Triple


class SetpointMessage(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    position_N_m: Triple
    velocity_N_m_s: Triple
    acceleration_N_m_s2: Triple
    heading_deg: float
    heading_rate_deg_s: float
    velocity_command_N_m_s: Triple
    attitude_command_q_NB: Quadruple
    phi_command_deg: float
    theta_command_deg: float
    psi_command_deg: float
    rates_command_B_rad_s: Triple
    saturated: bool


class ActuatorsMessage(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    thrust_left_command_N: float
    thrust_right_command_N: float
    flap_left_command_deg: float
    flap_right_command_deg: float
    rotor_left_rpm: float
    rotor_right_rpm: float
    flap_left_deg: float
    flap_right_deg: float


class LoadMessage(msgspec.Struct, frozen=True, gc=False):
    force_B_N: Triple
    moment_B_N_m: Triple


class LoadsMessage(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    causes: dict[str, LoadMessage]
    total: LoadMessage


class ModeMessage(msgspec.Struct, frozen=True, gc=False):
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
    home_lat_deg: float
    home_lon_deg: float
    home_alt_amsl_m: float
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


class LoopMessage(msgspec.Struct, frozen=True, gc=False):
    now_us: int
    up_wall_s: float
    real_time_factor: float
    turns: int
    overruns: int
    worst_late_ms: float
    slipped_s: float
    datagrams_in: int
    datagrams_out: int
    datagrams_dropped: int
    datagrams_refused: int
    senders_shunned: int
    datagrams_unreadable: int
    frames_unauthentic: int
    frames_forwarded: int
    peers: int
    faults: int
    telemetry_messages: int
    telemetry_busy_ms: float
    telemetry_worst_ms: float


class EventMessage(msgspec.Struct, frozen=True, gc=False):
    number: int
    now_us: int
    kind: str
    severity: int
    text: str
    value: int


class EventsMessage(msgspec.Struct, frozen=True):
    next_number: int
    events: list[EventMessage]


class ParameterMessage(msgspec.Struct, frozen=True, gc=False):
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


class ParametersMessage(msgspec.Struct, frozen=True):
    now_us: int
    generation: int
    parameters: list[ParameterMessage]


class MissionItemMessage(msgspec.Struct, frozen=True, gc=False):
    index: int
    command: str
    position_N_m: Triple | None


class AreaMessage(msgspec.Struct, frozen=True, gc=False):
    item: int
    inclusion: bool
    group: int
    corners_N_m: list[tuple[float, float]]
    radius_m: float | None


class MissionMessage(msgspec.Struct, frozen=True):
    now_us: int
    plan_id: int
    total: int
    items: list[MissionItemMessage]
    fence: list[AreaMessage]
    rally_N_m: list[Triple]
