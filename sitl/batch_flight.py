"""The client of `sitl fly` without its link: what it asks of the vehicle and when, and what it measures."""

import math
from collections.abc import Callable
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools import lockstep
from gcs_tools.client import AGAIN_S
from gcs_tools.fence import CIRCLE, RALLY_POINT
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
from gcs_tools.plan import FRAME_LOCAL_NED, FRAME_MISSION, Item, Plan, Streamed, Uploaded
from gcs_tools.reference import ZERO, TimedPoint, Waypoints
from gcs_tools.upload import as_carried
from sitl import tally
from sitl.closed_loop import TRACE_COLUMNS
from sitl.mavlink.wire import float32
from sitl.onboard.mission import MissionState
from sitl.onboard.modes import ACCEPTED, EventKind, Mode, Outcome, Severity, Verdict
from sitl.onboard.offboard import Foreseen, OffboardTarget
from sitl.onboard.plan import MissionItem
from sitl.quaternion import Vec3
from sitl.tally import Array, Figures
from sitl.vehicle import Vehicle, load_vehicle

TRACED_US = 5_000_000  # as long as the trace is kept in one piece


class NotFlownError(RuntimeError):
    """Why a flight was not flown to its end."""


@cache
def _first_ask_us(uploaded: bool, fence: int | None = None, rally: int | None = None) -> int:
    """Until then it listens and hands its plans over, equally long in every flight: this flies the beginning of one.

    fence, rally: how many items the plan has of either, None where it says nothing of them.
    """
    plan: Plan
    if uploaded:
        delay = Item(FRAME_MISSION, 93, 1.0, -1.0, -1.0, 0.0, 0, 0, 0.0)
        plan, asked = Uploaded("", "", (delay,), 600.0, None), EventKind.ARMED
    else:
        standing = Waypoints([TimedPoint(0.0, ZERO), TimedPoint(60.0, ZERO)])
        plan, asked = Streamed("", "", standing, 60.0, (), 0.0, None), EventKind.MODE
    around = Item(FRAME_LOCAL_NED, CIRCLE[True], 1e3, 0.0, 0.0, 0.0, 0, 0, 0.0)
    plan = plan._replace(
        fence=None if fence is None else (around,) * fence,
        rally=None if rally is None else (around._replace(command=RALLY_POINT, param1=0.0),) * rally,
    )
    vehicle = Vehicle(load_vehicle("yawsitter"))
    turns = (fence or 0) + (rally or 0)
    lockstep.fly(plan, vehicle, limit_s=WARM_UP_S + 1.0 + turns * TURN_US * 1e-6)
    return next(event.now_us for event in vehicle.events.since(0) if event.kind is asked)


class BatchFlight:
    """The client of `sitl fly` without a link, turn by turn, and what it measures.

    What the client asks for it asks at the begin of a turn and is answered within it; what the vehicle comes to in a
    turn it hears in the next, and acts upon then. Turns in which there is nothing to hear are run many at once.
    """

    def __init__(self, vehicle: Vehicle, traced: bool) -> None:
        self.vehicle, self._commander, self._traced = vehicle, vehicle.commander, traced
        self._plan: Streamed | None = None  # of whose targets one is sent at every turn
        self.start_s = self._duration_s = math.nan  # NaN: not begun, not flown to its end
        self._traces: list[Array] = []

    @property
    def _now_s(self) -> float:
        return self.vehicle.now_us * 1e-6

    @property
    def _t_s(self) -> float:
        """Time of the flight, as the client hears it."""
        return self.vehicle.now_us // 1000 * 1e-3 - self.start_s

    # what is flown

    def streamed(self, plan: Streamed) -> None:
        commander = self._commander
        self._go_on(_first_ask_us(False) - round(WARM_UP_S * 1e6) - TURN_US)
        start, stands = plan.reference.at(0.0).position_m, self.vehicle.snapshot().nav[:3]
        if math.dist(start, stands) > START_WITHIN_M:
            raise NotFlownError(f"the vehicle stands {math.dist(start, stands):.2f} m from where this flight starts")
        asks_us = _first_ask_us(False, *_counts(plan))
        self._go_on(asks_us - round(WARM_UP_S * 1e6) - TURN_US)
        self._hand_over(plan)
        self._go_on(asks_us - TURN_US)
        self._plan = plan
        self._turn()
        self._ask("mode offboard", lambda: commander.set_mode(Mode.OFFBOARD), 3.0)
        self._ask("arming", commander.arm, ARMING_PATIENCE_S, lead_s=LEAD_S)
        self._fly(plan)
        self._duration_s = plan.duration_s
        self._turn()
        if plan.reference.at(plan.duration_s).position_m[2] > -GROUND_M:
            self._ask("disarming", commander.disarm, ARMING_PATIENCE_S)
        else:
            self._land()

    def _fly(self, plan: Streamed) -> None:
        """Along the targets, which are known to the vehicle beforehand where no fence might refuse some of them."""
        vehicle, commander = self.vehicle, self._commander
        start_us = round(self.start_s * 1e6)
        over_us = start_us + math.ceil(plan.duration_s * 1e6 / TURN_US - 1e-6) * TURN_US
        course = _course(plan, self.start_s, vehicle.now_us, over_us + TURN_US)
        vehicle.wanted = course.wanted
        tally.end(vehicle.tally, start_us + plan.duration_s * 1e6 + 1.0)
        foreseen = not (commander.geofence.active and commander.geofence.present)
        if foreseen:
            vehicle.offboard.foreseen = course.foreseen()
        while self._t_s < plan.duration_s:
            if self._t_s >= 0.0 and not (commander.armed and commander.mode is Mode.OFFBOARD):
                raise NotFlownError(self._left("offboard"))
            if foreseen:
                until_us = over_us if self._t_s >= 0.0 else start_us
                self._go_on(max(until_us, vehicle.now_us + TURN_US), news=True)
            else:
                self._turn()
        if foreseen:
            last_us = vehicle.now_us - TURN_US
            vehicle.offboard.foreseen = None
            vehicle.offboard.submit(_target(plan, last_us, self.start_s), last_us)

    def uploaded(self, plan: Uploaded) -> None:
        vehicle, commander = self.vehicle, self._commander
        self._go_on(_first_ask_us(True, *_counts(plan)) + (len(plan.items) - 2) * TURN_US)
        self._hand_over(plan)
        self._turn()
        self._ask("arming", commander.arm, ARMING_PATIENCE_S, lead_s=0.0)
        self._ask("starting the mission", commander.start_mission, 2.0)
        self._follow(plan)
        self._duration_s = max(self._t_s, STREAM_S)
        tally.end(vehicle.tally, vehicle.now_us)
        self._turn()
        if commander.armed:
            self._land()

    def _hand_over(self, plan: Plan) -> None:
        """The vehicle, which has none yet, takes the plans of the file."""
        plans, mission = self.vehicle.plans, plan.items if isinstance(plan, Uploaded) else ()
        of_kinds = (1, plans.fence, plan.fence), (2, plans.rally, plan.rally), (0, plans.mission, mission)
        for kind, stored, items in of_kinds:
            if items:
                refused = stored.replace([_stored(item, kind, first=k == 0) for k, item in enumerate(items)])
                if refused is not None:
                    reason = f"item {refused.index}: {refused.reason}"
                    raise NotFlownError(f"the vehicle refuses the {stored.name}: {reason}")

    def _follow(self, plan: Uploaded) -> None:
        """Until the vehicle has disarmed, or the mission has long been complete."""
        commander, mission = self._commander, self.vehicle.mission
        complete_s = elsewhere_s = math.inf
        while commander.armed:
            t = self._t_s
            if t > plan.limit_s:
                raise NotFlownError(f"the mission isn't done after {plan.limit_s:g} s, at item {mission.current}")
            if mission.state is MissionState.COMPLETE:
                complete_s = min(complete_s, t)
                if t - complete_s > SETTLE_S and commander.mode not in (Mode.RETURN, Mode.LAND):
                    return
            elif commander.mode not in (Mode.MISSION, Mode.RETURN, Mode.LAND):
                elsewhere_s = min(elsewhere_s, t)
                if t - elsewhere_s > ELSEWHERE_S:
                    raise NotFlownError(self._left("mission"))
            limits_s = plan.limit_s, complete_s + SETTLE_S, elsewhere_s + ELSEWHERE_S
            wait_s = min((limit_s - t for limit_s in limits_s if limit_s > t - STREAM_S), default=0.0)
            self._go_on(self.vehicle.now_us + max(1, round(wait_s / STREAM_S)) * TURN_US, news=True)
        if mission.state is not MissionState.COMPLETE:
            raise NotFlownError(self._left("mission"))

    def _land(self) -> None:
        self._ask("landing", self._commander.land, 0.0)
        self._plan, began_s = None, self._t_s
        while self._commander.armed:
            if self._t_s - began_s > LANDING_S:
                raise NotFlownError("the vehicle landed no sooner than it was given up on")
            self._go_on(self.vehicle.now_us + round(LANDING_S * 1e6), news=True)

    # its turns

    def _turn(self, request: Callable[[], Outcome] = lambda: ACCEPTED, lead_s: float | None = None) -> Outcome:
        """20 ms. The request comes behind the target of its turn; lead_s: as of `_ask`."""
        vehicle = self.vehicle
        if self._plan is not None:
            vehicle.offboard.submit(_target(self._plan, vehicle.now_us, self.start_s), vehicle.now_us)
        answer = request()
        if answer.ok and lead_s is not None:
            heard_s = (vehicle.now_us + TURN_US) * 1e-6
            self.start_s = math.ceil((heard_s + lead_s) / STREAM_S - 1e-6) * STREAM_S
            vehicle.tally = tally.tally(round(self.start_s * 1e6))
        self._go_on(vehicle.now_us + TURN_US)
        return answer

    def _go_on(self, until_us: int, news: bool = False) -> None:
        """So far, or with `news` to the end of the first turn in which something is told."""
        vehicle = self.vehicle
        run = vehicle.advance_to_news if news else vehicle.advance
        traced = self._traced and math.isnan(self._duration_s) and self._now_s - self.start_s > -1e-6
        if not traced:
            run(until_us)
            return
        told = vehicle.events.next_number
        while vehicle.now_us < until_us and (not news or vehicle.events.next_number == told):
            since_us = vehicle.now_us
            next_us = min(until_us, since_us + TRACED_US)
            trace = np.zeros(((next_us - since_us) // vehicle.step_us, len(TRACE_COLUMNS)))
            run(next_us, trace)
            self._traces.append(trace[: (vehicle.now_us - since_us) // vehicle.step_us])

    def _ask(self, what: str, request: Callable[[], Outcome], patience_s: float, lead_s: float | None = None) -> None:
        """Have something accepted, again and again for as long as patience lasts.

        lead_s: the flight starts so long after the client hears of it.
        """
        asked_s = self._now_s
        while not (answer := self._turn(request, lead_s)).ok:
            if self._now_s - asked_s >= patience_s:
                refused = "refused for now" if answer.verdict is Verdict.TEMPORARILY_REJECTED else "refused"
                raise NotFlownError(f"{what}: {refused} by the vehicle{self._told_since(asked_s)}")
            again_s = self._now_s + AGAIN_S
            while self._now_s < again_s:
                self._turn()

    def _left(self, mode: str) -> str:
        """Why the flight was given up."""
        commander = self._commander
        became = f"left {mode} mode for {commander.mode.value}" if commander.armed else "disarmed"
        return f"the vehicle {became} at t = {self._t_s:.1f} s{self._told_since(self._now_s - 3.0)}"

    def _told_since(self, since_s: float) -> str:
        """What the vehicle has complained of, to put behind a fault."""
        texts = [
            event.text
            for event in self.vehicle.events.since(0)
            if event.kind is EventKind.TEXT and event.severity <= Severity.WARNING and event.now_us * 1e-6 >= since_s
        ]
        return f": {'; '.join(dict.fromkeys(texts))}" if texts else ""

    def figures(self) -> Figures:
        return tally.figures(self.vehicle.tally, self._duration_s)

    def trace(self) -> Array | None:
        """Every control step of the measured flight."""
        return np.concatenate(self._traces) if self._traces else None


class _Course(NamedTuple):
    """A streamed plan's targets, one a turn, as the vehicle gets them, and the places that it is measured by."""

    stamps_us: NDArray[np.int64]
    targets: Array  # (n, 9) position, velocity, acceleration
    heading_rad: float
    wanted: Array

    def foreseen(self) -> Foreseen:
        t = self.targets
        return Foreseen(self.stamps_us, t[:, 0:3], t[:, 3:6], t[:, 6:9], self.heading_rad)


@lru_cache(maxsize=8)
def _course(plan: Streamed, start_s: float, first_us: int, last_us: int) -> _Course:
    """The targets of all turns from `first_us` to `last_us`."""
    stamps_us = np.arange(first_us, last_us + 1, TURN_US)
    targets = [np.ravel(plan.reference.at(now_us // 1000 * 1e-3 - start_s)) for now_us in stamps_us.tolist()]
    singles = np.array(targets, dtype=np.float32).astype(np.float64)
    wanted = np.array(targets)[stamps_us >= round(start_s * 1e6), :3]
    heading = math.nan if plan.heading_rad is None else float32(plan.heading_rad)
    return _Course(stamps_us, singles, heading, wanted)


def _singles(v: Vec3) -> Vec3:
    return float32(v[0]), float32(v[1]), float32(v[2])


def _target(plan: Streamed, now_us: int, start_s: float) -> OffboardTarget:
    """The target for this instant; before the start is known it is that of standing."""
    t = -1.0 if math.isnan(start_s) else now_us // 1000 * 1e-3 - start_s
    position, velocity, acceleration = map(_singles, plan.reference.at(t))
    heading = math.nan if plan.heading_rad is None else float32(plan.heading_rad)
    return OffboardTarget(now_us, position, velocity, acceleration, heading)


def _counts(plan: Plan) -> tuple[int | None, int | None]:
    """How many items of a fence and how many rally points there are to hand over; None: it says nothing of them."""
    return None if plan.fence is None else len(plan.fence), None if plan.rally is None else len(plan.rally)


def _stored(item: Item, kind: int, first: bool) -> MissionItem:
    """The item of a plan of that MAV_MISSION_TYPE as the vehicle stores it when it comes over the link."""
    frame, command, p1, p2, p3, p4, x, y, z, more = as_carried(item)
    return MissionItem(frame, command, int(first and kind == 0), more, p1, p2, p3, p4, x, y, z, kind)
