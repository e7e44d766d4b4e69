"""Who the vehicle says it is: autopilot dialect, mode numbers, version and capabilities.

The default autopilot field, PX4, is a claim about the dialect only: mode numbers and integer parameters are PX4's, so
that clients written for PX4 decode them rightly. Everything else says openly that this is a simulator: own vendor and
product number, own version of type DEV, the HIL flag in base_mode.
"""

import functools
from enum import Enum
from importlib import metadata
from typing import Any, NamedTuple

from sitl.mavlink.codec import mav, message
from sitl.onboard.modes import Mode

COMPONENT_ID: int = mav.MAV_COMP_ID_AUTOPILOT1
TYPE = 19  # MAV_TYPE_VTOL_TAILSITTER_DUOROTOR; pymavlink calls it by another name
VENDOR_ID, PRODUCT_ID = 0x5957, 0x5354  # "YW", "ST": nobody's USB numbers
SIMULATOR = "YawSitter SITL"

_CUSTOM = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mav.MAV_MODE_FLAG_HIL_ENABLED
_GUIDED = _CUSTOM | mav.MAV_MODE_FLAG_STABILIZE_ENABLED | mav.MAV_MODE_FLAG_GUIDED_ENABLED
_AUTO = _GUIDED | mav.MAV_MODE_FLAG_AUTO_ENABLED
_MANUAL = _GUIDED | mav.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
_PROPERTY_ADVANCED, _PROPERTY_NOT_SELECTABLE, _PROPERTY_AUTO = 1, 2, 4  # MAV_MODE_PROPERTY


class Identity(Enum):
    """Which autopilot the HEARTBEAT names."""

    PX4 = "px4"
    GENERIC = "generic"

    @property
    def autopilot(self) -> int:
        number: int = mav.MAV_AUTOPILOT_PX4 if self is Identity.PX4 else mav.MAV_AUTOPILOT_GENERIC
        return number


class ModeCode(NamedTuple):
    """A mode on the wire: PX4's main and sub mode, MAV_STANDARD_MODE, base_mode flags, MAV_MODE_PROPERTY, name."""

    main: int
    sub: int
    standard: int
    base: int
    properties: int
    name: str

    @property
    def custom_mode(self) -> int:
        return self.main << 16 | self.sub << 24


MODE_CODES = {
    Mode.POSITION: ModeCode(3, 0, mav.MAV_STANDARD_MODE_POSITION_HOLD, _MANUAL, 0, "Position"),
    Mode.TAKEOFF: ModeCode(4, 2, mav.MAV_STANDARD_MODE_TAKEOFF, _AUTO, _PROPERTY_AUTO, "Takeoff"),
    Mode.HOLD: ModeCode(4, 3, mav.MAV_STANDARD_MODE_NON_STANDARD, _AUTO, _PROPERTY_AUTO, "Hold"),
    Mode.MISSION: ModeCode(4, 4, mav.MAV_STANDARD_MODE_MISSION, _AUTO, _PROPERTY_AUTO, "Mission"),
    Mode.RETURN: ModeCode(4, 5, mav.MAV_STANDARD_MODE_SAFE_RECOVERY, _AUTO, _PROPERTY_AUTO, "Return"),
    Mode.LAND: ModeCode(4, 6, mav.MAV_STANDARD_MODE_LAND, _AUTO, _PROPERTY_AUTO, "Land"),
    Mode.OFFBOARD: ModeCode(
        6, 0, mav.MAV_STANDARD_MODE_NON_STANDARD, _AUTO, _PROPERTY_AUTO | _PROPERTY_ADVANCED, "Offboard"
    ),
    Mode.ORBIT: ModeCode(3, 1, mav.MAV_STANDARD_MODE_ORBIT, _AUTO, _PROPERTY_AUTO | _PROPERTY_NOT_SELECTABLE, "Orbit"),
}
_BY_CUSTOM_MODE = {code.custom_mode: mode for mode, code in MODE_CODES.items()}
_BY_STANDARD_MODE = {code.standard: mode for mode, code in MODE_CODES.items() if code.standard}


def mode_of_custom(custom_mode: int) -> Mode | None:
    """The mode of a packed custom_mode, None for one that the vehicle doesn't have."""
    return _BY_CUSTOM_MODE.get(custom_mode)


def mode_of_standard(standard_mode: int) -> Mode | None:
    """The mode of a MAV_STANDARD_MODE."""
    return _BY_STANDARD_MODE.get(standard_mode)


def heartbeat(identity: Identity, mode: Mode, armed: bool, system_status: int) -> Any:
    """HEARTBEAT of a vehicle in `mode`; system_status is a MAV_STATE."""
    code = MODE_CODES[mode]
    return message(
        "HEARTBEAT",
        type=TYPE,
        autopilot=identity.autopilot,
        base_mode=code.base | (mav.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0),
        custom_mode=code.custom_mode,
        system_status=system_status,
        mavlink_version=3,
    )


def boot_heartbeat(identity: Identity) -> Any:
    """HEARTBEAT while the vehicle is still being built."""
    return heartbeat(identity, Mode.HOLD, False, mav.MAV_STATE_BOOT)


def available_mode(index: int) -> Any:
    """AVAILABLE_MODES of one mode, index from 1."""
    code = list(MODE_CODES.values())[index - 1]
    return message(
        "AVAILABLE_MODES",
        number_modes=len(MODE_CODES),
        mode_index=index,
        standard_mode=code.standard,
        custom_mode=code.custom_mode,
        properties=code.properties,
        mode_name=code.name,
    )


def available_modes_monitor() -> Any:
    """AVAILABLE_MODES_MONITOR: the list never changes, so its number doesn't either, and it is told only on request."""
    return message("AVAILABLE_MODES_MONITOR", seq=0)


@functools.cache
def version() -> tuple[int, int, int]:
    """Major, minor and patch of this package; zeros when it isn't installed."""
    try:
        parts = metadata.version("yawsitter-sitl").split(".")
        major, minor, patch = (int(part) for part in parts[:3])
    except (metadata.PackageNotFoundError, ValueError):
        return 0, 0, 0
    return major, minor, patch


CAPABILITIES: int = (
    mav.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mav.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mav.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    | mav.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mav.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mav.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION
    | mav.MAV_PROTOCOL_CAPABILITY_FTP
    | mav.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | mav.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mav.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    | mav.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)


def autopilot_version(system_id: int) -> Any:
    """AUTOPILOT_VERSION. The last byte of the version is its type, 0 = DEV."""
    major, minor, patch = version()
    return message(
        "AUTOPILOT_VERSION",
        capabilities=CAPABILITIES,
        uid=VENDOR_ID << 16 | system_id,
        flight_sw_version=major << 24 | minor << 16 | patch << 8,
        vendor_id=VENDOR_ID,
        product_id=PRODUCT_ID,
    )


def protocol_version() -> Any:
    """PROTOCOL_VERSION: MAVLink 2 spoken, 1 understood."""
    return message("PROTOCOL_VERSION", version=200, min_version=100, max_version=200)
