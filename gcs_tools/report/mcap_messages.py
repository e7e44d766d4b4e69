"""The telemetry's messages as a report takes them (docs/telemetry.md has all of them). What doesn't exist is null."""

from collections.abc import Callable
from typing import Any

import msgspec

Numbers = tuple[float | None, ...]


class State(msgspec.Struct):
    now_us: int
    position_N_m: Numbers
    velocity_N_m_s: Numbers
    wind_N_m_s: Numbers
    nav_position_N_m: Numbers
    nav_velocity_N_m_s: Numbers


class Attitude(msgspec.Struct):
    now_us: int
    q_NB: Numbers
    phi_deg: float | None
    theta_deg: float | None
    psi_deg: float | None
    nav_q_NB: Numbers


class Setpoint(msgspec.Struct):
    now_us: int
    position_N_m: Numbers
    velocity_N_m_s: Numbers
    phi_command_deg: float | None
    theta_command_deg: float | None
    psi_command_deg: float | None


class Actuators(msgspec.Struct):
    now_us: int
    thrust_left_command_N: float | None
    thrust_right_command_N: float | None
    flap_left_deg: float | None
    flap_right_deg: float | None


class Mode(msgspec.Struct):
    now_us: int
    mode: str
    armed: bool
    landed: str
    failsafe: str
    speed_factor: float
    battery_voltage_V: float | None
    battery_current_A: float | None
    battery_remaining: float | None


class Event(msgspec.Struct):
    now_us: int
    kind: str
    severity: int
    text: str
    value: int


class Parameter(msgspec.Struct):
    name: str
    value: float | None
    default: float | None


class Parameters(msgspec.Struct):
    now_us: int
    parameters: list[Parameter]


def _decoder(kind: Any) -> Callable[[bytes], Any]:
    return msgspec.json.Decoder(kind).decode


state, attitude, setpoint, actuators = map(_decoder, (State, Attitude, Setpoint, Actuators))
mode, event, parameters = map(_decoder, (Mode, Event, Parameters))
