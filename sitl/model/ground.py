"""Contact with flat ground: each touching point is a spring with damping, and friction that builds up with sliding."""

import math

from sitl.jit import kernel
from sitl.model.airframe import Gear
from sitl.model.rigid_body import State
from sitl.quaternion import Vec3, rotate, rotate_back

FEET = 4


@kernel
def ground_loads(g: Gear, s: State) -> tuple[Vec3, Vec3, int]:
    """Force [N] and moment [N·m] in B of the ground, and how many of the four feet touch it.

    Normal force k d + c ḋ, never pulling; friction μ N, opposite to the sliding velocity, in proportion to it below
    `slip_m_s` (Coulomb friction made smooth).
    """
    fx, fy, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    feet = 0
    if s.down_m + 1.0 < g.ground_down_m:  # no point is further than 1 m from the centre of mass
        return (fx, fy, fz), (mx, my, mz), feet
    q = (s.qw, s.qx, s.qy, s.qz)
    for i in range(g.points_B.shape[0]):
        x, y, z = g.points_B[i, 0], g.points_B[i, 1], g.points_B[i, 2]
        depth = s.down_m + rotate(q, (x, y, z))[2] - g.ground_down_m
        if depth <= 0.0:
            continue
        if i < FEET:
            feet += 1
        spin = (
            s.q_rad_s * z - s.r_rad_s * y,
            s.r_rad_s * x - s.p_rad_s * z,
            s.p_rad_s * y - s.q_rad_s * x,
        )
        spin_n, spin_e, spin_d = rotate(q, spin)
        vn, ve, vd = s.v_north_m_s + spin_n, s.v_east_m_s + spin_e, s.v_down_m_s + spin_d
        normal = max(0.0, g.stiffness_N_m * depth + g.damping_N_s_m * vd)
        grip = -g.friction * normal / math.sqrt(vn * vn + ve * ve + g.slip_m_s * g.slip_m_s)
        px, py, pz = rotate_back(q, (grip * vn, grip * ve, -normal))
        fx, fy, fz = fx + px, fy + py, fz + pz
        mx, my, mz = mx + y * pz - z * py, my + z * px - x * pz, mz + x * py - y * px
    return (fx, fy, fz), (mx, my, mz), feet
