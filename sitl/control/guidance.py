"""What the onboard logic asks of the cascade for the next control steps."""

from enum import IntEnum
from typing import NamedTuple

from sitl.control.reference import Trajectory


class Effort(IntEnum):
    """How far down the cascade is at work."""

    OFF = 0  # motors stopped, flaps centred (disarmed)
    IDLE = 1  # motors at their least thrust, integrators held at zero (armed, standing)
    FLY = 2  # the whole cascade follows the trajectory
    DIRECT = 3  # none of it: the actuators get what Guidance.actuation says


class Steering(NamedTuple):
    """What is flown in place of the trajectory.

    steered: 0.0 nothing, the trajectory is flown; 1.0 the attitude q_NB, turning at the given rates, and the thrust;
    2.0 the body rates [rad/s, B] and the thrust. thrust_N: the force along body x, of propellers and wing together.
    """

    steered: float
    qw: float
    qx: float
    qy: float
    qz: float
    p_rad_s: float
    q_rad_s: float
    r_rad_s: float
    thrust_N: float


STRAIGHT = Steering(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Actuation(NamedTuple):
    """What motors and flaps are told: thrust of each motor, deflection of each flap (docs/model.md)."""

    thrust_left_N: float
    thrust_right_N: float
    flap_left_rad: float
    flap_right_rad: float


STILL = Actuation(0.0, 0.0, 0.0, 0.0)


class Guidance(NamedTuple):
    """Effort, trajectory, which of its derivatives bind on each axis, and what is flown in its place.

    follow_position_*: 0.0 lets go of the position on that axis (a velocity target).
    follow_velocity_*: 0.0 lets go of velocity too (a pure acceleration target).
    aloft: 0.0 while the ground carries part of the weight, which is not a disturbance to be learned.
    """

    effort: int
    trajectory: Trajectory
    follow_position_north: float = 1.0
    follow_position_east: float = 1.0
    follow_position_down: float = 1.0
    follow_velocity_north: float = 1.0
    follow_velocity_east: float = 1.0
    follow_velocity_down: float = 1.0
    aloft: float = 1.0
    steering: Steering = STRAIGHT
    actuation: Actuation = STILL  # for Effort.DIRECT
