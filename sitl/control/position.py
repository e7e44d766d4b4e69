"""Position loop: from the position error to a velocity command (paper, Position and Velocity Controller)."""

from sitl.control.gains import Loop
from sitl.control.pid import pid
from sitl.jit import kernel
from sitl.quaternion import Vec3


@kernel
def velocity_command(
    g: Loop, error_N: Vec3, integral_N: Vec3, error_rate_N: Vec3, feedforward_N: Vec3, limit_m_s: float
) -> Vec3:
    """V = K_p e + K_i ∫e + K_d ė + feed-forward [m/s, N], each axis within ±limit."""
    x = pid(g.x, error_N[0], integral_N[0], error_rate_N[0]) + feedforward_N[0]
    y = pid(g.y, error_N[1], integral_N[1], error_rate_N[1]) + feedforward_N[1]
    z = pid(g.z, error_N[2], integral_N[2], error_rate_N[2]) + feedforward_N[2]
    m = limit_m_s
    return max(-m, min(m, x)), max(-m, min(m, y)), max(-m, min(m, z))
