"""What has failed on the physical side: actuators that don't follow their commands, a receiver that misleads.

Each part carries one of MAVLink's FAILURE_TYPE numbers: 0 it is sound; 1 OFF: a motor gives no thrust, a flap hangs in
the stream, the receiver is silent; 2 STUCK: it stays where it was; 4 WRONG: the receiver is `GNSS_WRONG_M` off to the
north; 7 INTERMITTENT: the receiver is heard one second in four.
"""

from typing import NamedTuple

from sitl.jit import kernel
from sitl.model.airframe import Airframe
from sitl.model.derivative import ActuatorCommand
from sitl.model.propulsion import thrust
from sitl.model.rigid_body import State

OFF, STUCK, WRONG, INTERMITTENT = 1.0, 2.0, 4.0, 7.0
GNSS_WRONG_M = 10.0
_PERIOD_US, _HEARD_US = 4_000_000, 1_000_000


class Failures(NamedTuple):
    """A number for each part that can fail."""

    motor_left: float = 0.0
    motor_right: float = 0.0
    flap_left: float = 0.0
    flap_right: float = 0.0
    gnss: float = 0.0


SOUND = Failures()


@kernel
def _driven(failure: float, commanded: float, present: float) -> float:
    if failure == OFF:
        return 0.0
    return present if failure == STUCK else commanded


@kernel
def followed(f: Failures, a: Airframe, s: State, x: ActuatorCommand) -> ActuatorCommand:
    """What the actuators make of a command in state `s`."""
    return ActuatorCommand(
        _driven(f.motor_left, x.thrust_left_N, thrust(a, s.rotor_left_rad_s)),
        _driven(f.motor_right, x.thrust_right_N, thrust(a, s.rotor_right_rad_s)),
        _driven(f.flap_left, x.flap_left_rad, s.flap_left_rad),
        _driven(f.flap_right, x.flap_right_rad, s.flap_right_rad),
    )


@kernel
def heard(failure: float, now_us: int) -> bool:
    """Whether the receiver gives a fix at this time."""
    return not (failure == OFF or (failure == INTERMITTENT and now_us % _PERIOD_US >= _HEARD_US))


@kernel
def misplaced_m(failure: float) -> float:
    """By how much the receiver's position is off to the north."""
    return GNSS_WRONG_M if failure == WRONG else 0.0
