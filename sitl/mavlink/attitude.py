"""The multicopter's frame, in which MAVLink shows a tail-sitter.

q_mav = q_NB ⊗ q_y(−90°), so that upright hover reads roll = pitch = 0, and yaw is where the belly faces. The paper's
yaw (about body z) is therefore the wire's roll, the paper's roll the wire's minus yaw.
"""

from typing import NamedTuple

from sitl.frames import euler_321, wire_quaternion, wire_rates
from sitl.model.rigid_body import State
from sitl.navigation import NavState
from sitl.quaternion import Quat, Vec3


class WireAttitude(NamedTuple):
    """Attitude and rates in the multicopter frame (rad, rad/s)."""

    q: Quat
    roll: float
    pitch: float
    yaw: float
    rollspeed: float
    pitchspeed: float
    yawspeed: float


def wire_attitude(nav: NavState | State) -> WireAttitude:
    """The attitude and rates of a navigation state, or of the plant's state, as MAVLink shows them."""
    q = wire_quaternion(nav.qw, nav.qx, nav.qy, nav.qz)
    return WireAttitude(q, *euler_321(*q), *wire_rates(nav.p_rad_s, nav.q_rad_s, nav.r_rad_s))


def body_vector_on_wire(v_B: Vec3) -> Vec3:
    """A vector of body axes in the multicopter frame: its x is body z, its z is against body x."""
    return v_B[2], v_B[1], -v_B[0]
