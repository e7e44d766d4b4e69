"""One PID axis as a pure function: the state goes in and comes out."""

from sitl.control.gains import Pid
from sitl.jit import kernel


@kernel
def integrated(integral: float, error: float, dt_s: float, limit: float, held: bool) -> float:
    """The integral one step later, within ±limit.

    `held`: an actuator further down is saturated; the integral may then only shrink.
    """
    new = integral + error * dt_s
    if held and abs(new) > abs(integral):
        return integral
    return max(-limit, min(limit, new))


@kernel
def pid(g: Pid, error: float, integral: float, error_rate: float) -> float:
    """K_p e + K_i ∫e + K_d ė."""
    return g.p * error + g.i * integral + g.d * error_rate


@kernel
def smoothed(state: float, value: float, dt_s: float, tau_s: float) -> float:
    """First-order low-pass `state` one step further toward `value`; with tau 0 it is `value`."""
    return value if tau_s <= 0.0 else state + (value - state) * (dt_s / (tau_s + dt_s))
