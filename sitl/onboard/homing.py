"""The way home, or to a rally point: up to a safe height, level to above the place, down.

RTL_TYPE 0: to the nearest of home and the rally points; 1: or to the mission's landing, if that is nearer. After a
breach of a fence that has a point to return to, and without rally points, there.
"""

import math
from enum import Enum

from sitl.onboard.calm import Wait
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.landing import Landing
from sitl.onboard.parameters import Parameters
from sitl.onboard.plans import Plans
from sitl.quaternion import Vec3

_CLOSE_M = 1.0  # a return from closer than this does not climb first


class Stage(Enum):
    CLIMB = "climb"
    CROSS = "cross"
    DESCEND = "descend"
    WAIT = "wait"
    LAND = "land"


class Homing:
    """`tick` until the vehicle stands. From the ground it only lands, which ends in disarming."""

    def __init__(
        self,
        parameters: Parameters,
        guide: Guide,
        landing: Landing,
        plans: Plans,
    ) -> None:
        self._p, self._guide, self._landing, self._places = parameters, guide, landing, plans.places
        self._mission, self._fence, self._rally, self._geofence = (
            plans.mission,
            plans.fence,
            plans.rally,
            plans.geofence,
        )
        self.stage = Stage.LAND
        self._goal_N: Vec3 = (0.0, 0.0, 0.0)
        self._until_s = 0.0

    def _goal(self, here_N: Vec3) -> Vec3:
        """Where to land; its height is the least to go there at."""
        if self._geofence.breach.outside and self._fence.return_point_N is not None and not self._rally.items:
            return self._fence.return_point_N
        goals = [self._places.home_N]
        goals += [p for p in self._rally.points_N(self._places) if self._geofence.violation(p) is None]
        landing = self._mission.landing if self._p["RTL_TYPE"] else None
        if landing is not None:
            north, east, _ = self._places.of(landing, here_N)
            goals.append((north, east, self._places.home_N[2]))
        return min(goals, key=lambda goal: math.dist(goal[:2], here_N[:2]))  # of equals the first: home

    def start(self, fix: Fix) -> None:
        self._goal_N = self._goal(fix.position_N)
        if self._guide.standing:
            self._land(fix)
        elif math.dist(self._goal_N[:2], fix.position_N[:2]) < _CLOSE_M:
            self._cross(fix)
        else:
            self.stage = Stage.CLIMB
            least = self._places.home_N[2] - self._p["RTL_RETURN_ALT"]
            self._guide.rise(fix, min(fix.nav.down_m, least, self._goal_N[2]))

    def _cross(self, fix: Fix) -> None:
        self.stage = Stage.CROSS
        self._guide.over(fix, *self._goal_N[:2])

    def _descend(self, fix: Fix) -> None:
        self.stage = Stage.DESCEND
        self._guide.rise(fix, max(fix.nav.down_m, self._places.home_N[2] - self._p["RTL_DESCEND_ALT"]))

    def _wait(self, fix: Fix) -> None:
        self.stage = Stage.WAIT
        delay_s = self._p["RTL_LAND_DELAY"]
        self._until_s = fix.t_s + delay_s if delay_s >= 0.0 else math.inf

    def _land(self, fix: Fix) -> None:
        self.stage = Stage.LAND
        self._landing.start(fix)

    def tick(self, fix: Fix) -> None:
        if self.stage is Stage.LAND:
            self._landing.tick(fix)
        elif self.stage is Stage.WAIT:
            if fix.t_s >= self._until_s:
                self._land(fix)
        elif self._guide.done(fix):
            if self.stage is Stage.CLIMB:
                self._cross(fix)
            elif self.stage is Stage.DESCEND:
                self._wait(fix)
            elif self._p["RTL_LAND_DELAY"] != 0.0:
                self._descend(fix)
            else:
                self._land(fix)

    def waits(self) -> Wait:
        if self.stage is Stage.LAND:
            return self._landing.waits()
        return Wait(self._until_s if self.stage is Stage.WAIT else self._guide.done_s)
