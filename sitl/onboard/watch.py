"""What is watched in every mode beside the ground: the fence, a mission that leaves it, the battery."""

from collections.abc import Callable

from sitl.onboard.battery import BatteryWatch, Level
from sitl.onboard.events import EventLog
from sitl.onboard.feasibility import Feasibility
from sitl.onboard.guide import Fix
from sitl.onboard.modes import EventKind, Severity
from sitl.onboard.parameters import Parameters
from sitl.onboard.plans import Plans
from sitl.onboard.transitions import Happening

_TERMINATE = 4.0  # GF_ACTION


class Watch:
    """Tells `happened` what has happened, with the details."""

    def __init__(
        self, parameters: Parameters, plans: Plans, events: EventLog, happened: Callable[[Happening, str], None]
    ) -> None:
        self._p, self._events, self._happened = parameters, events, happened
        self._geofence = plans.geofence
        self._feasibility, self._battery = Feasibility(plans), BatteryWatch(parameters)

    def restart(self) -> None:
        self._battery.restart()

    def battery_lasts(self, remaining: float) -> float:
        """How full the battery is when there may next be something to tell of it."""
        return self._battery.lasts(remaining)

    @property
    def fenced(self) -> bool:
        """Whether there is a fence to watch at every tick."""
        return self._geofence.breach.outside or (self._geofence.active and self._geofence.present)

    def fence(self, fix: Fix, flying: bool) -> bool:
        """True: the flight is to be terminated."""
        outside = self._geofence.breach.outside
        violation = self._geofence.watch(fix, flying, self._p["MPC_ACC_HOR"])
        if self._geofence.breach.outside is not outside:
            self._events.add(EventKind.FENCE, Severity.INFO, "")
        if violation is None:
            return False
        self._happened(Happening.FENCE_BREACHED, violation.reason)
        return self._p["GF_ACTION"] == _TERMINATE

    def mission_objection(self, fix: Fix) -> str:
        """Why the mission can't be flown within the fence, or nothing."""
        return self._feasibility.objection(fix.position_N)

    def mission(self, fix: Fix, flown: bool) -> None:
        """Tell of a mission that leaves the fence when either changes, and don't let it be flown on."""
        objection = self._feasibility.news(fix.position_N)
        if objection and flown:
            self._happened(Happening.MISSION_OUTSIDE, objection)
        elif objection:
            self._events.tell(Severity.WARNING, f"mission can't be started: {objection}")

    def battery(self, remaining: float, armed: bool) -> None:
        """How full the battery is, 0 … 1."""
        level = self._battery.watch(remaining)
        if level is None or not armed:
            return
        percent = f"{100.0 * remaining:.0f} %"
        if level is Level.LOW:
            self._events.tell(Severity.WARNING, f"battery low: {percent}")
        else:
            critical = level is Level.CRITICAL
            self._happened(Happening.BATTERY_CRITICAL if critical else Happening.BATTERY_EMERGENCY, percent)
