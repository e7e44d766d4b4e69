"""Offboard targets of an experiment: where to be or how to hold the body at a moment of the vehicle's time."""

import math
from typing import Any

from gcs_tools.client import Client
from gcs_tools.reference import Setpoint, Vector
from gcs_tools.tune.loops import Loop, turn_between, turned
from sitl.frames import GRAVITY_M_S2, body_quaternion, body_rates, wire_quaternion, wire_rates
from sitl.mavlink import codec
from sitl.mavlink.codec import mav
from sitl.quaternion import Quat, rotate

_IGNORE_VELOCITY, _IGNORE_ACCELERATION, _IGNORE_YAW = 0x38, 0x1C0, 0xC00
_IGNORE_RATES, _IGNORE_ATTITUDE = 0x07, 0x80
_HEIGHT_P_1_S2, _HEIGHT_D_1_S = 0.5, 1.0  # of the height kept while attitudes or rates are flown
_LEAST_UPRIGHT = 0.5


def along(client: Client, stamp_ms: int, setpoint: Setpoint) -> Any:
    """Position with feed-forward."""
    x, v, a = setpoint
    return _local(client, stamp_ms, x, v, a, _IGNORE_YAW)


def excited(client: Client, stamp_ms: int, loop: Loop, base_m: Vector, level: float) -> Any:
    """A position step off `base_m`, or a velocity on one axis with the others held there; nothing is fed forward."""
    place, speed = list(base_m), [0.0, 0.0, 0.0]
    mask = _IGNORE_YAW | _IGNORE_ACCELERATION
    if loop.kind.name == "position":
        place[loop.axis] += level
        mask |= _IGNORE_VELOCITY
    else:
        speed[loop.axis] = level
        mask |= (1 << loop.axis) | (_IGNORE_VELOCITY & ~(0x08 << loop.axis))
    return _local(client, stamp_ms, (place[0], place[1], place[2]), (speed[0], speed[1], speed[2]), _STILL, mask)


_STILL: Vector = (0.0, 0.0, 0.0)


def _local(client: Client, stamp_ms: int, x: Vector, v: Vector, a: Vector, mask: int) -> Any:
    return codec.message(
        "SET_POSITION_TARGET_LOCAL_NED",
        time_boot_ms=stamp_ms,
        coordinate_frame=mav.MAV_FRAME_LOCAL_NED,
        type_mask=mask,
        **dict(zip(("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz"), (*x, *v, *a), strict=True)),
        **client.address(),
    )


def steered(client: Client, stamp_ms: int, loop: Loop, base_q: Quat, level: float, thrust: float) -> Any:
    """An attitude turned off `base_q`, or one body rate with the others at zero. thrust: share of the greatest."""
    q, rates, mask = base_q, list(_STILL), _IGNORE_RATES
    if loop.kind.name == "attitude":
        q = turned(base_q, loop.axis, level)
    else:
        rates[loop.axis], mask = level, _IGNORE_ATTITUDE
    roll, pitch, yaw = wire_rates(rates[0], rates[1], rates[2])
    return codec.message(
        "SET_ATTITUDE_TARGET",
        time_boot_ms=stamp_ms,
        type_mask=mask,
        q=wire_quaternion(*q),
        body_roll_rate=roll,
        body_pitch_rate=pitch,
        body_yaw_rate=yaw,
        thrust=thrust,
        **client.address(),
    )


def height_keeping(thrust: float, q: Quat, base_q: Quat, below_m: float, sinking_m_s: float) -> float:
    """The hover's thrust, more of it where the vehicle leans, is too low or sinks."""
    upright = rotate(q, (1.0, 0.0, 0.0))[2] / rotate(base_q, (1.0, 0.0, 0.0))[2]
    wanted = 1.0 + (_HEIGHT_P_1_S2 * below_m + _HEIGHT_D_1_S * sinking_m_s) / GRAVITY_M_S2
    return min(1.0, max(0.0, thrust * wanted / max(_LEAST_UPRIGHT, upright)))


def load_kernels() -> None:
    """Call all compiled functions of an experiment once: loading one takes longer than a vehicle waits for targets."""
    q = body_quaternion(1.0, 0.0, 0.0, 0.0)
    for axis in range(3):
        turn_between(q, turned(q, axis, 0.0))
    height_keeping(0.5, q, q, 0.0, 0.0)
    nose_between_deg(q, q)
    wire_quaternion(*q)
    body_rates(*wire_rates(0.0, 0.0, 0.0))


def nose_between_deg(a: Quat, b: Quat) -> float:
    """The angle between the noses of two attitudes."""
    n, m = rotate(a, (1.0, 0.0, 0.0)), rotate(b, (1.0, 0.0, 0.0))
    return math.degrees(math.acos(max(-1.0, min(1.0, sum(x * y for x, y in zip(n, m, strict=True))))))
