"""One flight of the evaluation: flown in lockstep through the link, and recorded from the truth for the figures."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools import lockstep, metrics
from gcs_tools import plan as plans
from gcs_tools.plan import Streamed
from sitl.frames import quaternion_to_yxz
from sitl.model.propulsion import thrust
from sitl.reproduce.cases import Case
from sitl.vehicle import Vehicle, load_vehicle, with_airframe

Array = NDArray[np.float64]
HERE = Path(__file__).parent
CAUSES = ("gravity", "thrust", "side_force", "aero", "flaps")
COLUMNS = (
    "t_s", "north_m", "east_m", "down_m", "roll_deg", "pitch_deg", "yaw_deg",
    "thrust_left_N", "thrust_right_N", "flap_left_deg", "flap_right_deg",
    *(f"{cause}_{axis}_N" for cause in CAUSES for axis in "xyz"),
    "ref_north_m", "ref_east_m", "ref_down_m",
)  # fmt: skip


class FlightError(RuntimeError):
    """A flight of the evaluation that did not reach its end."""


class Flight(NamedTuple):
    """reported: what `sitl fly --json` prints, from the positions that the vehicle tells over the link. true: the same
    figures from the plant's own state. samples: (n, len(COLUMNS)) of that state, 50 a second, times from the start.
    """

    case: Case
    reported: dict[str, Any]
    true: dict[str, Any]
    samples: Array

    def column(self, name: str) -> Array:
        values: Array = self.samples[:, COLUMNS.index(name)]
        return values


class _Recorded(Vehicle):
    """A vehicle that keeps a sample of its truth after each call of `advance`."""

    def __init__(self, *args: Any, **options: Any) -> None:
        self.samples: list[list[float]] = []
        super().__init__(*args, **options)

    def advance(self, until_us: int, trace: Array | None = None) -> None:
        super().advance(until_us, trace)
        s, a = self.snapshot().truth, self.spec.airframe.airframe
        angles = quaternion_to_yxz(s.qw, s.qx, s.qy, s.qz)
        acting = self.loads()
        self.samples.append([
            self.now_us * 1e-6, s.north_m, s.east_m, s.down_m, *map(math.degrees, angles),
            thrust(a, s.rotor_left_rad_s), thrust(a, s.rotor_right_rad_s),
            math.degrees(s.flap_left_rad), math.degrees(s.flap_right_rad),
            *(component for cause in CAUSES for component in acting[cause].force_B),
        ])  # fmt: skip


def mission(name: str) -> Streamed:
    plan = plans.load(HERE / "missions" / f"{name}.yaml")
    assert isinstance(plan, Streamed)
    return plan


def fly(case: Case) -> Flight:
    """Fly one case from standing to standing. Raises FlightError where it fails on the way."""
    spec, believed = with_airframe(load_vehicle(case.vehicle), dict(case.plant), dict(case.believed))
    vehicle = _Recorded(
        spec,
        seed=case.seed,
        wind_N=case.wind_N,
        gust_m_s=case.gust_m_s,
        overrides=dict(case.overrides),
        believed_airframe=believed,
    )
    plan = mission(case.mission)
    flown = lockstep.fly(plan, vehicle)
    flight = flown.flight
    fault = flight.client.fault
    if fault is not None or flight.measured_s is None or flight.t0_s is None:
        raise FlightError(f"{case.command}: {fault or 'not flown to its end'}")
    samples = np.array(vehicle.samples)
    samples[:, 0] -= flight.t0_s
    samples = samples[(samples[:, 0] > -1e-6) & (samples[:, 0] < flight.measured_s + 1e-6)]
    wanted = np.array([plan.reference.at(float(t)).position_m for t in samples[:, 0]])
    samples = np.hstack((samples, wanted))
    key_points = [(t, plan.reference.at(t).position_m) for t in plan.key_times_s]
    found = (flight.metrics(), metrics.evaluate(_track(samples), flight.measured_s, key_points))
    reported, true = (metrics.report(plan.name, spec.name, flight.measured_s, m, flown.factor) for m in found)
    return Flight(case, reported, true, samples)


def _track(samples: Array) -> metrics.Track:
    def columns(*names: str) -> Array:
        return samples[:, [COLUMNS.index(name) for name in names]]

    left, right = columns("thrust_left_N"), columns("thrust_right_N")
    return metrics.Track(
        t_s=columns("t_s")[:, 0],
        reference_m=columns("ref_north_m", "ref_east_m", "ref_down_m"),
        position_m=columns("north_m", "east_m", "down_m"),
        angles=columns("t_s", "roll_deg", "pitch_deg", "yaw_deg"),
        thrust=np.hstack((columns("t_s"), left + right)),
        flaps=columns("t_s", "flap_left_deg", "flap_right_deg"),
    )
