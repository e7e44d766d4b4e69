"""The air around the wing as the controller knows it: no wind, slipstreams after the motors' lag."""

from typing import NamedTuple

from sitl.jit import kernel
from sitl.model.aerodynamics import wing_loads
from sitl.model.airframe import Airframe
from sitl.model.propulsion import wake_speed
from sitl.quaternion import Vec3


class Flow(NamedTuple):
    """Air velocity in B [m/s], each propeller's thrust [N] and wake [m/s], and the wing's force and moment in it."""

    u: float
    w: float
    thrust_left_N: float
    thrust_right_N: float
    wake_left: float
    wake_right: float
    wing_force: Vec3
    wing_moment: Vec3


@kernel
def flow_at(a: Airframe, u: float, w: float, thrust_left_N: float, thrust_right_N: float) -> Flow:
    """The flow at an air velocity (u, w) in B [m/s] with the given thrusts [N]."""
    left, right = wake_speed(a, thrust_left_N, u), wake_speed(a, thrust_right_N, u)
    force, moment = wing_loads(a, u, w, left, right)
    return Flow(u, w, thrust_left_N, thrust_right_N, left, right, force, moment)
