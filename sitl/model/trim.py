"""Trimmed flight: the pitch, thrust and flaps with which the vehicle holds a steady level airspeed."""

import argparse
import json
import math
from typing import Any, NamedTuple

from sitl.frames import GRAVITY_M_S2
from sitl.model.aerodynamics import flap_loads, wing_loads
from sitl.model.airframe import Airframe
from sitl.model.propulsion import wake_speed


class TrimPoint(NamedTuple):
    airspeed_m_s: float
    pitch_rad: float
    thrust_N: float
    flap_rad: float
    converged: bool


def unbalanced(a: Airframe, airspeed_m_s: float, pitch_rad: float, thrust_N: float, flap_rad: float) -> list[float]:
    """[F_x, F_z in N, M_y in N·m] in B, gravity included: all zero in trim. Level flight north, wings level."""
    u, w = airspeed_m_s * math.cos(pitch_rad), airspeed_m_s * math.sin(pitch_rad)
    wake = wake_speed(a, 0.5 * thrust_N, u)
    wing_f, wing_m = wing_loads(a, u, w, wake, wake)
    flap_f, flap_m = flap_loads(a, w, wake, wake, flap_rad, flap_rad)
    weight = a.mass_kg * GRAVITY_M_S2
    return [
        thrust_N + wing_f[0] - weight * math.sin(pitch_rad),
        wing_f[2] + flap_f[2] + weight * math.cos(pitch_rad),
        wing_m[1] + flap_m[1],
    ]


def _solve(a: Airframe, airspeed_m_s: float, start: TrimPoint) -> TrimPoint:
    """Newton's method with a numerical Jacobian and halved steps where a full one does not help."""
    import numpy as np

    x = np.array([start.pitch_rad, start.thrust_N, start.flap_rad])
    scale = np.array([a.mass_kg * GRAVITY_M_S2, a.mass_kg * GRAVITY_M_S2, 1.0])
    residual = np.array(unbalanced(a, airspeed_m_s, *x)) / scale
    for _ in range(60):
        if np.abs(residual).max() < 1e-12:
            break
        jacobian = np.empty((3, 3))
        for i, h in enumerate((1e-6, 1e-5, 1e-6)):
            moved = x.copy()
            moved[i] += h
            jacobian[:, i] = (np.array(unbalanced(a, airspeed_m_s, *moved)) / scale - residual) / h
        try:
            step = np.linalg.solve(jacobian, -residual)
        except np.linalg.LinAlgError:
            break
        size = 1.0
        while size > 1e-4:
            trial = x + size * step
            trial[1] = max(trial[1], 0.0)
            new = np.array(unbalanced(a, airspeed_m_s, *trial)) / scale
            if np.abs(new).max() < np.abs(residual).max():
                break
            size *= 0.5
        else:
            break
        x, residual = trial, new
    within = abs(x[2]) <= a.flap_max_rad and 2 * a.thrust_min_N <= x[1] <= 2 * a.thrust_max_N
    return TrimPoint(
        airspeed_m_s, float(x[0]), float(x[1]), float(x[2]), bool(np.abs(residual).max() < 1e-9 and within)
    )


def solve(a: Airframe, airspeed_m_s: float = 0.0) -> TrimPoint:
    """The trim at a level airspeed, reached by small steps from hover so that it stays on hover's branch.

    `converged` is False where the balance is not found or lies beyond the actuators' limits.
    """
    point = _solve(a, 0.0, TrimPoint(0.0, math.pi / 2, a.mass_kg * GRAVITY_M_S2, 0.0, False))
    steps = math.ceil(abs(airspeed_m_s) / 0.25)
    for k in range(1, steps + 1):
        point = _solve(a, airspeed_m_s * k / steps, point)
    return point


def as_dict(point: TrimPoint) -> dict[str, Any]:
    return {
        "airspeed_m_s": point.airspeed_m_s,
        "pitch_deg": math.degrees(point.pitch_rad),
        "thrust_N": point.thrust_N,
        "flap_deg": math.degrees(point.flap_rad),
        "converged": point.converged,
    }


def main(args: argparse.Namespace, airframe: Airframe) -> int:
    """`sitl trim`: print the trim as text or JSON; exit status 1 where there is none."""
    result = as_dict(solve(airframe, args.airspeed))
    if args.json:
        print(json.dumps(result))
    else:
        print(
            f"airspeed {result['airspeed_m_s']:.2f} m/s: pitch {result['pitch_deg']:.2f}°, "
            f"thrust {result['thrust_N']:.3f} N, flaps {result['flap_deg']:.2f}°"
            + ("" if result["converged"] else "  (no trim found within the actuators' limits)")
        )
    return 0 if result["converged"] else 1
