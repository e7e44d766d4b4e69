"""Which modes may be entered, and which mode follows when something ends the present one.

Takeoff ── height reached ─▶ Hold          Offboard ── targets lost ─▶ by COM_OBL_RC_ACT
Mission ── complete ───────▶ Hold          Position ── sticks lost ──▶ Hold
Mission ── return item ────▶ Return        any in the air ── ground stations lost ─▶ by NAV_DLL_ACT
Takeoff, Land, Return, Mission ── disarmed ─▶ Hold
"""

from enum import Enum

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


LOSSES = (Happening.TARGETS_LOST, Happening.STICKS_LOST, Happening.STATIONS_LOST)

ENTRY: dict[Mode, tuple[str, ...]] = {
    Mode.POSITION: (),
    Mode.TAKEOFF: (),
    Mode.HOLD: (),
    Mode.MISSION: ("has_mission",),
    Mode.RETURN: (),
    Mode.LAND: (),
    Mode.OFFBOARD: ("streaming",),
}
"""The conditions that must hold for a mode to be taken on request."""

AFTER: dict[tuple[Mode, Happening], Mode | str] = {
    (Mode.TAKEOFF, Happening.HEIGHT_REACHED): Mode.HOLD,
    (Mode.TAKEOFF, Happening.DISARMED): Mode.HOLD,
    (Mode.MISSION, Happening.MISSION_COMPLETE): Mode.HOLD,
    (Mode.MISSION, Happening.RETURN_ITEM): Mode.RETURN,
    (Mode.MISSION, Happening.DISARMED): Mode.HOLD,
    (Mode.LAND, Happening.DISARMED): Mode.HOLD,
    (Mode.RETURN, Happening.DISARMED): Mode.HOLD,
    (Mode.OFFBOARD, Happening.TARGETS_LOST): "COM_OBL_RC_ACT",
    (Mode.POSITION, Happening.STICKS_LOST): Mode.HOLD,
    **{(mode, Happening.STATIONS_LOST): "NAV_DLL_ACT" for mode in Mode if mode not in (Mode.LAND, Mode.RETURN)},
}
"""The mode that follows, or the parameter that says which."""

ACTIONS: dict[str, dict[int, Mode]] = {
    "COM_OBL_RC_ACT": {3: Mode.RETURN, 4: Mode.LAND, 5: Mode.HOLD},
    "NAV_DLL_ACT": {1: Mode.HOLD, 2: Mode.RETURN, 3: Mode.LAND},
}


def after(mode: Mode, happening: Happening, parameters: Parameters) -> Mode | None:
    """The mode that follows; None: the present one goes on."""
    follows = AFTER.get((mode, happening))
    return ACTIONS[follows].get(int(parameters[follows])) if isinstance(follows, str) else follows
