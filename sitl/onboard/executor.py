"""The mission executor: flies the stored items one after the other."""

import math
from collections.abc import Callable
from enum import Enum

from sitl.geodesy import GeoPoint, to_local
from sitl.onboard.events import EventLog
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.landing import Landing
from sitl.onboard.mission import Frame, ItemCommand, Mission, MissionItem, MissionState
from sitl.onboard.modes import EventKind, Severity
from sitl.onboard.parameters import Parameters
from sitl.onboard.trajectory import at
from sitl.quaternion import Vec3

_JUMPS_A_TICK = 100  # a plan of jumps alone must not hang the vehicle
_SHARP_RAD = math.radians(60.0)


class Progress(Enum):
    FLYING = "flying"
    COMPLETE = "complete"
    RETURN = "return"  # the item hands over to Return mode


class Places:
    """Home and origin, for items in global frames; the commander keeps them up to date."""

    def __init__(self, origin: GeoPoint) -> None:
        self.origin = origin
        self.home = origin
        self.home_N: Vec3 = (0.0, 0.0, 0.0)

    def of(self, item: MissionItem, here: Vec3) -> Vec3:
        """The item's point in N [m]. Latitude and longitude both 0 mean here, as ground stations send take-off."""
        if item.frame == Frame.LOCAL_NED:
            return item.x * 1e-4, item.y * 1e-4, item.z
        if item.x == 0 and item.y == 0:
            north, east = here[0], here[1]
        else:
            north, east = to_local(self.origin, item.x * 1e-7, item.y * 1e-7)
        base = self.home.alt_amsl_m if item.frame in (Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_RELATIVE_ALT_INT) else 0.0
        return north, east, self.origin.alt_amsl_m - (item.z + base)


class Executor:
    """Flies `mission` with `guide`; `tick` says how it stands. Survives being left and resumed at the current item."""

    def __init__(
        self,
        mission: Mission,
        parameters: Parameters,
        events: EventLog,
        guide: Guide,
        places: Places,
        set_home: Callable[[Vec3 | None], None],
    ) -> None:
        self._mission, self._p, self._events, self._guide = mission, parameters, events, guide
        self._places, self._set_home = places, set_home
        self._landing = Landing(parameters, guide)
        self._begun = False  # the current item has been started
        self._revision = -1
        self._wait_until_s = math.inf  # end of a hold or delay; inf: not waiting
        self._point: Vec3 = (0.0, 0.0, 0.0)
        self._orbiting = False
        self._jumps: dict[int, int] = {}
        self.landing = False

    def start(self, fix: Fix) -> None:
        """Begin or resume at the mission's current item."""
        if self._mission.state is MissionState.COMPLETE:
            self._mission.set_current(0)
        if self._mission.current == 0:
            self._jumps.clear()
        self._mission.state = MissionState.ACTIVE
        self._begun = False
        self._revision = self._mission.revision

    def leave(self) -> None:
        """The mode was left: the mission pauses where it is."""
        if self._mission.state is MissionState.ACTIVE:
            self._mission.state = MissionState.PAUSED
        self._guide.speed_m_s = None
        self.landing = False

    def tick(self, fix: Fix, standing: bool) -> Progress:
        """One step. `standing`: the vehicle is on the ground with its motors idling."""
        mission = self._mission
        if self._revision != mission.revision:  # the plan changed, or somebody jumped
            self._revision = mission.revision
            self._begun = False
            mission.state = MissionState.ACTIVE
            if not mission.items:
                self._guide.stop(fix)
        for _ in range(_JUMPS_A_TICK):
            if mission.current >= len(mission.items):
                mission.state = MissionState.COMPLETE if mission.items else MissionState.NO_MISSION
                if mission.items:
                    mission.current = len(mission.items) - 1
                return Progress.COMPLETE
            item = mission.items[mission.current]
            if not self._begun:
                self._begun = True
                self._wait_until_s = math.inf
                self._orbiting = self.landing = False
                self._events.add(EventKind.ITEM_CURRENT, Severity.INFO, "", mission.current)
                if item.command == ItemCommand.RETURN_TO_LAUNCH:
                    self._reached(mission.current)
                    mission.state = MissionState.COMPLETE
                    return Progress.RETURN
                jump = self._begin(item, fix)
                if jump is not None:
                    self._next(jump)
                    continue
            if not self._finished(item, fix, standing):
                return Progress.FLYING
            self._next(mission.current + 1)
        return Progress.FLYING

    def _next(self, index: int) -> None:
        self._mission.current = index
        self._begun = False

    def _reached(self, index: int) -> None:
        self._events.add(EventKind.ITEM_REACHED, Severity.INFO, "", index)

    def _begin(self, item: MissionItem, fix: Fix) -> int | None:
        """Start an item; an item that is done at once returns the index to go on with."""
        mission, guide, here = self._mission, self._guide, fix.position_N
        command, done = item.command, mission.current + 1
        if command in (ItemCommand.TAKEOFF, ItemCommand.VTOL_TAKEOFF):
            # straight up first; where the item names another place, the next waypoint goes there
            self._point = (here[0], here[1], min(self._places.of(item, here)[2], here[2]))
            guide.go(fix, self._point, self._heading(item))
        elif command in (ItemCommand.LAND, ItemCommand.VTOL_LAND):
            place = self._places.of(item, here)
            self._point = (place[0], place[1], here[2])
            guide.go(fix, self._point, self._heading(item))
        elif command in (
            ItemCommand.WAYPOINT,
            ItemCommand.SPLINE_WAYPOINT,
            ItemCommand.LOITER_TIME,
            ItemCommand.LOITER_UNLIMITED,
        ):
            self._point = self._places.of(item, here)
            guide.go(fix, self._point, self._heading(item), arrival_N=self._arrival(item, fix))
        elif command == ItemCommand.LOITER_TURNS:
            centre = self._places.of(item, here)
            radius = abs(item.param3) if math.isfinite(item.param3) and item.param3 != 0.0 else 2.0
            away = math.hypot(here[0] - centre[0], here[1] - centre[1])
            angle = math.atan2(here[1] - centre[1], here[0] - centre[0]) if away > 0.1 else 0.0
            self._point = (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle), centre[2])
            guide.go(fix, self._point)
        elif command in (ItemCommand.DELAY, ItemCommand.CONDITION_DELAY):
            guide.stop(fix)
            self._wait_until_s = fix.t_s + max(0.0, item.param1)
        elif command == ItemCommand.CONDITION_YAW:
            turn = math.radians(item.param1)
            if item.param4 == 1.0:  # relative, in the direction of param3
                turn = guide.reference(fix).heading_rad + (-turn if item.param3 < 0 else turn)
            guide.stop(fix)
            end = at(guide.trajectory, guide.trajectory.end_s)
            guide.go(fix, (end.north_m, end.east_m, end.down_m), turn)
        else:
            return self._do(item, fix, done)
        return None

    def _do(self, item: MissionItem, fix: Fix, done: int) -> int:
        """An item that takes no time; returns the index to go on with."""
        if item.command == ItemCommand.DO_JUMP:
            index = self._mission.current
            left = self._jumps.get(index, int(item.param2))
            if left != 0:
                self._jumps[index] = left - 1 if left > 0 else left
                return int(item.param1)
            self._jumps.pop(index, None)
        elif item.command == ItemCommand.DO_CHANGE_SPEED:
            if math.isfinite(item.param2) and item.param2 > 0.0:
                self._guide.speed_m_s = item.param2
        elif item.command == ItemCommand.DO_SET_HOME:
            self._set_home(None if item.param1 == 1.0 else self._places.of(item, fix.position_N))
        self._reached(self._mission.current)
        return done

    def _finished(self, item: MissionItem, fix: Fix, standing: bool) -> bool:
        guide, command, index = self._guide, item.command, self._mission.current
        if command in (ItemCommand.DELAY, ItemCommand.CONDITION_DELAY):
            return self._waited(fix, index)
        if command == ItemCommand.CONDITION_YAW:
            return self._passed(guide.done(fix), index)
        if command == ItemCommand.CONDITION_DISTANCE:
            return self._passed(math.dist(self._point, fix.position_N) <= item.param1, index)
        if command in (ItemCommand.LAND, ItemCommand.VTOL_LAND):
            return self._landed(fix, standing, index)
        if command == ItemCommand.LOITER_TURNS:
            return self._orbited(item, fix, index)
        near = math.dist(self._point, fix.position_N) <= self._radius(item)
        hold = item.param1 if command in (ItemCommand.WAYPOINT, ItemCommand.LOITER_TIME) else 0.0
        stops = command != ItemCommand.WAYPOINT or hold > 0.0 or item.autocontinue == 0
        if self._wait_until_s == math.inf:
            if not near or (stops and not guide.done(fix)):
                return False
            self._reached(index)
            if command == ItemCommand.LOITER_UNLIMITED or item.autocontinue == 0:
                self._wait_until_s = 1e18
            else:
                self._wait_until_s = fix.t_s + (hold if math.isfinite(hold) else 0.0)
        return fix.t_s >= self._wait_until_s

    def _passed(self, done: bool, index: int) -> bool:
        if done:
            self._reached(index)
        return done

    def _waited(self, fix: Fix, index: int) -> bool:
        return self._passed(fix.t_s >= self._wait_until_s, index)

    def _landed(self, fix: Fix, standing: bool, index: int) -> bool:
        if not self.landing:
            if self._guide.done(fix):
                self.landing = True
                self._landing.start(fix)
            return False
        self._landing.tick(fix)
        return self._passed(standing, index)

    def _orbited(self, item: MissionItem, fix: Fix, index: int) -> bool:
        if not self._guide.done(fix):
            return False
        if not self._orbiting:
            self._orbiting = True
            clockwise = -1.0 if item.param3 < 0 else 1.0
            centre = self._places.of(item, fix.position_N)
            radius = math.hypot(self._point[0] - centre[0], self._point[1] - centre[1])
            if item.param1 > 0.0 and radius > 0.0:
                self._guide.orbit(fix, centre, radius, clockwise * item.param1)
                return False
        self._reached(index)
        return True

    def _radius(self, item: MissionItem) -> float:
        own = item.param2 if item.command == ItemCommand.WAYPOINT else 0.0
        return own if math.isfinite(own) and own > 0.0 else self._p["NAV_ACC_RAD"]

    def _heading(self, item: MissionItem) -> float | None:
        return math.radians(item.param4) if math.isfinite(item.param4) else None

    def _arrival(self, item: MissionItem, fix: Fix) -> Vec3:
        """Velocity at a waypoint that is flown through: along the mean of both legs, less the sharper the corner."""
        mission, here = self._mission, fix.position_N
        following = mission.items[mission.current + 1] if mission.current + 1 < len(mission.items) else None
        flown_through = (
            item.command == ItemCommand.WAYPOINT
            and not item.param1 > 0.0
            and item.autocontinue != 0
            and following is not None
            and following.command == ItemCommand.WAYPOINT
        )
        if not flown_through or following is None:
            return (0.0, 0.0, 0.0)
        after = self._places.of(following, self._point)
        one = tuple(b - a for a, b in zip(here, self._point, strict=True))
        two = tuple(b - a for a, b in zip(self._point, after, strict=True))
        length_1, length_2 = math.hypot(*one), math.hypot(*two)
        if min(length_1, length_2) < 1.0:
            return (0.0, 0.0, 0.0)
        cos = max(-1.0, min(1.0, sum(a * b for a, b in zip(one, two, strict=True)) / (length_1 * length_2)))
        if math.acos(cos) >= _SHARP_RAD:
            return (0.0, 0.0, 0.0)
        limits = self._guide.limits()
        speed = min(limits.speed_m_s, math.sqrt(0.5 * limits.acceleration_m_s2 * min(length_1, length_2)))
        mean = tuple(a / length_1 + b / length_2 for a, b in zip(one, two, strict=True))
        k = speed * math.cos(0.5 * math.pi * math.acos(cos) / _SHARP_RAD) / math.hypot(*mean)
        return (k * mean[0], k * mean[1], k * mean[2])
