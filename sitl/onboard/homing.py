"""The way home: up to a safe height, level to above home, down."""

import math
from enum import Enum

from sitl.onboard.guide import Fix, Guide
from sitl.onboard.landing import Landing
from sitl.onboard.parameters import Parameters
from sitl.onboard.places import Places

_CLOSE_M = 1.0  # a return from closer than this does not climb first


class Stage(Enum):
    CLIMB = "climb"
    CROSS = "cross"
    LAND = "land"


class Homing:
    """`tick` until the vehicle stands. From the ground it only lands, which ends in disarming."""

    def __init__(self, parameters: Parameters, guide: Guide, landing: Landing, places: Places) -> None:
        self._p, self._guide, self._landing, self._places = parameters, guide, landing, places
        self.stage = Stage.LAND

    def start(self, fix: Fix) -> None:
        home = self._places.home_N
        if self._guide.standing:
            self._land(fix)
        elif math.dist(home[:2], fix.position_N[:2]) < _CLOSE_M:
            self._cross(fix)
        else:
            self.stage = Stage.CLIMB
            self._guide.rise(fix, min(fix.nav.down_m, home[2] - self._p["RTL_RETURN_ALT"]))

    def _cross(self, fix: Fix) -> None:
        self.stage = Stage.CROSS
        self._guide.over(fix, *self._places.home_N[:2])

    def _land(self, fix: Fix) -> None:
        self.stage = Stage.LAND
        self._landing.start(fix)

    def tick(self, fix: Fix) -> None:
        if self.stage is Stage.LAND:
            self._landing.tick(fix)
        elif self._guide.done(fix):
            if self.stage is Stage.CLIMB:
                self._cross(fix)
            else:
                self._land(fix)
