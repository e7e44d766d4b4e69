"""Commands that lead the vehicle somewhere within its mode: go, orbit, loiter, turn, face, speed, home.

Those that end by themselves (turns, a wait, a height, a heading) answer IN_PROGRESS with how far they have come, and
at their end with the result; the others are accepted at once. Changes of mode are too, as PX4 does it: QGroundControl
arms when the take-off's result comes, so that it must not wait for the flight.
"""

import math
from typing import TYPE_CHECKING

from sitl.geodesy import GeoPoint, to_global
from sitl.mavlink.codec import mav
from sitl.mavlink.command import (
    DONE,
    Command,
    Entry,
    Place,
    Reply,
    altitude_amsl,
    denied,
    place_of,
    reply_later,
    reply_to,
)
from sitl.mavlink.wire import NAN
from sitl.onboard.gaze import Look
from sitl.onboard.modes import Mode

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

_NO_PLACE = "no such latitude and longitude"
_RELATIVE_YAW = 2  # MAV_DO_REPOSITION_FLAGS
_ROI_NONE, _ROI_LOCATION = 0.0, 3.0  # MAV_ROI


def _target(link: "Link", c: Command) -> Place | None:
    """As place_of, where latitude and longitude 0 stand for unset, and all of it 0 too: many scripts send them."""
    if not any(c.number(k) for k in (5, 6, 7)):
        return Place(NAN, NAN, NAN)
    if not any(c.number(k) for k in (5, 6)):
        c = c._replace(params=(*c.params[:4], NAN, NAN, c.params[6]))
    return place_of(link, c)


def _loiter(link: "Link", _peer: "Peer", c: Command) -> Reply:
    place, yaw = _target(link, c), c.params[3]
    if place is None:
        return denied(f"Loiter refused: {_NO_PLACE}")
    if all(map(math.isnan, place)) and not c.number(4):  # mavutil's set_mode_loiter sends nothing but zeros
        return reply_to(link.vehicle.commander.hold())
    return reply_to(link.vehicle.commander.guided.reposition(place, _radians(yaw)))


def _loiter_turns(link: "Link", _peer: "Peer", c: Command) -> Reply:
    place, turns = _target(link, c), c.number(1)
    if place is None:
        return denied(f"Loiter refused: {_NO_PLACE}")
    if not 0.0 < turns <= _TURNS_MAX:
        return denied(f"Loiter refused: param1 must be above 0 and at most {_TURNS_MAX:g} turns")
    guided = link.vehicle.commander.guided
    return reply_later(guided.turns(place, c.params[2], turns), guided.task)


def _loiter_time(link: "Link", _peer: "Peer", c: Command) -> Reply:
    place, stay_s = _target(link, c), c.number(1)
    if place is None:
        return denied(f"Loiter refused: {_NO_PLACE}")
    if not 0.0 <= stay_s <= _STAY_MAX_S:
        return denied(f"Loiter refused: param1 must be 0 to {_STAY_MAX_S:g} s")
    guided = link.vehicle.commander.guided
    return reply_later(guided.reposition(place, stay_s=stay_s), guided.task)


def _loiter_to_altitude(link: "Link", _peer: "Peer", c: Command) -> Reply:
    place = _target(link, c)
    if place is None or math.isnan(place.down_m):
        return denied("Loiter refused: it takes an altitude")
    guided = link.vehicle.commander.guided
    return reply_later(guided.reposition(place), guided.task)


def _turn(link: "Link", _peer: "Peer", c: Command) -> Reply:
    angle, rate, way, relative = c.params[0], c.number(2), c.number(3), c.number(4)
    if not abs(angle) <= 360.0 or not 0.0 <= rate <= 360.0 or way not in (-1.0, 0.0, 1.0) or relative not in (0.0, 1.0):
        return denied("Turn refused: param1 up to 360 deg, param2 0 to 360 deg/s, param3 -1, 0 or 1, param4 0 or 1")
    heading = math.radians(angle)
    if relative:
        heading = link.view().attitude.yaw + (-heading if way < 0.0 else heading)
    guided = link.vehicle.commander.guided
    return reply_later(guided.turn(heading, int(way), math.radians(rate) if rate else None), guided.task)


def _orbit(link: "Link", _peer: "Peer", c: Command) -> Reply:
    """param4 in radians, 0: without end."""
    speed, behaviour, total = c.params[1], c.number(3), abs(c.number(4))
    place, look = place_of(link, c), _LOOKS.get(behaviour)
    if place is None:
        return denied(f"Orbit refused: {_NO_PLACE}")
    if look is None:
        return denied(f"Orbit refused: there is no yaw behaviour {behaviour:g} here")
    if speed <= 0.0:
        return denied(f"Orbit refused: {speed:g} m/s")
    speed_m_s = None if math.isnan(speed) else speed
    return reply_to(link.vehicle.commander.guided.orbit(place, c.params[0], speed_m_s, look, total or math.inf))


_TURNS_MAX, _STAY_MAX_S = 100.0, 86400.0
_LOOKS = {
    mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TO_CIRCLE_CENTER: Look.POINT,
    mav.ORBIT_YAW_BEHAVIOUR_HOLD_INITIAL_HEADING: Look.AHEAD,
    mav.ORBIT_YAW_BEHAVIOUR_UNCONTROLLED: Look.AHEAD,
    mav.ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE: Look.ALONG,
    mav.ORBIT_YAW_BEHAVIOUR_UNCHANGED: Look.POINT,
}


def _face(link: "Link", _peer: "Peer", c: Command) -> Reply:
    place, commander = place_of(link, c), link.vehicle.commander
    if place is None or any(map(math.isnan, place[:2])):
        return denied("Region of interest refused: it takes latitude and longitude")
    return reply_to(commander.face(place))


def _face_nothing(link: "Link", _peer: "Peer", _c: Command) -> Reply:
    link.vehicle.commander.gaze.forget()
    return DONE


def _face_as_before(link: "Link", peer: "Peer", c: Command) -> Reply:
    """The older DO_SET_ROI."""
    if c.number(1) == _ROI_LOCATION:
        return _face(link, peer, c)
    if c.number(1) == _ROI_NONE:
        return _face_nothing(link, peer, c)
    return denied("Region of interest refused: only 0 (none) and 3 (a location) can be faced")


def _reposition(link: "Link", _peer: "Peer", c: Command) -> Reply:
    """All of the position unset: pause. Yaw in radians, from north or (flag 2) from the heading now."""
    speed, flags, yaw = c.number(1, -1.0), int(c.number(2)), c.params[3]
    commander = link.vehicle.commander
    if not flags & mav.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE and commander.mode is not Mode.HOLD:
        return Reply(mav.MAV_RESULT_TEMPORARILY_REJECTED, "Reposition refused: not in Hold, nor asked to change to it")
    if flags & _RELATIVE_YAW and not math.isnan(yaw):
        yaw += link.view().attitude.yaw
    if all(math.isnan(v) for v in (*c.params[4:], yaw)):
        return reply_to(commander.hold())
    place = place_of(link, c)
    if place is None:
        return denied(f"Reposition refused: {_NO_PLACE}")
    outcome = commander.guided.reposition(place, None if math.isnan(yaw) else yaw, speed if speed > 0.0 else None)
    return reply_to(outcome)


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
    return reply_to(link.vehicle.commander.change_speed(speed))


def _set_home(link: "Link", _peer: "Peer", c: Command) -> Reply:
    use_current = c.number(1)
    if use_current == 1.0:
        return reply_to(link.vehicle.commander.set_home(None))
    place = place_of(link, c)
    if use_current != 0.0 or place is None or any(map(math.isnan, place)):
        return denied("Home refused: param1 must be 1, or 0 with latitude, longitude and altitude")
    lat, lon = to_global(link.vehicle.commander.origin, place.north_m, place.east_m)
    if c.frame != mav.MAV_FRAME_LOCAL_NED:
        lat, lon = c.params[4], c.params[5]
    yaw = c.params[3]
    point = GeoPoint(lat, lon, altitude_amsl(link, place.down_m))
    return reply_to(link.vehicle.commander.set_home(point, _radians(yaw)))


def _radians(degrees: float) -> float | None:
    return None if math.isnan(degrees) else math.radians(degrees)


COMMANDS: dict[int, Entry] = {
    mav.MAV_CMD_NAV_LOITER_UNLIM: Entry(_loiter, "34567", place=True),
    mav.MAV_CMD_NAV_LOITER_TURNS: Entry(_loiter_turns, "1234567", place=True),
    mav.MAV_CMD_NAV_LOITER_TIME: Entry(_loiter_time, "1234567", place=True),
    mav.MAV_CMD_NAV_LOITER_TO_ALT: Entry(_loiter_to_altitude, "124567", place=True),
    mav.MAV_CMD_CONDITION_YAW: Entry(_turn, "1234"),
    mav.MAV_CMD_DO_ORBIT: Entry(_orbit, "1234567", place=True, amsl=True),
    mav.MAV_CMD_DO_REPOSITION: Entry(_reposition, "1234567", place=True),
    mav.MAV_CMD_DO_SET_ROI_LOCATION: Entry(_face, "1567", place=True),
    mav.MAV_CMD_DO_SET_ROI_NONE: Entry(_face_nothing, "1"),
    mav.MAV_CMD_DO_SET_ROI: Entry(_face_as_before, "1234567", place=True),
    mav.MAV_CMD_DO_CHANGE_SPEED: Entry(_change_speed, "123"),
    mav.MAV_CMD_DO_SET_HOME: Entry(_set_home, "1234567", place=True, amsl=True),
}
