"""The stored rally points: places beside home where Return may lead."""

from collections.abc import Sequence
from enum import IntEnum

from sitl.onboard.places import Places
from sitl.onboard.plan import Finding, MissionItem, Plan, coordinates, plain, reserved
from sitl.quaternion import Vec3


class RallyCommand(IntEnum):
    """MAV_CMD, the one that may stand among rally points."""

    RALLY_POINT = 5100


class Rally(Plan):
    """The rally points in force."""

    name, _file = "rally points", "rally.json"

    def _fault(self, items: Sequence[MissionItem], index: int) -> Finding:
        item = items[index]
        return plain(item, RallyCommand, "list of rally points") or coordinates(item) or reserved(item, "")

    def points_N(self, places: Places) -> list[Vec3]:
        """Where they are now: a height above home moves with home."""
        return [places.of(item, (0.0, 0.0, 0.0)) for item in self.items]
