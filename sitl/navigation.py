"""The navigation state: all that a controller or the onboard logic may know of the vehicle's motion."""

from typing import NamedTuple


class NavState(NamedTuple):
    """Position, velocity, attitude and rates as the vehicle believes them to be (SI, radians).

    World N is north-east-down with its origin where the vehicle stood at start; body B is the aeroplane's
    forward-right-down (x out of the nose: up in hover). `q_NB` = (qw, qx, qy, qz) takes B to N.
    """

    north_m: float
    east_m: float
    down_m: float
    v_north_m_s: float
    v_east_m_s: float
    v_down_m_s: float
    qw: float
    qx: float
    qy: float
    qz: float
    p_rad_s: float
    q_rad_s: float
    r_rad_s: float
