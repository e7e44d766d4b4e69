"""Flights from Python: `from sitl import fly`. The same lockstep flight as `sitl fly`, and the record of it.

A mission and a vehicle go in; arrays of what really happened and of what the vehicle told come out (docs/python.md).
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools import lockstep, metrics
from gcs_tools import plan as plans
from gcs_tools.flight import Flight
from gcs_tools.plan import Plan, Streamed
from sitl.control.guidance import STRAIGHT, Actuation, Effort, Guidance, Steering
from sitl.control.reference import Reference, sample
from sitl.frames import quaternion_to_yxz
from sitl.model.propulsion import thrust
from sitl.navigation import NavState
from sitl.quaternion import Vec3
from sitl.vehicle import Pilot, Vehicle, load_vehicle
from sitl.vehicle_spec import VehicleSpec

Array = NDArray[np.float64]
Controller = Callable[[float, NavState, Reference], Steering | Actuation]
CAUSES = ("gravity", "thrust", "side_force", "aero", "flaps")
COLUMNS = (
    "t_s", "north_m", "east_m", "down_m", "roll_deg", "pitch_deg", "yaw_deg",
    "thrust_left_N", "thrust_right_N", "flap_left_deg", "flap_right_deg",
    *(f"{cause}_{axis}_N" for cause in CAUSES for axis in "xyz"),
    "nav_north_m", "nav_east_m", "nav_down_m",
    "ref_north_m", "ref_east_m", "ref_down_m",
)  # fmt: skip


class Flown(NamedTuple):
    """A flight and what is known of it, 50 samples a second, times in s from its start, NED.

    samples: (n, len(COLUMNS)) of the plant's own state, of what the vehicle believed and of what it was to follow.
    reported: what `sitl fly --json` prints, from the positions told over the link. true: the same figures from the
    plant's state. Both are empty where the flight failed. vehicle: as it was left.
    """

    mission: str
    samples: Array
    reported: dict[str, Any]
    true: dict[str, Any]
    vehicle: Vehicle

    def column(self, name: str) -> Array:
        """One of COLUMNS."""
        return self._columns(name)[:, 0]

    def _columns(self, *names: str) -> Array:
        return self.samples[:, [COLUMNS.index(name) for name in names]]

    @property
    def t_s(self) -> Array:
        return self.column("t_s")

    @property
    def position_m(self) -> Array:
        """(n, 3), where the vehicle truly was."""
        return self._columns("north_m", "east_m", "down_m")

    @property
    def reported_m(self) -> Array:
        """(n, 3), where the vehicle believed to be: its navigation state, which it tells over the link."""
        return self._columns("nav_north_m", "nav_east_m", "nav_down_m")

    @property
    def reference_m(self) -> Array:
        """(n, 3)"""
        return self._columns("ref_north_m", "ref_east_m", "ref_down_m")

    @property
    def angles_deg(self) -> Array:
        """(n, 3), the paper's φ, θ, ψ (YXZ; θ about 90° in hover)."""
        return self._columns("roll_deg", "pitch_deg", "yaw_deg")

    @property
    def thrust_N(self) -> Array:
        """(n, 2), left and right."""
        return self._columns("thrust_left_N", "thrust_right_N")

    @property
    def flap_deg(self) -> Array:
        """(n, 2), left and right."""
        return self._columns("flap_left_deg", "flap_right_deg")

    def __repr__(self) -> str:
        t = self.t_s
        length = f"{t[-1] - t[0]:.1f} s" if t.size else "nothing"
        error = f", true MAE {' / '.join(f'{v:.4f}' for v in self.true['mae'])} m" if self.true else ", not completed"
        return f"<Flown {self.mission}, {self.vehicle.spec.name}, {length}{error}>"


class FlightError(RuntimeError):
    """A flight that did not reach its end. flown: what was recorded until then, without figures."""

    def __init__(self, reason: str, flown: Flown) -> None:
        super().__init__(reason)
        self.flown = flown


class _Recorded(Vehicle):
    """A vehicle that keeps a sample of itself after each call of `advance`."""

    def __init__(self, *args: Any, **options: Any) -> None:
        self.samples: list[list[float]] = []
        super().__init__(*args, **options)

    def advance(self, until_us: int, trace: Array | None = None) -> None:
        super().advance(until_us, trace)
        seen, a = self.snapshot(), self.spec.airframe.airframe
        s, acting = seen.truth, self.loads()
        self.samples.append([
            self.now_us * 1e-6, s.north_m, s.east_m, s.down_m,
            *map(math.degrees, quaternion_to_yxz(s.qw, s.qx, s.qy, s.qz)),
            thrust(a, s.rotor_left_rad_s), thrust(a, s.rotor_right_rad_s),
            math.degrees(s.flap_left_rad), math.degrees(s.flap_right_rad),
            *(component for cause in CAUSES for component in acting[cause].force_B),
            *seen.nav[:3], *seen.reference[:3],
        ])  # fmt: skip


def piloted(controller: Controller) -> Pilot:
    """A Vehicle's pilot that lets `controller` fly in place of the cascade wherever the cascade would."""

    def pilot(t_s: float, nav: NavState, guidance: Guidance) -> Guidance:
        if guidance.effort != Effort.FLY:
            return guidance
        wanted = controller(t_s, nav, sample(guidance.trajectory, t_s))
        numbers = [float(v) for v in wanted]  # an integer would be another type to the compiler
        if isinstance(wanted, Actuation):
            return guidance._replace(effort=int(Effort.DIRECT), actuation=Actuation(*numbers))
        return guidance._replace(steering=Steering(*numbers))

    return pilot


def attitude(q_NB: tuple[float, float, float, float], thrust_N: float, rates_B: Vec3 = (0.0, 0.0, 0.0)) -> Steering:
    """For a controller to return: the inner loops hold this attitude. thrust_N: along the nose, with the wing's."""
    return Steering(1.0, *q_NB, *rates_B, thrust_N)


def body_rates(rates_B: Vec3, thrust_N: float) -> Steering:
    """For a controller to return: the cascade's rate loop holds these rates [rad/s]."""
    return Steering(2.0, *STRAIGHT[1:5], *rates_B, thrust_N)


def fly(
    mission: str | Path | Plan,
    vehicle: str | VehicleSpec = "yawsitter",
    *,
    seed: int = 1,
    wind_N: Vec3 = (0.0, 0.0, 0.0),
    gust_m_s: float = 0.0,
    parameters: Mapping[str, float] | None = None,
    plant: Mapping[str, float] | None = None,
    believed: Mapping[str, float] | None = None,
    controller: Controller | None = None,
) -> Flown:
    """Fly a mission as `sitl fly` does, from standing to standing, and return the record.

    mission: a file (.yaml, .plan, .waypoints). vehicle: a bundled name, a YAML file or a loaded one. wind_N,
    gust_m_s: the air [m/s]. parameters: values for this flight. plant, believed: airframe numbers changed in what
    flies, and in what its controller takes it to be. controller: called before every control step in the air with the
    simulation time [s], the navigation state and the reference; what it returns (Actuation, `attitude`, `body_rates`)
    is flown in place of the cascade's outer part. Raises ConfigError for settings that can't be used, FlightError where
    the flight fails.
    """
    plan = mission if isinstance(mission, tuple) else plans.load(mission)
    spec = vehicle if isinstance(vehicle, VehicleSpec) else load_vehicle(vehicle)
    recorded = lockstep.build(
        plan,
        spec,
        _Recorded,
        plant=plant,
        believed=believed,
        seed=seed,
        wind_N=wind_N,
        gust_m_s=gust_m_s,
        overrides=parameters,
    )
    recorded.pilot = piloted(controller) if controller is not None else None
    flight, _, factor = lockstep.fly(plan, recorded)
    samples = _between(np.array(recorded.samples), flight)
    if isinstance(plan, Streamed) and samples.size:
        samples[:, -3:] = [plan.reference.at(float(t)).position_m for t in samples[:, 0]]
    flown = Flown(plan.name, samples, {}, {}, recorded)
    fault = flight.client.fault
    if fault is not None or flight.measured_s is None:
        raise FlightError(f"{plan.name}: {fault or f'not done after {lockstep.LIMIT_S:g} s'}", flown)
    true = metrics.evaluate(_track(flown), flight.measured_s, flight.key_points())
    reported, really = (
        metrics.report(plan.name, spec.name, flight.measured_s, m, factor) for m in (flight.metrics(), true)
    )
    return flown._replace(reported=reported, true=really)


def _between(samples: Array, flight: Flight) -> Array:
    """The samples of the flight itself, times from its start; all there are where it never began."""
    if flight.t0_s is None:
        return samples
    samples[:, 0] -= flight.t0_s
    end_s = math.inf if flight.measured_s is None else flight.measured_s
    return samples[(samples[:, 0] > -1e-6) & (samples[:, 0] < end_s + 1e-6)]


def _track(flown: Flown) -> metrics.Track:
    t = flown.t_s
    return metrics.Track(
        t_s=t,
        reference_m=flown.reference_m,
        position_m=flown.position_m,
        angles=np.column_stack((t, flown.angles_deg)),
        thrust=np.column_stack((t, flown.thrust_N.sum(axis=1))),
        flaps=np.column_stack((t, flown.flap_deg)),
    )
