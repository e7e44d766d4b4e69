"""What each MAV_CMD does: one table, and the handlers that it names.

A handler gets the command in one form, whichever message brought it, and answers with a MAV_RESULT and, for a refusal,
the reason in one sentence.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from sitl.geodesy import GeoPoint, to_global, to_local
from sitl.mavlink import requests
from sitl.mavlink.codec import mav
from sitl.mavlink.identity import mode_of_custom, mode_of_standard
from sitl.mavlink.offboard import AMSL_FRAMES, RELATIVE_FRAMES
from sitl.mavlink.wire import NAN
from sitl.onboard.modes import Mode, Outcome, Verdict

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

FORCE = 21196  # the magic number of COMPONENT_ARM_DISARM
NEAR_M = 5.0  # how far a take-off or landing place may be from where the vehicle is

UNSUPPORTED_FRAME = 9  # MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME

_RESULTS = {
    Verdict.ACCEPTED: mav.MAV_RESULT_ACCEPTED,
    Verdict.TEMPORARILY_REJECTED: mav.MAV_RESULT_TEMPORARILY_REJECTED,
    Verdict.DENIED: mav.MAV_RESULT_DENIED,
    Verdict.UNSUPPORTED: mav.MAV_RESULT_UNSUPPORTED,
    Verdict.FAILED: mav.MAV_RESULT_FAILED,
}


class Reply(NamedTuple):
    """MAV_RESULT and, of a refusal, the reason."""

    result: int
    reason: str = ""


DONE = Reply(mav.MAV_RESULT_ACCEPTED)


class Command(NamedTuple):
    """A command of either form. param5 and param6 are degrees or metres where they name a place."""

    id: int
    params: tuple[float, float, float, float, float, float, float]
    frame: int | None  # MAV_FRAME; None: COMMAND_LONG, which has none

    def number(self, index: int, default: float = 0.0) -> float:
        """param`index`; `default` where it is unset."""
        value = self.params[index - 1]
        return default if math.isnan(value) else value


class Place(NamedTuple):
    """In N [m]; NaN where the command leaves it open."""

    north_m: float
    east_m: float
    down_m: float


class Entry(NamedTuple):
    """One row of the table.

    used: the numbers of the parameters that may be set. place: param5 to 7 name one. query: a repetition is carried
    out again, the message asked for may have been lost.
    """

    handle: "Callable[[Link, Peer, Command], Reply]"
    used: str
    place: bool = False
    query: bool = False


def denied(reason: str) -> Reply:
    return Reply(mav.MAV_RESULT_DENIED, reason)


def _reply(outcome: Outcome) -> Reply:
    return Reply(_RESULTS[outcome.verdict], outcome.reason)


# --- places


def has_place(frame: int) -> bool:
    return frame in AMSL_FRAMES or frame in RELATIVE_FRAMES or frame == mav.MAV_FRAME_LOCAL_NED


def _place(link: "Link", command: Command) -> Place | None:
    """Where param5, 6, 7 are; None if there is no such latitude or longitude. COMMAND_LONG: above sea level."""
    x, y, z = command.params[4:]
    if command.frame == mav.MAV_FRAME_LOCAL_NED:
        return Place(x, y, z)
    commander = link.vehicle.commander
    ground = commander.home.alt_amsl_m if command.frame in RELATIVE_FRAMES else 0.0
    down = commander.origin.alt_amsl_m - ground - z
    if math.isnan(x) or math.isnan(y):
        return Place(NAN, NAN, down)
    if abs(x) > 90.0 or abs(y) > 180.0:
        return None
    return Place(*to_local(commander.origin, x, y), down)


def _here(link: "Link", command: Command, what: str) -> str:
    """Why a take-off or landing can't be where the command says; the vehicle goes straight up and straight down.

    Latitude and longitude 0 stand for unset: many scripts send them.
    """
    if not any(command.number(k) for k in (5, 6)):
        return ""
    place = _place(link, command)
    if place is None:
        return f"{what} refused: no such latitude and longitude"
    nav = link.vehicle.snapshot().nav
    if math.hypot(place.north_m - nav.north_m, place.east_m - nav.east_m) > NEAR_M:
        return f"{what} refused: only where the vehicle is; go there first"
    return ""


def _altitude_amsl(link: "Link", down_m: float) -> float:
    return link.vehicle.commander.origin.alt_amsl_m - down_m


# --- handlers, in the table's order


def _arm(link: "Link", _peer: "Peer", c: Command) -> Reply:
    arm, force = c.params[0], c.number(2)
    if arm not in (0.0, 1.0) or force not in (0.0, FORCE):
        return denied("Arming: param1 must be 0 or 1, param2 0 or 21196")
    commander = link.vehicle.commander
    return _reply((commander.arm if arm else commander.disarm)(force=force == FORCE))


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
    return _reply(link.vehicle.commander.set_mode(mode))


def _set_standard_mode(link: "Link", _peer: "Peer", c: Command) -> Reply:
    number = c.number(1)
    mode = mode_of_standard(int(number))
    if mode is None:
        return denied(f"Mode refused: there is no standard mode {number:g}")
    return _reply(link.vehicle.commander.set_mode(mode))


def _takeoff(link: "Link", _peer: "Peer", c: Command) -> Reply:
    refusal = _here(link, c, "Take-off")
    if refusal:
        return denied(refusal)
    altitude = None
    if not math.isnan(c.params[6]):
        altitude = _altitude_amsl(link, (_place(link, c) or Place(NAN, NAN, NAN)).down_m)
    yaw = c.params[3]
    return _reply(link.vehicle.commander.takeoff(altitude, None if math.isnan(yaw) else math.radians(yaw)))


def _land(link: "Link", _peer: "Peer", c: Command) -> Reply:
    refusal = _here(link, c, "Landing")
    return denied(refusal) if refusal else _reply(link.vehicle.commander.land())


def _return(link: "Link", _peer: "Peer", _c: Command) -> Reply:
    return _reply(link.vehicle.commander.return_home())


def _loiter(link: "Link", _peer: "Peer", c: Command) -> Reply:
    if any(c.number(k) for k in (5, 6, 7)):
        return _go_to(link, c, None)
    return _reply(link.vehicle.commander.hold())


def _reposition(link: "Link", _peer: "Peer", c: Command) -> Reply:
    """All of the position unset: pause. Yaw in radians, from north or (flag 2) from the heading now."""
    speed, flags, yaw = c.number(1, -1.0), int(c.number(2)), c.params[3]
    commander = link.vehicle.commander
    if not flags & mav.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE and commander.mode is not Mode.HOLD:
        return Reply(mav.MAV_RESULT_TEMPORARILY_REJECTED, "Reposition refused: not in Hold, nor asked to change to it")
    if flags & 2 and not math.isnan(yaw):
        yaw += link.view().attitude.yaw
    if all(math.isnan(v) for v in (*c.params[4:], yaw)):
        return _reply(commander.hold())
    return _go_to(link, c._replace(params=(*c.params[:3], yaw, *c.params[4:])), speed if speed > 0.0 else None)


def _go_to(link: "Link", c: Command, speed_m_s: float | None) -> Reply:
    place = _place(link, c)
    if place is None:
        return denied("Reposition refused: no such latitude and longitude")
    yaw = c.params[3]
    return _reply(link.vehicle.commander.reposition(*place, None if math.isnan(yaw) else yaw, speed_m_s))


def _pause_continue(link: "Link", _peer: "Peer", c: Command) -> Reply:
    if c.params[0] not in (0.0, 1.0):
        return denied("Pause: param1 must be 0 (pause) or 1 (continue)")
    commander = link.vehicle.commander
    return _reply(commander.set_mode(Mode.MISSION) if c.params[0] else commander.hold())


def _mission_start(link: "Link", _peer: "Peer", c: Command) -> Reply:
    first, last, total = c.number(1), c.number(2), len(link.vehicle.mission.items)
    if first < 0.0 or first != int(first):
        return denied("Mission start refused: param1 is not an item's number")
    if last and last < total - 1:
        return denied("Mission start refused: it can't end before its last item")
    return _reply(link.vehicle.commander.start_mission(int(first)))


def _set_mission_current(link: "Link", _peer: "Peer", c: Command) -> Reply:
    number, reset = c.number(1, -1.0), c.number(2)
    if number != int(number) or number < -1.0 or reset not in (0.0, 1.0):
        return denied("Set current item refused: param1 must be -1 or an item's number, param2 0 or 1")
    mission = link.vehicle.mission
    index = mission.current if number < 0.0 else int(number)
    if index >= len(mission.items):
        return Reply(mav.MAV_RESULT_FAILED, f"There is no mission item {index}")
    return _reply(mission.set_current(index, reset=bool(reset)))


def _change_speed(link: "Link", _peer: "Peer", c: Command) -> Reply:
    """−1 keeps the speed, −2 takes the default."""
    kind, speed, throttle = c.number(1), c.number(2, -1.0), c.number(3, -1.0)
    if kind not in (0.0, 1.0):
        return denied("Change of speed refused: only horizontal speed can be changed")
    if throttle > 0.0:
        return denied("Change of speed refused: throttle can't be set")
    if speed == -1.0:
        return DONE
    if speed == -2.0:
        speed = link.vehicle.parameters["MPC_XY_CRUISE"]
    if speed <= 0.0:
        return denied(f"Change of speed refused: {speed:g} m/s")
    return _reply(link.vehicle.commander.change_speed(speed))


def _set_home(link: "Link", _peer: "Peer", c: Command) -> Reply:
    use_current = c.number(1)
    if use_current == 1.0:
        return _reply(link.vehicle.commander.set_home(None))
    place = _place(link, c)
    if use_current != 0.0 or place is None or any(map(math.isnan, place)):
        return denied("Home refused: param1 must be 1, or 0 with latitude, longitude and altitude")
    lat, lon = to_global(link.vehicle.commander.origin, place.north_m, place.east_m)
    if c.frame != mav.MAV_FRAME_LOCAL_NED:
        lat, lon = c.params[4], c.params[5]
    yaw = c.params[3]
    point = GeoPoint(lat, lon, _altitude_amsl(link, place.down_m))
    return _reply(link.vehicle.commander.set_home(point, None if math.isnan(yaw) else math.radians(yaw)))


def _prearm_checks(link: "Link", peer: "Peer", _c: Command) -> Reply:
    """Accepted when the checks were run, whatever they say; SYS_STATUS and a text tell the result."""
    commander = link.vehicle.commander
    if commander.armed:
        return Reply(mav.MAV_RESULT_TEMPORARILY_REJECTED, "Pre-arm checks refused: armed")
    outcome = commander.ready_to_arm()
    if not outcome.ok:
        link.complain(peer, outcome.reason)
    return DONE


def _terminate(link: "Link", _peer: "Peer", c: Command) -> Reply:
    if c.number(1) <= 0.5:
        return Reply(mav.MAV_RESULT_FAILED)  # how the guide lets clients ask whether it could be done
    return _reply(link.vehicle.commander.terminate())


def _reboot_shutdown(link: "Link", _peer: "Peer", c: Command) -> Reply:
    action = c.number(1)
    if action not in (0.0, 1.0, 2.0):
        return denied("Reboot refused: param1 must be 0 (nothing), 1 (reboot) or 2 (shut down)")
    if action == 0.0:
        return DONE
    reply = _reply(link.vehicle.commander.reboot())  # its conditions hold for shutting down too
    if reply == DONE:
        link.reboot_requested |= action == 1.0
        link.shutdown_requested |= action == 2.0
    return reply


def _storage(link: "Link", _peer: "Peer", c: Command) -> Reply:
    """0 reads, 1 writes (both done at all times), 2 and 4 reset to the defaults; param2 2 clears the mission."""
    parameters, mission = c.number(1, -1.0), c.number(2, -1.0)
    if parameters not in (-1.0, 0.0, 1.0, 2.0, 4.0) or mission not in (-1.0, 0.0, 1.0, 2.0):
        return denied("Storage: param1 must be 0, 1, 2 or 4, param2 0, 1 or 2")
    if link.vehicle.commander.armed:
        return Reply(mav.MAV_RESULT_TEMPORARILY_REJECTED, "Storage refused: armed")
    refused = link.vehicle.parameters.reset() if parameters >= 2.0 else None
    fault = link.vehicle.mission.clear() if mission == 2.0 else None
    if refused is not None or fault is not None:
        return Reply(mav.MAV_RESULT_FAILED, "Storage: not saved")
    return DONE


def _set_message_interval(link: "Link", peer: "Peer", c: Command) -> Reply:
    refusal = requests.set_interval(link, peer, c.params[0], c.params[1])
    return denied(refusal) if refusal else DONE


def _request(link: "Link", peer: "Peer", message_id: float, detail: float = 0.0) -> Reply:
    known = math.isfinite(message_id) and requests.send_message(link, peer, int(message_id), detail)
    return DONE if known else Reply(mav.MAV_RESULT_DENIED)


def _request_message(link: "Link", peer: "Peer", c: Command) -> Reply:
    return _request(link, peer, c.params[0], c.params[1])


def _get_message_interval(link: "Link", peer: "Peer", c: Command) -> Reply:
    return _request(link, peer, mav.MAVLINK_MSG_ID_MESSAGE_INTERVAL, c.params[0])


def _fixed_request(message_id: int) -> "Callable[[Link, Peer, Command], Reply]":
    return lambda link, peer, _c: _request(link, peer, message_id)


TABLE: dict[int, Entry] = {
    mav.MAV_CMD_COMPONENT_ARM_DISARM: Entry(_arm, "12"),
    mav.MAV_CMD_DO_SET_MODE: Entry(_set_mode, "123"),
    mav.MAV_CMD_DO_SET_STANDARD_MODE: Entry(_set_standard_mode, "1"),
    mav.MAV_CMD_NAV_TAKEOFF: Entry(_takeoff, "1234567", place=True),
    mav.MAV_CMD_NAV_LAND: Entry(_land, "124567", place=True),
    mav.MAV_CMD_NAV_RETURN_TO_LAUNCH: Entry(_return, ""),
    mav.MAV_CMD_NAV_LOITER_UNLIM: Entry(_loiter, "34567", place=True),
    mav.MAV_CMD_DO_REPOSITION: Entry(_reposition, "1234567", place=True),
    mav.MAV_CMD_DO_PAUSE_CONTINUE: Entry(_pause_continue, "1"),
    mav.MAV_CMD_MISSION_START: Entry(_mission_start, "12"),
    mav.MAV_CMD_DO_SET_MISSION_CURRENT: Entry(_set_mission_current, "12"),
    mav.MAV_CMD_DO_CHANGE_SPEED: Entry(_change_speed, "123"),
    mav.MAV_CMD_DO_SET_HOME: Entry(_set_home, "1234567", place=True),
    mav.MAV_CMD_RUN_PREARM_CHECKS: Entry(_prearm_checks, ""),
    mav.MAV_CMD_DO_FLIGHTTERMINATION: Entry(_terminate, "1"),
    mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: Entry(_reboot_shutdown, "12346"),
    mav.MAV_CMD_PREFLIGHT_STORAGE: Entry(_storage, "123"),
    mav.MAV_CMD_SET_MESSAGE_INTERVAL: Entry(_set_message_interval, "1234567", query=True),
    mav.MAV_CMD_GET_MESSAGE_INTERVAL: Entry(_get_message_interval, "1", query=True),
    mav.MAV_CMD_REQUEST_MESSAGE: Entry(_request_message, "1234567", query=True),
    mav.MAV_CMD_GET_HOME_POSITION: Entry(_fixed_request(mav.MAVLINK_MSG_ID_HOME_POSITION), "", query=True),
    mav.MAV_CMD_REQUEST_PROTOCOL_VERSION: Entry(_fixed_request(300), "1", query=True),
    mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: Entry(
        _fixed_request(mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION), "1", query=True
    ),
}
"""By MAV_CMD."""
