"""Velocity loop: from the velocity error to the specific force that the vehicle must make (paper, Desired Forces)."""

import math

from sitl.control.gains import Loop
from sitl.control.pid import pid
from sitl.frames import GRAVITY_M_S2
from sitl.jit import kernel
from sitl.quaternion import Vec3


@kernel
def specific_force(
    g: Loop,
    error_N: Vec3,
    integral_N: Vec3,
    error_rate_N: Vec3,
    feedforward_N: Vec3,
    limit_m_s2: float,
    lean_max_rad: float,
) -> Vec3:
    """f = a − g with a = K_p e + K_i ∫e + K_d ė + feed-forward [m/s², N].

    a stays within ±limit; f keeps at least a fifth of gravity's lift, and tilts from the vertical by lean_max at most.
    """
    m = limit_m_s2
    x = pid(g.x, error_N[0], integral_N[0], error_rate_N[0]) + feedforward_N[0]
    y = pid(g.y, error_N[1], integral_N[1], error_rate_N[1]) + feedforward_N[1]
    z = max(-m, min(m, pid(g.z, error_N[2], integral_N[2], error_rate_N[2]) + feedforward_N[2]))
    lift = max(0.2 * GRAVITY_M_S2, GRAVITY_M_S2 - z)
    horizontal = math.sqrt(x * x + y * y)
    allowed = min(m, lift * math.tan(lean_max_rad))
    k = allowed / horizontal if horizontal > allowed else 1.0
    return k * x, k * y, -lift
