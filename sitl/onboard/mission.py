"""The stored mission, how far it has come, and what it holds."""

from collections.abc import Sequence
from enum import IntEnum

from sitl.onboard.events import EventLog
from sitl.onboard.mission_items import LANDINGS, ItemCommand, check_item, circular
from sitl.onboard.modes import ACCEPTED, EventKind, Outcome, Severity, Verdict
from sitl.onboard.plan import Finding, MissionItem, Plan
from sitl.onboard.store import Store


class MissionState(IntEnum):
    """MISSION_STATE."""

    UNKNOWN = 0
    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


class Mission(Plan):
    """The mission in force and how far it has come. `current` is the item being flown, or flown next."""

    name, _file = "mission", "mission.json"

    def __init__(self, store: Store, events: EventLog) -> None:
        self.current = 0
        self.state = MissionState.NO_MISSION
        super().__init__(store, events)

    def _fault(self, items: Sequence[MissionItem], index: int) -> Finding:
        return check_item(items[index], len(items)) or circular(items, index)

    @property
    def landing(self) -> MissionItem | None:
        """The item that lands, of a mission that marks where its landing begins (DO_LAND_START)."""
        commands = [item.command for item in self.items]
        if ItemCommand.DO_LAND_START not in commands:
            return None
        after = self.items[commands.index(ItemCommand.DO_LAND_START) :]
        return next((item for item in after if item.command in LANDINGS), None)

    def set_current(self, index: int, reset: bool = False) -> Outcome:
        """Go on from item `index`; with `reset` a completed mission counts as not started."""
        if not 0 <= index < len(self.items):
            return Outcome(Verdict.DENIED, f"no mission item {index}: there are {len(self.items)}")
        self.current = index
        self.revision += 1
        if reset or self.state is MissionState.COMPLETE:
            self.state = MissionState.NOT_STARTED
        self._events.add(EventKind.ITEM_CURRENT, Severity.INFO, f"mission item {index}", index)
        return ACCEPTED

    def _adopt(self, items: tuple[MissionItem, ...]) -> None:
        super()._adopt(items)
        self.current = 0
        self.state = MissionState.NOT_STARTED if items else MissionState.NO_MISSION
