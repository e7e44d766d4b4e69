"""Flights by the thousand: one mission flown in process, without a link, and what it came to.

`fly` flies the very flight of `sitl fly` with the same mission, vehicle and settings: the same commands at the same
simulation times, the same targets rounded as the wire rounds them, so that the plant goes through the same states to
the last bit. Only the link is left out. A flight that `fly` counts as failed is one that `sitl fly` gives up.
"""

from collections.abc import Mapping
from typing import NamedTuple

from gcs_tools import lockstep
from gcs_tools.plan import Plan, Streamed
from sitl.batch_flight import BatchFlight, NotFlownError
from sitl.closed_loop import TRACE_COLUMNS
from sitl.onboard.modes import Landed
from sitl.quaternion import Vec3
from sitl.strict_yaml import ConfigError
from sitl.tally import Array
from sitl.vehicle import TICK_US, Vehicle
from sitl.vehicle_spec import VehicleSpec

__all__ = ["TRACE_COLUMNS", "Outcome", "fly"]


class Outcome(NamedTuple):
    """What a flight came to. Positions are the plant's own, north, east, down in m; times in s.

    fault: why it was not flown to its end; empty where it was. All figures are then those of the part that was flown,
        NaN where there was none.
    duration_s: of the measured flight. start_s, end_s: simulation times of its start, and of the vehicle's last stop.
    mae_m, rmse_m, iae_m_s, max_error_m, final_error_m: per axis of the position against the reference, over the
        measured flight at 50 Hz, as `metrics.evaluate` has them of the true positions.
    mean_distance_m, max_distance_m: from the reference, in space, over the same samples.
    max_tilt_deg: the largest angle of the nose from straight up while measured (9.5° is a hover).
    least_height_m: above the start, while the reference was higher than HIGH_M; NaN where it never was.
    energy_J: drawn from the battery from switching on to the last stop.
    landed: whether the vehicle stood on its feet with its motors off in the end, end_N: where it was then.
    tipped_over: whether it lay on the ground in the end.
    trace: (steps, len(TRACE_COLUMNS)) of every control step from start_s on, if asked for.
    """

    fault: str
    duration_s: float
    start_s: float
    end_s: float
    mae_m: Vec3
    rmse_m: Vec3
    iae_m_s: Vec3
    max_error_m: Vec3
    final_error_m: Vec3
    mean_distance_m: float
    max_distance_m: float
    max_tilt_deg: float
    least_height_m: float
    energy_J: float
    landed: bool
    tipped_over: bool
    end_N: Vec3
    trace: Array | None


def fly(
    plan: Plan,
    spec: VehicleSpec,
    *,
    seed: int = 1,
    wind_N: Vec3 = (0.0, 0.0, 0.0),
    gust_m_s: float = 0.0,
    parameters: Mapping[str, float] | None = None,
    plant: Mapping[str, float] | None = None,
    believed: Mapping[str, float] | None = None,
    heading_rad: float = 0.0,
    traced: bool = False,
) -> Outcome:
    """Fly a mission from standing to standing.

    The settings are those of `sitl.fly`. heading_rad: where the belly faces at the start. Raises ConfigError for
    settings that can't be used, and for missions or vehicles that this way of flying has no room for: a control period
    that 20 ms are no multiple of. What goes wrong in flight is told in the outcome.
    """
    if TICK_US % spec.step_us:
        raise ConfigError(f"vehicle {spec.name}: a batch flies control periods that divide {TICK_US // 1000} ms")
    vehicle = lockstep.build(
        plan,
        spec,
        Vehicle,
        plant=plant,
        believed=believed,
        seed=seed,
        wind_N=wind_N,
        gust_m_s=gust_m_s,
        overrides=parameters,
        heading_rad=heading_rad,
    )
    flight, fault = BatchFlight(vehicle, traced), ""
    try:
        flight.streamed(plan) if isinstance(plan, Streamed) else flight.uploaded(plan)
    except NotFlownError as error:
        fault = str(error)
    return _outcome(flight, fault)


def _outcome(flight: BatchFlight, fault: str) -> Outcome:
    vehicle, figures = flight.vehicle, flight.figures()
    seen = vehicle.snapshot()
    return Outcome(
        fault=fault,
        duration_s=figures.duration_s,
        start_s=flight.start_s,
        end_s=vehicle.now_us * 1e-6,
        mae_m=figures.mae_m,
        rmse_m=figures.rmse_m,
        iae_m_s=figures.iae_m_s,
        max_error_m=figures.max_error_m,
        final_error_m=figures.final_error_m,
        mean_distance_m=figures.mean_distance_m,
        max_distance_m=figures.max_distance_m,
        max_tilt_deg=figures.max_tilt_deg,
        least_height_m=figures.least_height_m,
        energy_J=vehicle.energy_J,
        landed=not seen.armed and seen.landed is Landed.ON_GROUND and not seen.tipped_over,
        tipped_over=seen.tipped_over,
        end_N=(seen.truth.north_m, seen.truth.east_m, seen.truth.down_m),
        trace=flight.trace(),
    )
