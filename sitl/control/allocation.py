"""Allocation: from thrust and moments to the four actuators (paper, Control Allocation)."""

from typing import NamedTuple

from sitl.control.flow import Flow
from sitl.jit import kernel
from sitl.model.aerodynamics import flap_pressure
from sitl.model.airframe import Airframe
from sitl.model.propulsion import wake_speed
from sitl.quaternion import Vec3

_ROLL_SHARE = 0.4  # of the flaps' range that roll gets even where pitch wants it all: an unchecked spin defeats both


class Allocation(NamedTuple):
    """Actuator commands, and which demands could not be met in full (1.0)."""

    thrust_left_N: float
    thrust_right_N: float
    flap_left_rad: float
    flap_right_rad: float
    thrust_short: float
    roll_short: float
    pitch_short: float
    yaw_short: float


@kernel
def allocate(a: Airframe, force_x: float, moment: Vec3, flow: Flow, flap_floor_N: float, floor_N: float) -> Allocation:
    """Thrusts [N] and flap angles [rad] that give `force_x` [N] along body x and `moment` [N·m].

    flow: with the propellers' thrust as it shapes the slipstreams now (the previous command: paper, below Eq. 11).
    flap_floor_N: thrust of one propeller below which the flaps' pressure is not believed to fall (hover's, as printed,
    keeps the flaps from overreacting). floor_N: least total thrust.

    T_L,R = (T ± ΔT)/2 with T = F_x − F_wing,x and ΔT = (M_z − M_wing,z) / l_y. The flaps take what is left of roll and
    pitch once the wing and the propellers' torque have had their part:
    q_L δ_L + q_R δ_R = M_y' / (S_f c̄ C_Mδ),   q_L δ_L − q_R δ_R = M_x' / (lever S_f C_Lδ).
    Yaw goes before thrust, and pitch before roll but for a share of the flaps that roll can count on.
    """
    low, high = a.thrust_min_N, a.thrust_max_N
    wing_f, wing_m = flow.wing_force, flow.wing_moment
    wanted_difference = (moment[2] - wing_m[2]) / a.prop_arm_m
    difference = max(low - high, min(high - low, wanted_difference))
    wanted_total = max(floor_N, force_x - wing_f[0])
    total = max(2.0 * low + abs(difference), min(2.0 * high - abs(difference), wanted_total))
    thrust_left, thrust_right = 0.5 * (total + difference), 0.5 * (total - difference)

    torque = a.torque_coefficient / a.thrust_coefficient * difference
    pitch = (moment[1] - wing_m[1]) / (a.flap_area_m2 * a.chord_m * a.flap_moment_slope)
    roll = (moment[0] - wing_m[0] - torque) / (a.flap_area_m2 * a.flap_roll_arm_m * a.flap_lift_slope)
    q_left = flap_pressure(a, flow.w, wake_speed(a, max(flow.thrust_left_N, flap_floor_N), flow.u))
    q_right = flap_pressure(a, flow.w, wake_speed(a, max(flow.thrust_right_N, flap_floor_N), flow.u))
    # the two flaps as a symmetric and a differential part, so that pitch can be served first
    flap_left, flap_right = (pitch + roll) / (2.0 * q_left), (pitch - roll) / (2.0 * q_right)
    m = a.flap_max_rad
    half_sum = max(-m, min(m, 0.5 * (flap_left + flap_right)))
    room = max(_ROLL_SHARE * m, m - abs(half_sum))
    half_difference = max(-room, min(room, 0.5 * (flap_left - flap_right)))
    half_sum = max(abs(half_difference) - m, min(m - abs(half_difference), half_sum))
    return Allocation(
        thrust_left,
        thrust_right,
        half_sum + half_difference,
        half_sum - half_difference,
        0.0 if abs(total - wanted_total) < 1e-9 else 1.0,
        0.0 if abs(half_difference - 0.5 * (flap_left - flap_right)) < 1e-9 else 1.0,
        0.0 if abs(half_sum - 0.5 * (flap_left + flap_right)) < 1e-9 else 1.0,
        0.0 if abs(difference - wanted_difference) < 1e-9 else 1.0,
    )
