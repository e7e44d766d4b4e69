"""Whether the stored mission keeps to the fence.

A mission is taken at upload whatever the fence: ground stations send the mission first and then the fence that belongs
to it. It is judged when it is to be started, and told of when either changes.
"""

from typing import Any

from sitl.onboard.circles import Circle
from sitl.onboard.mission_items import LANDINGS, ItemCommand, has_place
from sitl.onboard.plan import MissionItem
from sitl.onboard.plans import Plans
from sitl.quaternion import Vec3

_SAMPLES = 16  # points of a circle that are looked at


class Feasibility:
    def __init__(self, plans: Plans) -> None:
        self._plans = plans
        self._seen: Any = None

    def news(self, here_N: Vec3) -> str:
        """The objection to a mission where it, the fence or home has changed since the last call."""
        p = self._plans
        now = (p.mission.plan_id, p.fence.plan_id, p.places.home, p.geofence.limits)
        if now == self._seen:
            return ""
        first, self._seen = self._seen is None, now
        return "" if first else self.objection(here_N)

    def objection(self, here_N: Vec3) -> str:
        """The first item outside the fence and why, or nothing."""
        geofence = self._plans.geofence
        if not (geofence.active and geofence.present):
            return ""
        for index, item in enumerate(self._plans.mission.items):
            if has_place(item):
                for point in self._points(item, here_N):
                    objection = geofence.objection(point, f"item {index}")
                    if objection:
                        return objection
        return ""

    def _points(self, item: MissionItem, here_N: Vec3) -> list[Vec3]:
        north, east, down = self._plans.places.of(item, here_N)
        if item.command in LANDINGS:
            return [(north, east, 0.0)]
        if item.command == ItemCommand.LOITER_TURNS and item.param3:
            circle = Circle((north, east, down), abs(item.param3))
            return [circle.point(6.283185307179586 * k / _SAMPLES) for k in range(_SAMPLES)]
        return [(north, east, down)]
