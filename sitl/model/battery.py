"""The battery: a three-cell 2200 mAh pack, linear between full and empty; propulsion as a whole is half efficient."""

from sitl.jit import kernel

FULL_V, EMPTY_V, CAPACITY_MAH = 12.6, 10.5, 2200.0
IDLE_W = 3.0
_EFFICIENCY = 0.5
_J_PER_MAH = 0.5 * (FULL_V + EMPTY_V) * 3.6


@kernel
def drawn_W(torque_coefficient: float, rotor_left_rad_s: float, rotor_right_rad_s: float) -> float:
    """Power of propulsion and electronics [W]: C_μ ω³ of both propellers at the shaft."""
    left, right = abs(rotor_left_rad_s), abs(rotor_right_rad_s)
    return IDLE_W + torque_coefficient * (left * left * left + right * right * right) / _EFFICIENCY


def used_mAh(energy_J: float) -> float:
    return energy_J / _J_PER_MAH


def remaining(energy_J: float) -> float:
    """How full the battery is after so much was drawn, 0 … 1."""
    return max(0.0, 1.0 - used_mAh(energy_J) / CAPACITY_MAH)


def energy_J(remaining: float) -> float:
    """What has been drawn from a battery that is so full."""
    return (1.0 - remaining) * CAPACITY_MAH * _J_PER_MAH
