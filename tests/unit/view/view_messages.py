"""Telemetry messages as a vehicle sends them, for the tests of what the page makes of them."""

import json
from typing import Any

STATE = {
    "position_N_m": [1.0, 2.0, -3.0], "velocity_N_m_s": [0.5, 0.0, 0.0], "wind_N_m_s": [1.0, 0.0, 0.0], "feet_down": 0,
}  # fmt: skip
ATTITUDE = {
    "q_NB": [0.7071068, 0.0, 0.7071068, 0.0], "phi_deg": 0.0, "theta_deg": 90.0, "psi_deg": 0.0, "heading_deg": 0.0,
    "rates_B_rad_s": [0.0, 0.0, 0.0],
}  # fmt: skip
SETPOINT = {
    "position_N_m": [1.1, 2.0, -3.0], "velocity_N_m_s": [0.0, 0.0, 0.0], "heading_deg": 0.0, "phi_command_deg": 1.0,
    "theta_command_deg": 95.0, "psi_command_deg": 2.0, "saturated": False,
}  # fmt: skip
ACTUATORS = {
    "thrust_left_command_N": 5.0, "thrust_right_command_N": 6.0, "flap_left_command_deg": -2.0,
    "flap_right_command_deg": -3.0, "rotor_left_rpm": 6000.0, "rotor_right_rpm": 6000.0, "flap_left_deg": -2.0,
    "flap_right_deg": -3.0,
}  # fmt: skip
ZERO = {"force_B_N": [0.0, 0.0, 0.0], "moment_B_N_m": [0.0, 0.0, 0.0]}
LOADS = {"causes": {"thrust": {"force_B_N": [11.0, 0.0, 0.0], "moment_B_N_m": [0.0, 0.0, 0.0]}}, "total": ZERO}
SAMPLED = {"state": STATE, "attitude": ATTITUDE, "setpoint": SETPOINT, "actuators": ACTUATORS, "loads": LOADS}
MODE = {
    "mode": "hold", "armed": True, "landed": "in air", "tipped_over": False, "failsafe": "", "ready_to_arm": True,
    "mission_state": "no mission", "mission_current": 0, "mission_total": 0, "mission_plan_id": 0,
    "home_N_m": [0.0, 0.0, 0.0], "home_heading_deg": 0.0, "origin_lat_deg": 55.7, "origin_lon_deg": 37.4,
    "origin_alt_amsl_m": 190.0, "speed_factor": 1.0, "paused": False,
    "battery_voltage_V": 12.5, "battery_current_A": 20.0, "battery_remaining": 0.9,
}  # fmt: skip


def message(topic: str, now_us: int, **changes: Any) -> bytes:
    """A payload with a few fields changed, and one that no page knows."""
    base = SAMPLED.get(topic, MODE)
    return json.dumps({"now_us": now_us, "of_a_later_version": 1, **base, **changes}).encode()


def event(number: int, kind: str = "text", text: str = "hello") -> bytes:
    return json.dumps(
        {"number": number, "now_us": number * 1000, "kind": kind, "severity": 6, "text": text, "value": 0}
    ).encode()
