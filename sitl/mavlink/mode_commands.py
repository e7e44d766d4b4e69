"""Commands that arm and that choose a mode."""

import math
from typing import TYPE_CHECKING

from sitl.mavlink.codec import mav
from sitl.mavlink.command import Command, Entry, Place, Reply, altitude_amsl, denied, place_of, reply_to
from sitl.mavlink.identity import mode_of_custom, mode_of_standard
from sitl.mavlink.wire import NAN
from sitl.onboard.mission_items import ItemCommand
from sitl.onboard.modes import Mode

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

FORCE = 21196  # the magic number of COMPONENT_ARM_DISARM
NEAR_M = 5.0  # how far a take-off or landing place may be from where the vehicle is


def _here(link: "Link", command: Command, what: str) -> str:
    """Why a take-off or landing can't be where the command says; the vehicle goes straight up and straight down.

    Latitude and longitude 0 stand for unset: many scripts send them.
    """
    if not any(command.number(k) for k in (5, 6)):
        return ""
    place = place_of(link, command)
    if place is None:
        return f"{what} refused: no such latitude and longitude"
    nav = link.vehicle.snapshot().nav
    if math.hypot(place.north_m - nav.north_m, place.east_m - nav.east_m) > NEAR_M:
        return f"{what} refused: only where the vehicle is; go there first"
    return ""


def _arm(link: "Link", _peer: "Peer", c: Command) -> Reply:
    arm, force = c.params[0], c.number(2)
    if arm not in (0.0, 1.0) or force not in (0.0, FORCE):
        return denied("Arming: param1 must be 0 or 1, param2 0 or 21196")
    commander = link.vehicle.commander
    return reply_to((commander.arm if arm else commander.disarm)(force=force == FORCE))


def _set_mode(link: "Link", _peer: "Peer", c: Command) -> Reply:
    """param2 is a packed custom_mode, or PX4's main mode with the sub mode in param3."""
    base, main, sub = c.number(1), c.number(2), c.number(3)
    if any(v < 0.0 or v != int(v) or v >= 2**32 for v in (base, main, sub)):
        return denied("Mode refused: mode numbers are whole and positive")
    custom_mode = int(main) << 16 | int(sub) << 24 if main < 256 else int(main)
    return set_custom_mode(link, int(base), custom_mode)


def set_custom_mode(link: "Link", base_mode: int, custom_mode: int) -> Reply:
    if not base_mode & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return denied("Mode refused: base_mode lacks the custom mode flag")
    mode = mode_of_custom(custom_mode)
    if mode is None:
        return denied(f"Mode refused: there is no mode {custom_mode >> 16 & 0xFF}/{custom_mode >> 24}")
    return reply_to(link.vehicle.commander.set_mode(mode))


def _set_standard_mode(link: "Link", _peer: "Peer", c: Command) -> Reply:
    number = c.number(1)
    mode = mode_of_standard(int(number))
    if mode is None:
        return denied(f"Mode refused: there is no standard mode {number:g}")
    return reply_to(link.vehicle.commander.set_mode(mode))


def _takeoff(link: "Link", _peer: "Peer", c: Command) -> Reply:
    refusal = _here(link, c, "Take-off")
    if refusal:
        return denied(refusal)
    altitude = None
    if not math.isnan(c.params[6]):
        altitude = altitude_amsl(link, (place_of(link, c) or Place(NAN, NAN, NAN)).down_m)
    yaw = c.params[3]
    return reply_to(link.vehicle.commander.takeoff(altitude, None if math.isnan(yaw) else math.radians(yaw)))


def _land(link: "Link", _peer: "Peer", c: Command) -> Reply:
    refusal = _here(link, c, "Landing")
    return denied(refusal) if refusal else reply_to(link.vehicle.commander.land())


def _return(link: "Link", _peer: "Peer", _c: Command) -> Reply:
    return reply_to(link.vehicle.commander.return_home())


def _pause_continue(link: "Link", _peer: "Peer", c: Command) -> Reply:
    if c.params[0] not in (0.0, 1.0):
        return denied("Pause: param1 must be 0 (pause) or 1 (continue)")
    commander = link.vehicle.commander
    return reply_to(commander.set_mode(Mode.MISSION) if c.params[0] else commander.hold())


def _mission_start(link: "Link", _peer: "Peer", c: Command) -> Reply:
    first, last, total = c.number(1), c.number(2), len(link.vehicle.mission.items)
    if first < 0.0 or first != int(first):
        return denied("Mission start refused: param1 is not an item's number")
    if last and last < total - 1:
        return denied("Mission start refused: it can't end before its last item")
    return reply_to(link.vehicle.commander.start_mission(int(first)))


def _set_mission_current(link: "Link", _peer: "Peer", c: Command) -> Reply:
    number, reset = c.number(1, -1.0), c.number(2)
    if number != int(number) or number < -1.0 or reset not in (0.0, 1.0):
        return denied("Set current item refused: param1 must be -1 or an item's number, param2 0 or 1")
    mission = link.vehicle.mission
    index = mission.current if number < 0.0 else int(number)
    if index >= len(mission.items):
        return Reply(mav.MAV_RESULT_FAILED, f"There is no mission item {index}")
    return reply_to(mission.set_current(index, reset=bool(reset)))


def _land_start(link: "Link", _peer: "Peer", _c: Command) -> Reply:
    """Go on with the mission where its landing begins."""
    for index, item in enumerate(link.vehicle.mission.items):
        if item.command == ItemCommand.DO_LAND_START:
            return reply_to(link.vehicle.commander.start_mission(index))
    return denied("Landing refused: the mission doesn't say where its landing begins (DO_LAND_START)")


COMMANDS: dict[int, Entry] = {
    mav.MAV_CMD_COMPONENT_ARM_DISARM: Entry(_arm, "12"),
    mav.MAV_CMD_DO_SET_MODE: Entry(_set_mode, "123"),
    mav.MAV_CMD_DO_SET_STANDARD_MODE: Entry(_set_standard_mode, "1"),
    mav.MAV_CMD_NAV_TAKEOFF: Entry(_takeoff, "1234567", place=True),
    mav.MAV_CMD_NAV_LAND: Entry(_land, "124567", place=True),
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: Entry(_return, ""),
    mav.MAV_CMD_DO_PAUSE_CONTINUE: Entry(_pause_continue, "1"),
    mav.MAV_CMD_MISSION_START: Entry(_mission_start, "12"),
    mav.MAV_CMD_DO_SET_MISSION_CURRENT: Entry(_set_mission_current, "12"),
    mav.MAV_CMD_DO_LAND_START: Entry(_land_start, ""),
}
