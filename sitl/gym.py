"""The vehicle as a Gymnasium environment: `gymnasium.make("sitl.gym:YawSitter-v0")` (extra [gym]; docs/python.md).

It steps the same Vehicle as everything else, started in hover in the air, with the agent in place of the cascade or of
its outer loops. The same seed and actions give the same episode, bit for bit.
"""

import math
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from sitl.closed_loop import knowing
from sitl.control.attitude import attitude_of
from sitl.control.guidance import STRAIGHT, Actuation, Effort, Guidance, Steering
from sitl.control.reference import rest_at
from sitl.model.propulsion import rotor_speed
from sitl.model.rigid_body import State
from sitl.model.trim import solve
from sitl.navigation import NavState
from sitl.quaternion import Vec3
from sitl.vehicle import Vehicle, load_vehicle
from sitl.vehicle_spec import VehicleSpec

Array = NDArray[np.float32]
HEIGHT_M = 5.0  # of the hover point and of the circle
FAR_M = 5.0  # from the reference: the episode is lost
RATE_MAX_RAD_S, RATE_SCALE_RAD_S, LOST = 3.0, 10.0, -10.0
CIRCLE_RADIUS_M, CIRCLE_SPEED_M_S, CIRCLE_START_S = 2.0, 1.0, 1.0
STEP_US = 20_000
TASKS, ACTIONS = ("hover", "track"), ("actuators", "rates")
_OFF_M, _OFF_M_S, _OFF_RAD = 0.5, 0.3, 0.15  # where an episode starts off its reference, at most


def reference(task: str, t_s: float) -> tuple[Vec3, Vec3]:
    """(position [m], velocity [m/s], NED) that a task wants: a point, or a circle that passes through it.

    The angle on the circle is ω (t − τ (1 − e^(−t/τ))): from rest to full speed within about 3 τ, clockwise.
    """
    if task == "hover":
        return (0.0, 0.0, -HEIGHT_M), (0.0, 0.0, 0.0)
    rate, tau, r = CIRCLE_SPEED_M_S / CIRCLE_RADIUS_M, CIRCLE_START_S, CIRCLE_RADIUS_M
    fade = 1.0 - math.exp(-t_s / tau)
    angle = rate * (t_s - tau * fade)
    speed = r * rate * fade
    s, c = math.sin(angle), math.cos(angle)
    return (r * (c - 1.0), r * s, -HEIGHT_M), (-speed * s, speed * c, 0.0)


class YawSitterEnv(gymnasium.Env[Array, Array]):
    """Hold a point, or follow a circle; 50 actions a second.

    task: "hover" or "track". action: "actuators" (thrust left, right, flap left, right) or "rates" (body rates p, q, r
    and thrust, held by the vehicle's rate loop), each −1 … 1. vehicle: a bundled name, a YAML file or a loaded one.
    wind_N, gust_m_s: the air [m/s]. episode_s: truncated after it.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  as Gymnasium declares it

    def __init__(
        self,
        task: str = "hover",
        action: str = "actuators",
        vehicle: str | VehicleSpec = "yawsitter",
        *,
        wind_N: Vec3 = (0.0, 0.0, 0.0),
        gust_m_s: float = 0.0,
        episode_s: float = 10.0,
        render_mode: str | None = None,
    ) -> None:
        choices = (("task", task, TASKS), ("action", action, ACTIONS), ("render_mode", render_mode, (None,)))
        for name, value, allowed in choices:
            if value not in allowed:
                raise ValueError(f"{name} {value!r} is not one of {', '.join(map(repr, allowed))}")
        if not episode_s > 0.0:
            raise ValueError(f"episode_s {episode_s!r} must be above 0")
        self.task, self.action, self.episode_s, self.render_mode = task, action, episode_s, render_mode
        self.vehicle_spec = vehicle if isinstance(vehicle, VehicleSpec) else load_vehicle(vehicle)
        self._air: dict[str, Any] = {"wind_N": wind_N, "gust_m_s": gust_m_s}
        self._rest = rest_at(0.0, 0.0, -HEIGHT_M, 0.0)
        self._trim = solve(self.vehicle_spec.airframe.airframe)
        self.action_space = Box(-1.0, 1.0, (4,), np.float32)
        self.observation_space = Box(-np.inf, np.inf, (16,), np.float32)
        self.vehicle: Vehicle | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """A new episode near the reference's start, in hover trim; one control step is flown for the first sight."""
        super().reset(seed=seed)
        draw = self.np_random.uniform
        vehicle = self.vehicle = Vehicle(self.vehicle_spec, seed=int(self.np_random.integers(2**31)), **self._air)
        half_N, flap = 0.5 * self._trim.thrust_N, self._trim.flap_rad
        pitch, lean = self._trim.pitch_rad + draw(-_OFF_RAD, _OFF_RAD), draw(-_OFF_RAD, _OFF_RAD)
        north, east, up = draw(-_OFF_M, _OFF_M, 3)
        rotor = rotor_speed(self.vehicle_spec.airframe.airframe, half_N)
        numbers = (north, east, -HEIGHT_M - up, *draw(-_OFF_M_S, _OFF_M_S, 3), *attitude_of(0.0, pitch, lean))
        state = State(*map(float, (*numbers, 0.0, 0.0, 0.0, rotor, rotor, flap, flap)))
        vehicle.loop = vehicle.loop._replace(state=state, estimate=knowing(state))
        self._fly(Actuation(half_N, half_N, flap, flap), vehicle.step_us)
        self._start_us = vehicle.now_us
        return self._observation(), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Fly 20 ms. info: "true_error_m", the distance from the reference."""
        if self.vehicle is None:
            raise RuntimeError("reset() comes before step()")
        x = np.clip(np.asarray(action, dtype=float), -1.0, 1.0).tolist()
        self._fly(self._wanted(x), STEP_US)
        seen = self.vehicle.snapshot()
        s = seen.truth
        error_m = math.dist(s[:3], reference(self.task, self._t_s)[0])
        lost = error_m > FAR_M or seen.feet_down > 0 or s.down_m >= 0.0 or not math.isfinite(error_m)
        turning = math.hypot(s.p_rad_s, s.q_rad_s, s.r_rad_s)
        reward = 1.0 / (1.0 + error_m * error_m) - 0.1 * min(1.0, turning / RATE_SCALE_RAD_S)
        over = not lost and self._t_s >= self.episode_s - 1e-9
        return self._observation(), LOST if lost else reward, lost, over, {"true_error_m": error_m}

    @property
    def _t_s(self) -> float:
        assert self.vehicle is not None
        return (self.vehicle.now_us - self._start_us) * 1e-6

    def _wanted(self, x: list[float]) -> Actuation | Steering:
        a = self.vehicle_spec.airframe.airframe
        if self.action == "rates":
            p, q, r = (RATE_MAX_RAD_S * v for v in x[:3])
            return Steering(2.0, *STRAIGHT[1:5], p, q, r, (1.0 + x[3]) * a.thrust_max_N)
        least, span = a.thrust_min_N, a.thrust_max_N - a.thrust_min_N
        left, right = (least + 0.5 * (1.0 + v) * span for v in x[:2])
        return Actuation(left, right, x[2] * a.flap_max_rad, x[3] * a.flap_max_rad)

    def _fly(self, wanted: Actuation | Steering, span_us: int) -> None:
        assert self.vehicle is not None
        if isinstance(wanted, Actuation):
            guidance = Guidance(int(Effort.DIRECT), self._rest, actuation=wanted)
        else:
            guidance = Guidance(int(Effort.FLY), self._rest, steering=wanted)

        def pilot(t_s: float, nav: NavState, onboard: Guidance) -> Guidance:
            return guidance

        self.vehicle.pilot = pilot
        self.vehicle.advance(self.vehicle.now_us + span_us)

    def _observation(self) -> Array:
        assert self.vehicle is not None
        nav = self.vehicle.snapshot().nav
        position, velocity = reference(self.task, self._t_s)
        sign = math.copysign(1.0, nav.qw)
        return np.array(
            (
                *(a - b for a, b in zip(nav[:3], position, strict=True)),
                *(a - b for a, b in zip(nav[3:6], velocity, strict=True)),
                *(sign * q for q in nav[6:10]),
                *nav[10:13],
                *velocity,
            ),
            dtype=np.float32,
        )


gymnasium.register("YawSitter-v0", entry_point="sitl.gym:YawSitterEnv")
