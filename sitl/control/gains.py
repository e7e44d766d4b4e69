"""The 36 gains of the cascade and the settings beside them."""

from typing import NamedTuple

from sitl.control.disturbance import Bandwidth
from sitl.jit import kernel


class Pid(NamedTuple):
    p: float
    i: float
    d: float


class Loop(NamedTuple):
    """One row block of the paper's gain table: x, y, z for position and velocity; φ, θ, ψ or P, Q, R for the others."""

    x: Pid
    y: Pid
    z: Pid


class Gains(NamedTuple):
    """position [1/s, 1/s², -], velocity [1/s, 1/s², -], attitude [1/s, 1/s², -], rate [N·m s, N·m, N·m s²]."""

    position: Loop
    velocity: Loop
    attitude: Loop
    rate: Loop


LOOPS = {"POS": "position", "VEL": "velocity", "ATT": "attitude", "RATE": "rate"}
GAIN_NAMES = tuple(f"{loop}_{axis}_{term}" for loop in LOOPS for axis in "XYZ" for term in "PID")


def from_names(values: dict[str, float]) -> Gains:
    """Gains from a mapping of the 36 parameter names (POS_X_P … RATE_Z_D) to numbers."""

    def loop(name: str) -> Loop:
        return Loop(*(Pid(*(float(values[f"{name}_{axis}_{term}"]) for term in "PID")) for axis in "XYZ"))

    return Gains(*(loop(name) for name in LOOPS))


class PerAxis(NamedTuple):
    x: float
    y: float
    z: float


class Settings(NamedTuple):
    """What shapes the cascade beside its gains. Switches are 0.0 or 1.0."""

    feedforward_velocity: float  # the reference's velocity is added to the velocity command
    feedforward_acceleration: float  # the reference's acceleration is added to the acceleration command
    feedforward_inverse: float  # attitude rates and moments that the reference needs, from the trim's inverse model
    quaternion_error: float  # 1: attitude error from quaternions; 0: from the paper's YXZ angles
    velocity_max_m_s: float  # of the velocity command, each axis
    acceleration_max_m_s2: float  # of the acceleration command, horizontally and vertically
    velocity_d_tau_s: float  # filter of the velocity loop's derivative
    rate_d_tau_s: float  # filter of the rate loop's derivative
    motor_tau_s: float  # the motors' lag as the controller knows it, for its slipstream estimate
    flap_tau_s: float  # the same of the flaps, for the disturbance observer
    disturbance: Bandwidth  # of the observer of what the force laws don't explain
    slipstream_floor_N: float  # total thrust below which the flaps' pressure is not believed to fall
    thrust_floor_N: float  # least total thrust in flight: the flaps live in the slipstream
    thrust_recover_N: float  # the same while the nose is far off its target: thrust is what turns it
    braking_rad_s2: PerAxis  # angular accelerations that the actuators can brake a turn with, B
    lean_max_rad: float  # largest tilt of the thrust from the vertical that the position loops may ask for


@kernel
def settled(s: Settings) -> Settings:
    """The settings in numbers of a kernel's own, as `sitl.model.airframe.loaded` has the airframe."""
    return Settings(
        s.feedforward_velocity, s.feedforward_acceleration, s.feedforward_inverse, s.quaternion_error,
        s.velocity_max_m_s, s.acceleration_max_m_s2, s.velocity_d_tau_s, s.rate_d_tau_s, s.motor_tau_s, s.flap_tau_s,
        Bandwidth(s.disturbance.force_rad_s, s.disturbance.moment_rad_s), s.slipstream_floor_N, s.thrust_floor_N,
        s.thrust_recover_N, PerAxis(s.braking_rad_s2.x, s.braking_rad_s2.y, s.braking_rad_s2.z), s.lean_max_rad,
    )  # fmt: skip
