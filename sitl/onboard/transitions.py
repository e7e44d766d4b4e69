"""Which modes may be entered, and which mode follows when something ends the present one.

Takeoff ── height reached ─▶ Hold          Offboard ── targets lost ─▶ by COM_OBL_RC_ACT
Mission ── complete ───────▶ Hold          Position ── sticks lost ──▶ by NAV_RCL_ACT
Mission ── return item ────▶ Return        any in the air ── ground stations lost ─▶ by NAV_DLL_ACT
Mission ── fence shuts it out ▶ Hold       any in the air ── battery low ──────────▶ by COM_LOW_BAT_ACT
Orbit ── circle complete ──▶ Hold          any but Land and Return ── out of the fence ▶ by GF_ACTION
Takeoff, Land, Return, Mission, Orbit ── disarmed ─▶ Hold
"""

from enum import Enum
from typing import NamedTuple

from sitl.onboard.modes import Mode
from sitl.onboard.parameters import Parameters


class Happening(Enum):
    """What can end a mode from within."""

    HEIGHT_REACHED = "take-off height reached"
    MISSION_COMPLETE = "mission complete"
    RETURN_ITEM = "mission returns home"
    DISARMED = "disarmed"
    TARGETS_LOST = "offboard targets lost"
    STICKS_LOST = "stick input lost"
    STATIONS_LOST = "ground stations lost"
    MISSION_OUTSIDE = "mission leaves the fence"
    ORBIT_COMPLETE = "orbit complete"
    FENCE_BREACHED = "fence breached"
    BATTERY_CRITICAL = "battery critical"
    BATTERY_EMERGENCY = "battery nearly empty"


LOSSES = (
    Happening.TARGETS_LOST,
    Happening.STICKS_LOST,
    Happening.STATIONS_LOST,
    Happening.FENCE_BREACHED,
    Happening.BATTERY_CRITICAL,
    Happening.BATTERY_EMERGENCY,
)
"""What makes the mode that follows a failsafe."""

ENTRY: dict[Mode, tuple[str, ...]] = {
    Mode.POSITION: (),
    Mode.ORBIT: ("asked_to_orbit",),
    Mode.TAKEOFF: (),
    Mode.HOLD: (),
    Mode.MISSION: ("has_mission", "mission_inside"),
    Mode.RETURN: (),
    Mode.LAND: (),
    Mode.OFFBOARD: ("targets_alive",),
}
"""The conditions that must hold for a mode to be taken on request."""


class Choice(NamedTuple):
    """The parameter that says which mode follows, and the modes by its values; for other values none does."""

    parameter: str
    modes: dict[int, Mode]


_TARGETS_LOST = Choice("COM_OBL_RC_ACT", {3: Mode.RETURN, 4: Mode.LAND, 5: Mode.HOLD})
_STICKS_LOST = Choice("NAV_RCL_ACT", {1: Mode.HOLD, 2: Mode.RETURN, 3: Mode.LAND})
_STATIONS_LOST = Choice("NAV_DLL_ACT", {1: Mode.HOLD, 2: Mode.RETURN, 3: Mode.LAND})
_FENCE_BREACHED = Choice("GF_ACTION", {2: Mode.HOLD, 3: Mode.RETURN, 5: Mode.LAND})
_BATTERY_CRITICAL = Choice("COM_LOW_BAT_ACT", {2: Mode.LAND, 3: Mode.RETURN})
_BATTERY_EMERGENCY = Choice("COM_LOW_BAT_ACT", {2: Mode.LAND, 3: Mode.LAND})
_NOT_COMING_DOWN = tuple(mode for mode in Mode if mode not in (Mode.LAND, Mode.RETURN))

AFTER: dict[tuple[Mode, Happening], Mode | Choice] = {
    (Mode.TAKEOFF, Happening.HEIGHT_REACHED): Mode.HOLD,
    (Mode.TAKEOFF, Happening.DISARMED): Mode.HOLD,
    (Mode.MISSION, Happening.MISSION_COMPLETE): Mode.HOLD,
    (Mode.MISSION, Happening.MISSION_OUTSIDE): Mode.HOLD,
    (Mode.MISSION, Happening.RETURN_ITEM): Mode.RETURN,
    (Mode.MISSION, Happening.DISARMED): Mode.HOLD,
    (Mode.ORBIT, Happening.ORBIT_COMPLETE): Mode.HOLD,
    (Mode.ORBIT, Happening.DISARMED): Mode.HOLD,
    (Mode.LAND, Happening.DISARMED): Mode.HOLD,
    (Mode.RETURN, Happening.DISARMED): Mode.HOLD,
    (Mode.OFFBOARD, Happening.TARGETS_LOST): _TARGETS_LOST,
    (Mode.POSITION, Happening.STICKS_LOST): _STICKS_LOST,
    **{(mode, Happening.STATIONS_LOST): _STATIONS_LOST for mode in _NOT_COMING_DOWN},
    **{(mode, Happening.FENCE_BREACHED): _FENCE_BREACHED for mode in _NOT_COMING_DOWN},
    **{(mode, Happening.BATTERY_CRITICAL): _BATTERY_CRITICAL for mode in _NOT_COMING_DOWN},
    **{(mode, Happening.BATTERY_EMERGENCY): _BATTERY_EMERGENCY for mode in Mode if mode is not Mode.LAND},
}
"""The mode that follows, or the parameter that says which."""


def after(mode: Mode, happening: Happening, parameters: Parameters) -> Mode | None:
    """The mode that follows; None: the present one goes on."""
    follows = AFTER.get((mode, happening))
    return follows.modes.get(int(parameters[follows.parameter])) if isinstance(follows, Choice) else follows
