"""Flights by the thousand: one mission flown in process, without a link, and what it came to.

`fly` flies the very flight of `sitl fly` with the same mission, vehicle and settings: the same commands at the same
simulation times, the same targets rounded as the wire rounds them, so that the plant goes through the same states to
the last bit. Only the link is left out. A flight that `fly` counts as failed is one that `sitl fly` gives up.
"""

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools import lockstep
from gcs_tools.client import AGAIN_S, LinkError
from gcs_tools.flight import (
    ARMING_PATIENCE_S,
    ELSEWHERE_S,
    GROUND_M,
    LANDING_S,
    LEAD_S,
    SETTLE_S,
    START_WITHIN_M,
    STREAM_S,
    WARM_UP_S,
)
from gcs_tools.lockstep import TURN_US
from gcs_tools.metrics import Track, evaluate
from gcs_tools.plan import FRAME_MISSION, Item, Plan, Streamed, Uploaded
from gcs_tools.reference import ZERO, TimedPoint, Waypoints
from sitl.closed_loop import TRACE_COLUMNS
from sitl.onboard.mission import MissionState
from sitl.onboard.modes import ACCEPTED, EventKind, Landed, Mode, Severity, Verdict
from sitl.onboard.modes import Outcome as Answer
from sitl.onboard.offboard import OffboardTarget
from sitl.onboard.plan import MissionItem
from sitl.quaternion import Vec3
from sitl.strict_yaml import ConfigError
from sitl.vehicle import TICK_US, Vehicle, load_vehicle
from sitl.vehicle_spec import VehicleSpec

Array = NDArray[np.float64]
HIGH_M = 0.5  # a reference higher than this means to be in the air
_NAN: Vec3 = (math.nan, math.nan, math.nan)
_NONE = np.zeros((0, 4))


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
    flight = _Flight(vehicle, traced)
    try:
        flight.streamed(plan) if isinstance(plan, Streamed) else flight.uploaded(plan)
    except LinkError as error:
        flight.fault = str(error)
    return flight.outcome()


@cache
def _first_ask_us(uploaded: bool) -> int:
    """Until then it only listens, and listens equally long in every flight: this flies the beginning of one."""
    plan: Plan
    if uploaded:
        delay = Item(FRAME_MISSION, 93, 1.0, -1.0, -1.0, 0.0, 0, 0, 0.0)
        plan, asked = Uploaded("", "", (delay,), 600.0, None), EventKind.ARMED
    else:
        standing = Waypoints([TimedPoint(0.0, ZERO), TimedPoint(60.0, ZERO)])
        plan, asked = Streamed("", "", standing, 60.0, (), 0.0, None), EventKind.MODE
    vehicle = Vehicle(load_vehicle("yawsitter"))
    lockstep.fly(plan, vehicle, limit_s=WARM_UP_S + 1.0)
    return next(event.now_us for event in vehicle.events.since(0) if event.kind is asked)


class _Flight:
    """The client of `sitl fly` without a link, turn by turn, and what it measures.

    What the client asks for it asks at the begin of a turn and is answered within it; what the vehicle comes to in a
    turn it hears in the next, and acts upon then.
    """

    def __init__(self, vehicle: Vehicle, traced: bool) -> None:
        self._vehicle, self._commander, self._traced = vehicle, vehicle.commander, traced
        self._target: Callable[[int], OffboardTarget] | None = None  # streamed at every turn
        self._reference: Callable[[float], Vec3] | None = None  # None: the vehicle's own
        self._start_s = math.nan
        self._duration_s = math.nan  # NaN: not flown to its end
        self._samples: list[tuple[float, ...]] = []
        self._traces: list[Array] = []
        self.fault = ""

    @property
    def _now_s(self) -> float:
        return self._vehicle.now_us * 1e-6

    @property
    def _t_s(self) -> float:
        """Time of the flight, as the client hears it."""
        return self._vehicle.now_us // 1000 * 1e-3 - self._start_s

    # what is flown

    def streamed(self, plan: Streamed) -> None:
        commander = self._commander
        self._until(_first_ask_us(False) - round(WARM_UP_S * 1e6) - TURN_US)
        start, stands = plan.reference.at(0.0).position_m, self._vehicle.snapshot().nav[:3]
        if math.dist(start, stands) > START_WITHIN_M:
            raise LinkError(f"the vehicle stands {math.dist(start, stands):.2f} m from where this flight starts")
        self._until(_first_ask_us(False) - TURN_US)
        self._target = lambda now_us: _target(plan, now_us, self._start_s)
        self._turn()
        self._ask("mode offboard", lambda: commander.set_mode(Mode.OFFBOARD), 3.0)
        self._ask("arming", commander.arm, ARMING_PATIENCE_S)
        self._reference = lambda t_s: plan.reference.at(t_s).position_m
        self._begin(LEAD_S)
        while self._t_s < plan.duration_s:
            if self._t_s >= 0.0 and not (commander.armed and commander.mode is Mode.OFFBOARD):
                raise LinkError(self._left("offboard"))
            self._turn()
        self._duration_s = plan.duration_s
        self._turn()
        if plan.reference.at(plan.duration_s).position_m[2] > -GROUND_M:
            self._ask("disarming", commander.disarm, ARMING_PATIENCE_S)
        else:
            self._land()

    def uploaded(self, plan: Uploaded) -> None:
        vehicle, commander = self._vehicle, self._commander
        self._until(_first_ask_us(True) + (len(plan.items) - 2) * TURN_US)
        refused = vehicle.mission.replace([_stored(item, first=k == 0) for k, item in enumerate(plan.items)])
        if refused is not None:
            raise LinkError(f"the vehicle refuses the mission: item {refused.index}: {refused.reason}")
        self._turn()
        self._ask("arming", commander.arm, ARMING_PATIENCE_S)
        self._begin(0.0)
        self._ask("starting the mission", commander.start_mission, 2.0)
        self._follow(plan)
        self._duration_s = max(self._t_s, STREAM_S)
        self._turn()
        if commander.armed:
            self._land()

    def _follow(self, plan: Uploaded) -> None:
        """Until the vehicle has disarmed, or the mission has long been complete."""
        commander, mission = self._commander, self._vehicle.mission
        complete_s = elsewhere_s = math.inf
        while commander.armed:
            t = self._t_s
            if t > plan.limit_s:
                raise LinkError(f"the mission isn't done after {plan.limit_s:g} s, at item {mission.current}")
            if mission.state is MissionState.COMPLETE:
                complete_s = min(complete_s, t)
                if t - complete_s > SETTLE_S and commander.mode not in (Mode.RETURN, Mode.LAND):
                    return
            elif commander.mode not in (Mode.MISSION, Mode.RETURN, Mode.LAND):
                elsewhere_s = min(elsewhere_s, t)
                if t - elsewhere_s > ELSEWHERE_S:
                    raise LinkError(self._left("mission"))
            self._turn()
        if mission.state is not MissionState.COMPLETE:
            raise LinkError(self._left("mission"))

    def _land(self) -> None:
        self._ask("landing", self._commander.land, 0.0)
        self._target, began_s = None, self._t_s
        while self._commander.armed:
            if self._t_s - began_s > LANDING_S:
                raise LinkError("the vehicle landed no sooner than it was given up on")
            self._turn()

    # its turns

    def _turn(self, request: Callable[[], Answer] = lambda: ACCEPTED) -> Answer:
        """20 ms. The request comes behind the target of its turn."""
        vehicle = self._vehicle
        if self._target is not None:
            vehicle.offboard.submit(self._target(vehicle.now_us), vehicle.now_us)
        answer = request()
        trace = None
        if self._traced and self._flying:
            trace = np.zeros((TURN_US // vehicle.step_us, len(TRACE_COLUMNS)))
            self._traces.append(trace)
        vehicle.advance(vehicle.now_us + TURN_US, trace)
        self._sample()
        return answer

    def _until(self, now_us: int) -> None:
        while self._vehicle.now_us < now_us:
            self._turn()

    def _ask(self, what: str, request: Callable[[], Answer], patience_s: float) -> None:
        """Have something accepted, again and again for as long as patience lasts."""
        asked_s = self._now_s
        while not (answer := self._turn(request)).ok:
            if self._now_s - asked_s >= patience_s:
                refused = "refused for now" if answer.verdict is Verdict.TEMPORARILY_REJECTED else "refused"
                raise LinkError(f"{what}: {refused} by the vehicle{self._told_since(asked_s)}")
            again_s = self._now_s + AGAIN_S
            while self._now_s < again_s:
                self._turn()

    def _begin(self, lead_s: float) -> None:
        self._start_s = math.ceil((self._now_s + lead_s) / STREAM_S - 1e-6) * STREAM_S
        self._sample()

    def _left(self, mode: str) -> str:
        """Why the flight was given up."""
        commander = self._commander
        became = f"left {mode} mode for {commander.mode.value}" if commander.armed else "disarmed"
        return f"the vehicle {became} at t = {self._t_s:.1f} s{self._told_since(self._now_s - 3.0)}"

    def _told_since(self, since_s: float) -> str:
        """What the vehicle has complained of, to put behind a fault."""
        texts = [
            event.text
            for event in self._vehicle.events.since(0)
            if event.kind is EventKind.TEXT and event.severity <= Severity.WARNING and event.now_us * 1e-6 >= since_s
        ]
        return f": {'; '.join(dict.fromkeys(texts))}" if texts else ""

    # what is measured

    @property
    def _flying(self) -> bool:
        """Within the measured flight."""
        return self._now_s - self._start_s > -1e-6 and math.isnan(self._duration_s)

    def _sample(self) -> None:
        if not self._flying:
            return
        seen, t = self._vehicle.snapshot(), self._now_s - self._start_s
        s = seen.truth
        reference = seen.reference[:3] if self._reference is None else self._reference(t)
        nose_up = 2.0 * (s.qw * s.qy - s.qx * s.qz)
        self._samples.append((t, s.north_m, s.east_m, s.down_m, *reference, nose_up))

    def outcome(self) -> Outcome:
        vehicle, seen = self._vehicle, self._vehicle.snapshot()
        samples = np.array(self._samples).reshape(-1, 8)
        t, high = samples[:, 0], samples[:, 6] < -HIGH_M
        distance = np.sqrt(np.sum((samples[:, 1:4] - samples[:, 4:7]) ** 2, axis=1))
        duration_s = self._duration_s if not math.isnan(self._duration_s) else float(t[-1]) if t.size else math.nan
        measured = t.size > 3
        m = evaluate(Track(t, samples[:, 4:7], samples[:, 1:4], _NONE, _NONE, _NONE), duration_s) if measured else None
        return Outcome(
            fault=self.fault,
            duration_s=duration_s,
            start_s=self._start_s,
            end_s=vehicle.now_us * 1e-6,
            mae_m=m.mae if m else _NAN,
            rmse_m=m.rmse if m else _NAN,
            iae_m_s=m.iae if m else _NAN,
            max_error_m=m.max_overshoot if m else _NAN,
            final_error_m=m.final_error if m else _NAN,
            mean_distance_m=_mean(distance, t) if measured else math.nan,
            max_distance_m=float(distance.max()) if measured else math.nan,
            max_tilt_deg=math.degrees(math.acos(max(-1.0, min(1.0, samples[:, 7].min())))) if t.size else math.nan,
            least_height_m=float(-samples[high, 3].max()) if high.any() else math.nan,
            energy_J=vehicle.energy_J,
            landed=not seen.armed and seen.landed is Landed.ON_GROUND and not seen.tipped_over,
            tipped_over=seen.tipped_over,
            end_N=(seen.truth.north_m, seen.truth.east_m, seen.truth.down_m),
            trace=np.concatenate(self._traces) if self._traces else None,
        )


def _mean(values: Array, t: Array) -> float:
    """Over time, by the trapezoid rule."""
    return float(np.sum(0.5 * (values[1:] + values[:-1]) * np.diff(t)) / (t[-1] - t[0]))


def _single(value: float) -> float:
    """As it arrives at the other end of the wire, which carries single precision."""
    return float(np.float32(value))


def _singles(v: Vec3) -> Vec3:
    return _single(v[0]), _single(v[1]), _single(v[2])


def _target(plan: Streamed, now_us: int, start_s: float) -> OffboardTarget:
    """The target for this instant; before the start is known it is that of standing."""
    t = -1.0 if math.isnan(start_s) else now_us // 1000 * 1e-3 - start_s
    position, velocity, acceleration = map(_singles, plan.reference.at(t))
    heading = math.nan if plan.heading_rad is None else _single(plan.heading_rad)
    return OffboardTarget(now_us, position, velocity, acceleration, heading)


def _stored(item: Item, first: bool) -> MissionItem:
    """The item as the vehicle stores it when it comes over the link."""
    p1, p2, p3, p4, z = map(_single, (item.param1, item.param2, item.param3, item.param4, item.z))
    return MissionItem(item.frame, item.command, int(first), item.autocontinue, p1, p2, p3, p4, item.x, item.y, z)
