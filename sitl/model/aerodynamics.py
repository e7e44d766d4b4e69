"""The wing and its flaps, at any angle of attack."""

import math

from sitl.jit import kernel
from sitl.model.airframe import Airframe
from sitl.quaternion import Vec3

Coefficients = tuple[float, float, float]


@kernel
def separated(a: Airframe, alpha: float) -> float:
    """How far the flow has left the wing: 0 attached, 1 separated; ½ at ±α₀.

    σ(α) = (1 + e^{−M(α−α₀)} + e^{M(α+α₀)}) / ((1 + e^{−M(α−α₀)}) (1 + e^{M(α+α₀)}))   (Beard & McLain, Eq. 4.10),
    which is 1 − n / ((1 + n) (1 + f)) with n = e^{M(α₀−|α|)} and f = e^{−M(α₀+|α|)} = n e^{−2Mα₀}: one exponential.
    """
    # beyond 35 the exponential no longer changes the sum with one in double precision
    near = math.exp(min(35.0, a.stall_sharpness * (a.stall_angle_rad - abs(alpha))))
    far = near * math.exp(-2.0 * a.stall_sharpness * a.stall_angle_rad)
    return 1.0 - near / ((1.0 + near) * (1.0 + far))


@kernel
def coefficients(a: Airframe, alpha: float, cos_alpha: float, sin_alpha: float) -> Coefficients:
    """(C_L, C_D, C_M) of the wing without flaps at α [rad] in [−π, π].

    Attached: C_L = C_L0 + C_Lα α, C_D = C_D0 + C_L²/(π e A), C_M = C_M0 + C_Mα α (paper Eq. CL, CD, CM).
    Separated: a flat plate with normal force C_N = C_D90 sin α (Hoerner, Fluid-Dynamic Drag, ch. 3), whose centre of
    pressure moves from ¼ chord at α = 0 through ½ at 90° to ¾ in reversed flow.
    """
    s = separated(a, alpha)
    attached_lift = a.lift_at_zero + a.lift_slope * alpha
    aspect_ratio = a.wing_span_m * a.wing_span_m / a.wing_area_m2
    attached_drag = a.drag_at_zero + attached_lift * attached_lift * (1.0 / (math.pi * a.oswald * aspect_ratio))
    normal = a.plate_drag * sin_alpha
    plate_moment = -0.5 / math.pi * abs(alpha) * normal
    return (
        (1.0 - s) * attached_lift + s * normal * cos_alpha,
        (1.0 - s) * attached_drag + s * (a.drag_at_zero + normal * sin_alpha),
        (1.0 - s) * (a.moment_at_zero + a.moment_slope * alpha) + s * plate_moment,
    )


@kernel
def panel(a: Airframe, u_m_s: float, w_m_s: float, fraction: float) -> Vec3:
    """(F_x, F_z [N], M_y [N·m]) in B of a `fraction` of the wing in the flow (u, w) [m/s].

    F = (L sin α − D cos α, −L cos α − D sin α), M_y = q S c̄ C_M + F_z (X_a − X_g)  (paper Eq. 9–10, 21–22, with the
    panel's area in M_y). α = atan2(w, u), q = ½ρ(u² + w²).
    """
    speed = math.sqrt(u_m_s * u_m_s + w_m_s * w_m_s)
    if speed < 1e-6:
        return 0.0, 0.0, 0.0
    k = 1.0 / speed
    cos_alpha, sin_alpha = k * u_m_s, k * w_m_s
    lift, drag, moment = coefficients(a, math.atan2(w_m_s, u_m_s), cos_alpha, sin_alpha)
    q = 0.5 * a.air_density_kg_m3 * speed * speed * fraction
    fx = q * a.wing_area_m2 * (lift * sin_alpha - drag * cos_alpha)
    fz = q * a.wing_area_m2 * (-lift * cos_alpha - drag * sin_alpha)
    return fx, fz, q * a.wing_moment_area_m2 * a.chord_m * moment + fz * a.ac_behind_cg_m


@kernel
def wing_loads(
    a: Airframe, u_m_s: float, w_m_s: float, wake_left_m_s: float, wake_right_m_s: float
) -> tuple[Vec3, Vec3]:
    """Force [N] and moment [N·m] in B of the whole wing without flaps: the part in each slipstream, and the rest.

    The slipstreams' parts act at a lever of their own, so unequal wakes roll and yaw the vehicle.
    """
    f = 0.5 * a.immersed_fraction
    lx, lz, lm = panel(a, wake_left_m_s, w_m_s, f)
    rx, rz, rm = panel(a, wake_right_m_s, w_m_s, f)
    fx, fz, fm = panel(a, u_m_s, w_m_s, 1.0 - a.immersed_fraction)
    arm = a.wake_arm_m
    return (lx + rx + fx, 0.0, lz + rz + fz), (arm * (rz - lz), lm + rm + fm, arm * (lx - rx))


@kernel
def flap_pressure(a: Airframe, w_m_s: float, wake_m_s: float) -> float:
    """Dynamic pressure [Pa] on a flap in its slipstream."""
    return 0.5 * a.air_density_kg_m3 * (wake_m_s * wake_m_s + w_m_s * w_m_s)


@kernel
def flap_loads(
    a: Airframe, w_m_s: float, wake_left_m_s: float, wake_right_m_s: float, left_rad: float, right_rad: float
) -> tuple[Vec3, Vec3]:
    """Force [N] and moment [N·m] in B of the two flaps (positive deflection: trailing edge down).

    F_z = −q S_f C_Lδ δ, M_x = lever × q S_f C_Lδ (δ_L − δ_R), M_y = q S_f c̄ C_Mδ δ  (paper Eq. 10, m_flap).
    """
    left = flap_pressure(a, w_m_s, wake_left_m_s) * a.flap_area_m2 * left_rad
    right = flap_pressure(a, w_m_s, wake_right_m_s) * a.flap_area_m2 * right_rad
    return (
        (0.0, 0.0, -a.flap_lift_slope * (left + right)),
        (
            a.flap_roll_arm_m * a.flap_lift_slope * (left - right),
            a.chord_m * a.flap_moment_slope * (left + right),
            0.0,
        ),
    )
