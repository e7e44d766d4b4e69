"""The mission executor: flies the stored items one after the other."""

import math
from collections.abc import Callable
from enum import Enum

from sitl.geodesy import GeoPoint
from sitl.onboard.calm import FOREVER, Wait
from sitl.onboard.circles import Circle
from sitl.onboard.events import EventLog
from sitl.onboard.gaze import Gaze, Look
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.landing import Landing
from sitl.onboard.mission import Mission, MissionState
from sitl.onboard.mission_items import INSTANT, LANDINGS, LEAST_HEIGHT_M, TAKEOFFS, ItemCommand, has_place, roi_point
from sitl.onboard.modes import EventKind, Outcome, Severity
from sitl.onboard.parameters import Parameters
from sitl.onboard.places import Places
from sitl.onboard.plan import MissionItem
from sitl.quaternion import Vec3

_JUMPS_A_TICK = 100  # a plan of jumps alone must not hang the vehicle
_SHARP_RAD = math.radians(60.0)
_LEAST_CLIMB_M = 0.5  # of a take-off item, wherever it starts from
_LOOK_AHEAD = 20  # items looked through for the next place

_WITH_HEADING = (ItemCommand.WAYPOINT, ItemCommand.LOITER_UNLIMITED, *TAKEOFFS, *LANDINGS)
_HOLDING = (ItemCommand.WAYPOINT, ItemCommand.SPLINE_WAYPOINT, ItemCommand.LOITER_TIME)
_DELAYS = (ItemCommand.DELAY, ItemCommand.CONDITION_DELAY)


class Progress(Enum):
    FLYING = "flying"
    COMPLETE = "complete"
    RETURN = "return"  # the item hands over to Return mode


class Executor:
    """Flies `mission` with `guide`; `tick` says how it stands. Survives being left and resumed at the current item.

    A plan that is replaced while it is flown goes on with the new one's first item; one that is cleared is complete.
    """

    def __init__(
        self,
        mission: Mission,
        parameters: Parameters,
        events: EventLog,
        guide: Guide,
        places: Places,
        gaze: Gaze,
        set_home: Callable[[GeoPoint | None], Outcome],
    ) -> None:
        self._mission, self._p, self._events, self._guide = mission, parameters, events, guide
        self._places, self._gaze, self._set_home = places, gaze, set_home
        self._landing = Landing(parameters, guide)
        self._begun = False  # the current item has been started
        self._complete = False
        self._revision = -1
        self._wait_until_s: float | None = None  # end of a hold or delay; inf: for ever; None: not waiting
        self._point: Vec3 = (0.0, 0.0, 0.0)
        self._circle = Circle((0.0, 0.0, 0.0), 1.0)
        self._rising = False  # straight up from the ground before the item proper
        self._orbiting = False
        self._jumps: dict[int, int] = {}  # by index of the jump: how many are left
        self.landing = False

    def start(self, fix: Fix) -> None:
        """Begin or resume at the mission's current item."""
        if self._mission.state is MissionState.COMPLETE:
            self._mission.set_current(0)
        self._take_up()

    def _take_up(self) -> None:
        """The present plan at its current item; repeated jumps count on only where a flight goes on."""
        mission = self._mission
        if mission.state not in (MissionState.ACTIVE, MissionState.PAUSED):
            self._jumps.clear()
        mission.state = MissionState.ACTIVE if mission.items else MissionState.NO_MISSION
        self._revision = mission.revision
        self._begun = self._complete = self.landing = False

    def leave(self) -> None:
        """The mode was left: the mission pauses where it is."""
        if self._mission.state is MissionState.ACTIVE:
            self._mission.state = MissionState.PAUSED
        self._guide.speed_m_s = None
        self.landing = False

    def tick(self, fix: Fix) -> Progress:
        """One step."""
        mission = self._mission
        if self._revision != mission.revision:  # the plan changed, or somebody jumped
            self._take_up()
        if self._complete:
            return Progress.COMPLETE
        for _ in range(_JUMPS_A_TICK):
            if mission.current >= len(mission.items):
                return self._completed()
            item = mission.items[mission.current]
            if not self._begun:
                self._begun = True
                self._wait_until_s = None
                self._orbiting = self.landing = self._rising = False
                self._events.add(EventKind.ITEM_CURRENT, Severity.INFO, "", mission.current)
                if item.command == ItemCommand.RETURN_TO_LAUNCH:
                    self._reached(mission.current)
                    mission.state = MissionState.COMPLETE
                    return Progress.RETURN
                jump = self._begin(item, fix)
                if jump is not None:
                    self._next(jump)
                    continue
            if not self._finished(item, fix):
                return Progress.FLYING
            self._next(mission.current + 1)
        self._events.tell(Severity.ERROR, "mission ended: it jumps in circles")
        return self._completed()

    def _completed(self) -> Progress:
        mission = self._mission
        self._complete = True
        mission.state = MissionState.COMPLETE if mission.items else MissionState.NO_MISSION
        mission.current = max(0, min(mission.current, len(mission.items) - 1))
        return Progress.COMPLETE

    def _next(self, index: int) -> None:
        self._mission.current = index
        self._begun = False

    def _reached(self, index: int) -> None:
        self._events.add(EventKind.ITEM_REACHED, Severity.INFO, "", index)

    # beginning an item

    def _begin(self, item: MissionItem, fix: Fix) -> int | None:
        """Start an item; an item that is done at once returns the index to go on with."""
        guide, here, command = self._guide, fix.position_N, item.command
        if command in TAKEOFFS:
            # straight up first; where the item names another place, the next waypoint goes there
            least = here[2] - _LEAST_CLIMB_M if guide.standing else here[2]
            self._point = (here[0], here[1], min(self._places.of(item, here)[2], least))
            guide.go(fix, self._point, self._heading(item))
        elif command in LANDINGS:
            place = self._places.of(item, here)
            self._point = (place[0], place[1], here[2])
            if guide.standing:  # it has landed, wherever that is
                self._start_landing(fix)
            else:
                guide.go(fix, self._point, self._heading(item))
        elif command == ItemCommand.LOITER_TURNS:
            radius = abs(item.param3) if math.isfinite(item.param3) and item.param3 != 0.0 else 2.0
            self._circle = Circle(self._flyable(item, here), radius)
            self._go_to(fix, self._circle.entry(here))
        elif has_place(item):
            self._go_to(fix, self._flyable(item, here), item)
        elif command in _DELAYS:
            guide.stop(fix)
            self._wait_until_s = fix.t_s + max(0.0, item.param1)
        elif command == ItemCommand.CONDITION_YAW:
            if not guide.standing:
                self._turn(fix, item)
        elif command == ItemCommand.CONDITION_DISTANCE and self._following() is not None:
            following = self._following()
            assert following is not None
            self._go_to(fix, self._flyable(following, here), following)
        else:
            return self._do(item, fix)
        return None

    def _turn(self, fix: Fix, item: MissionItem) -> None:
        """CONDITION_YAW: param2 the rate, 0: the usual; param3 the way; param4 1: from the heading now."""
        turn, way = math.radians(item.param1), int(math.copysign(1.0, item.param3)) if item.param3 else 0
        if item.param4 == 1.0:
            turn = self._guide.reference(fix).heading_rad + (-turn if way < 0 else turn)
        rate = math.radians(item.param2) if item.param2 > 0.0 else None
        self._guide.turn(fix, turn, way, rate)

    def _flyable(self, item: MissionItem, here: Vec3) -> Vec3:
        """The item's point, but never in the ground."""
        place = self._places.of(item, here)
        return (place[0], place[1], min(place[2], -LEAST_HEIGHT_M))

    def _go_to(self, fix: Fix, point_N: Vec3, item: MissionItem | None = None) -> None:
        """Off to a point; from the ground straight up to its height first."""
        self._point = point_N
        self._rising = self._guide.standing
        if self._rising:
            self._guide.rise(fix, min(point_N[2], fix.nav.down_m - LEAST_HEIGHT_M))
        elif item is None:
            self._guide.go(fix, point_N)
        else:
            self._guide.go(fix, point_N, self._heading(item), arrival_N=self._arrival(item, fix))

    def _do(self, item: MissionItem, fix: Fix) -> int:
        """An item that takes no time; returns the index to go on with."""
        index = self._mission.current
        if item.command == ItemCommand.DO_JUMP:
            left = self._jumps_left(index)
            if left != 0:
                self._jumps[index] = left - 1 if left > 0 else left
                return int(item.param1)
            self._jumps.pop(index, None)
        elif item.command == ItemCommand.DO_CHANGE_SPEED:
            if item.param2 > 0.0:
                self._guide.speed_m_s = item.param2
            elif item.param2 == -2.0:  # the default
                self._guide.speed_m_s = None
        elif item.command == ItemCommand.DO_SET_HOME:
            there = self._places.global_of(self._places.of(item, fix.position_N))
            self._set_home(None if item.param1 == 1.0 else there)
        elif roi_point(item):
            self._gaze.at(Look.POINT, self._places.of(item, fix.position_N))
        elif item.command in (ItemCommand.DO_SET_ROI_NONE, ItemCommand.DO_SET_ROI):
            self._gaze.forget()
        self._reached(index)
        return index + 1

    def _jumps_left(self, index: int) -> int:
        return self._jumps.get(index, int(self._mission.items[index].param2))

    # the end of an item

    def _finished(self, item: MissionItem, fix: Fix) -> bool:
        guide, command, index = self._guide, item.command, self._mission.current
        if self._rising:
            if guide.done(fix) and not guide.standing:
                self._rising = False
                target = self._following() if command == ItemCommand.CONDITION_DISTANCE else item
                self._go_to(fix, self._point, None if command == ItemCommand.LOITER_TURNS else target)
            return False
        if command in _DELAYS:
            return self._passed(fix.t_s >= (self._wait_until_s or 0.0), index)
        if command == ItemCommand.CONDITION_YAW:
            return self._passed(guide.standing or guide.done(fix), index)
        if command == ItemCommand.CONDITION_DISTANCE:
            return self._passed(math.dist(self._point, fix.position_N) <= max(item.param1, self._radius(item)), index)
        if command in LANDINGS:
            return self._landed(fix, index)
        if command == ItemCommand.LOITER_TURNS:
            return self._orbited(item, fix, index)
        return self._arrived(item, fix, index)

    def _arrived(self, item: MissionItem, fix: Fix, index: int) -> bool:
        """At a point, and the time to hold there is over."""
        if self._wait_until_s is not None:
            return fix.t_s >= self._wait_until_s
        done, near = self._guide.done(fix), math.dist(self._point, fix.position_N) <= self._radius(item)
        if not near:
            if done and self._passes(item):  # flew past at more than the radius: come back
                self._guide.go(fix, self._point, self._heading(item))
            return False
        if not done and not self._passes(item):
            return False
        self._reached(index)
        hold = item.param1 if item.command in _HOLDING else 0.0
        self._wait_until_s = fix.t_s + (hold if math.isfinite(hold) else 0.0)
        if item.command == ItemCommand.LOITER_UNLIMITED or item.autocontinue == 0:
            self._wait_until_s = math.inf
        return fix.t_s >= self._wait_until_s

    def _passes(self, item: MissionItem) -> bool:
        """Whether the item is done within its radius; others are flown to their point, at rest."""
        point = item.command in (ItemCommand.WAYPOINT, ItemCommand.SPLINE_WAYPOINT)
        return point and not item.param1 > 0.0 and item.autocontinue != 0 and self._following() is not None

    def _passed(self, done: bool, index: int) -> bool:
        if done:
            self._reached(index)
        return done

    def _landed(self, fix: Fix, index: int) -> bool:
        if self.landing:
            self._landing.tick(fix)
            return self._passed(self._guide.standing, index)
        if self._guide.done(fix):
            self._start_landing(fix)
        return False

    def _start_landing(self, fix: Fix) -> None:
        self.landing = True
        self._landing.start(fix)

    def _orbited(self, item: MissionItem, fix: Fix, index: int) -> bool:
        if not self._guide.done(fix):
            return False
        if not self._orbiting:
            self._orbiting = True
            clockwise = -1.0 if item.param3 < 0 else 1.0
            if item.param1 > 0.0:
                self._guide.turns(fix, self._circle, clockwise * item.param1)
                return False
        self._reached(index)
        return True

    def waits(self, fix: Fix) -> Wait | None:
        """What the current item waits for; None: `tick` is to go on looking."""
        mission, guide = self._mission, self._guide
        if self._revision != mission.revision:
            return None
        if self._complete and self.landing and guide.standing:
            return FOREVER
        if self._complete or not self._begun or (self.landing and guide.standing):
            return None
        item = mission.items[mission.current]
        if self._rising or item.command == ItemCommand.LOITER_TURNS or (item.command in LANDINGS and not self.landing):
            return Wait(guide.done_s)
        if item.command in LANDINGS:
            return self._landing.waits()
        if self._wait_until_s is not None:
            return Wait(self._wait_until_s)
        if item.command == ItemCommand.CONDITION_YAW:
            return None if guide.standing else Wait(guide.done_s)
        if item.command == ItemCommand.CONDITION_DISTANCE:
            return Wait(math.inf, self._point, max(item.param1, self._radius(item)))
        if self._passes(item):
            return Wait(guide.done_s, self._point, self._radius(item))
        return Wait(math.inf, self._point, self._radius(item)) if guide.done(fix) else Wait(guide.done_s)

    # what an item says, and what comes after it

    def _radius(self, item: MissionItem) -> float:
        own = item.param2 if item.command == ItemCommand.WAYPOINT else 0.0
        return own if math.isfinite(own) and own > 0.0 else self._p["NAV_ACC_RAD"]

    def _heading(self, item: MissionItem) -> float | None:
        turns = item.command in _WITH_HEADING and math.isfinite(item.param4)
        return math.radians(item.param4) if turns else None

    def _following(self) -> MissionItem | None:
        """The item flown after the current one, if it goes to a place in flight."""
        items, index = self._mission.items, self._mission.current + 1
        for _ in range(_LOOK_AHEAD):
            if index >= len(items):
                return None
            item = items[index]
            if item.command == ItemCommand.DO_JUMP and self._jumps_left(index) != 0:
                index = int(item.param1)
            elif item.command in INSTANT or item.command == ItemCommand.DO_JUMP:
                index += 1
            else:
                return item if has_place(item) and item.command not in (*TAKEOFFS, *LANDINGS) else None
        return None

    def _arrival(self, item: MissionItem, fix: Fix) -> Vec3:
        """Velocity at a waypoint that is flown through.

        Along the mean of both legs, less the sharper the corner; on a spline along the line from the point before to
        the point after (Catmull-Rom), however sharp that is.
        """
        here, following = fix.position_N, self._following()
        if not self._passes(item) or following is None or following.command == ItemCommand.LOITER_TURNS:
            return (0.0, 0.0, 0.0)
        after = self._flyable(following, self._point)
        one = tuple(b - a for a, b in zip(here, self._point, strict=True))
        two = tuple(b - a for a, b in zip(self._point, after, strict=True))
        length_1, length_2 = math.hypot(*one), math.hypot(*two)
        if min(length_1, length_2) < 1.0:
            return (0.0, 0.0, 0.0)
        cos = max(-1.0, min(1.0, sum(a * b for a, b in zip(one, two, strict=True)) / (length_1 * length_2)))
        if item.command == ItemCommand.SPLINE_WAYPOINT:
            along, share = tuple(a + b for a, b in zip(one, two, strict=True)), math.sqrt(0.5 * (1.0 + cos))
        elif math.acos(cos) < _SHARP_RAD:
            along = tuple(a / length_1 + b / length_2 for a, b in zip(one, two, strict=True))
            share = math.cos(0.5 * math.pi * math.acos(cos) / _SHARP_RAD)
        else:
            return (0.0, 0.0, 0.0)
        length = math.hypot(*along)
        if length < 1e-6:
            return (0.0, 0.0, 0.0)
        m = self._guide.limits()
        n, e, d = (x / length for x in along)
        speed = math.sqrt(0.5 * min(m.acceleration_m_s2, m.climb_m_s2, m.descent_m_s2) * min(length_1, length_2))
        speed = min(speed, m.speed_m_s, (m.climb_m_s if d < 0.0 else m.descent_m_s) / max(abs(d), 1e-6))
        k = speed * share
        return (k * n, k * e, k * d)
