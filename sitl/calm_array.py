"""Whether a tick may be passed over: the onboard logic's calm, and the battery's charge, looked at in compiled code."""

import math

import numpy as np
from numpy.typing import NDArray

from sitl.control.reference import Trajectory, sample
from sitl.jit import kernel
from sitl.model.battery import drawn_W
from sitl.model.rigid_body import State
from sitl.navigation import NavState
from sitl.onboard.calm import Calm
from sitl.onboard.touch import LIFT_M, LIFT_M_S, NEAR_GROUND_M, TIPPED, TOUCH_M
from sitl.tally import TICK_US

Array = NDArray[np.float64]

# places in the array: what the calm says, and the battery; the battery's are kept from one calm to the next
_UNTIL_US, _ON_FEET, _GROUND, _NEAR_N, _NEAR_M, POWER_W, ENERGY_J, _ENERGY_MOST_J, _SIZE = 0, 1, 2, 3, 6, 7, 8, 9, 10
_RISING, _RESTING = 1, 2  # of calm.Ground, as plain numbers


def calm_array(power_W: float) -> Array:
    """Of a vehicle that ticks every time, with a full battery."""
    x = np.zeros(_SIZE)
    x[_UNTIL_US], x[POWER_W] = -math.inf, power_W
    return x


def put_calm(x: Array, calm: Calm | None, feet_down: int = 0, energy_most_J: float = 0.0) -> None:
    """energy_most_J: drawn from the battery, where there is something to tell of it. None: pass over no tick."""
    x[_UNTIL_US] = -math.inf
    if calm is not None:
        # number by number: numpy takes twice as long for a tuple
        x[_UNTIL_US], x[_ON_FEET], x[_GROUND], x[_NEAR_M] = calm.until_us, feet_down > 0, calm.ground, calm.near_m
        x[_NEAR_N], x[_NEAR_N + 1], x[_NEAR_N + 2] = calm.near_N
        x[_ENERGY_MOST_J] = energy_most_J


@kernel
def passes(
    x: Array, trajectory: Trajectory, nav: NavState, feet_down: int, torque_coefficient: float, s: State, now_us: int
) -> bool:
    """Whether the tick at `now_us` is one that changes nothing; then its share of the battery's charge is drawn."""
    if now_us >= x[_UNTIL_US] or (feet_down > 0) != (x[_ON_FEET] > 0.0):
        return False
    if nav.down_m > -NEAR_GROUND_M and 2.0 * (nav.qx * nav.qz - nav.qw * nav.qy) > TIPPED:
        return False
    if x[_GROUND] != 0.0:
        r = sample(trajectory, now_us * 1e-6)
        if x[_GROUND] == _RISING and (r.down_m < nav.down_m - LIFT_M or r.v_down_m_s < -LIFT_M_S):
            return False
        if x[_GROUND] == _RESTING and r.down_m > -TOUCH_M and r.v_down_m_s > -LIFT_M_S:
            return False
    n, e, d = nav.north_m - x[_NEAR_N], nav.east_m - x[_NEAR_N + 1], nav.down_m - x[_NEAR_N + 2]
    if x[_NEAR_M] >= 0.0 and math.sqrt(n * n + e * e + d * d) <= x[_NEAR_M] + 1e-6:
        return False
    power_W = drawn_W(torque_coefficient, s.rotor_left_rad_s, s.rotor_right_rad_s)
    energy_J = x[ENERGY_J] + power_W * TICK_US * 1e-6
    if energy_J >= x[_ENERGY_MOST_J]:
        return False
    x[POWER_W], x[ENERGY_J] = power_W, energy_J
    return True
