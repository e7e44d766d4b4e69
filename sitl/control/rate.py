"""Rate loop: from the error of the body rates to a moment (paper, Desired Moments, without the factor J⁻¹)."""

from sitl.control.gains import Loop
from sitl.control.pid import pid
from sitl.jit import kernel
from sitl.quaternion import Vec3


@kernel
def moment(g: Loop, error_B: Vec3, integral_B: Vec3, error_rate_B: Vec3, feedforward_B: Vec3) -> Vec3:
    """M = K_p e + K_i ∫e + K_d ė + feed-forward [N·m, B]."""
    return (
        pid(g.x, error_B[0], integral_B[0], error_rate_B[0]) + feedforward_B[0],
        pid(g.y, error_B[1], integral_B[1], error_rate_B[1]) + feedforward_B[1],
        pid(g.z, error_B[2], integral_B[2], error_rate_B[2]) + feedforward_B[2],
    )
