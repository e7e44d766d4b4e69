"""One-shot commands to a vehicle: arm, disarm, takeoff, land, hold, return, mode, a mission's start.

Each is a script of a Client.
"""

import math

from gcs_tools.client import SEEN_S, Client, LinkError, Script
from gcs_tools.plan import Uploaded
from gcs_tools.upload import hand_over
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

NAN = math.nan
FORCE = 21196  # the magic number of COMPONENT_ARM_DISARM
CLIMB_LIMIT_S = 120.0
LANDING_LIMIT_S = 300.0


def arm(client: Client, *, force: bool = False) -> Script[str]:
    yield from client.connect()
    yield from client.require("arming", mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, FORCE if force else 0.0)
    yield from client.wait(lambda: client.vehicle.armed, SEEN_S, "arming was accepted but the vehicle isn't armed")
    return "armed"


def disarm(client: Client, *, force: bool = False) -> Script[str]:
    yield from client.connect()
    yield from client.require("disarming", mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, FORCE if force else 0.0)
    yield from client.wait(lambda: not client.vehicle.armed, SEEN_S, "disarming was accepted but the vehicle is armed")
    return "disarmed"


def takeoff(client: Client, *, height_m: float | None, wait: bool) -> Script[str]:
    """Climb to a height above home (None: the vehicle's MIS_TAKEOFF_ALT), arming first if need be."""
    yield from client.connect()
    v = client.vehicle
    altitude = NAN
    if height_m is not None:
        client.request("HOME_POSITION")
        yield from client.wait(lambda: v.home is not None, SEEN_S, "the vehicle doesn't tell its home")
        assert v.home is not None
        altitude = v.home[2] + height_m
    yield from client.require("take-off", mav.MAV_CMD_NAV_TAKEOFF, NAN, 0.0, 0.0, NAN, NAN, NAN, altitude)
    if not v.armed:
        yield from client.arm()
    if not wait:
        return "taking off"
    yield from client.wait(lambda: v.mode == "takeoff", SEEN_S, "take-off was accepted but its mode isn't in force")
    yield from client.wait(
        lambda: v.mode != "takeoff" or not v.armed, CLIMB_LIMIT_S, f"not up after {CLIMB_LIMIT_S:g} s"
    )
    if not v.armed or v.mode != "hold":
        raise LinkError(f"the take-off ended in mode {v.mode}, {'armed' if v.armed else 'disarmed'}")
    return "hovering"


def land(client: Client, *, wait: bool) -> Script[str]:
    yield from client.connect()
    yield from client.require("landing", mav.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, NAN, NAN, NAN, NAN)
    return (yield from _down(client, "landing", wait))


def return_home(client: Client, *, wait: bool) -> Script[str]:
    yield from client.connect()
    yield from client.require("return", mav.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    return (yield from _down(client, "returning", wait))


def _down(client: Client, doing: str, wait: bool) -> Script[str]:
    if not wait:
        return doing
    v = client.vehicle
    yield from client.wait(lambda: not v.armed, LANDING_LIMIT_S, f"not down after {LANDING_LIMIT_S:g} s")
    return "landed and disarmed"


def mode(client: Client, name: str) -> Script[str]:
    yield from client.connect()
    yield from client.set_mode(name)
    return f"mode {name}"


def mission(client: Client, plan: Uploaded) -> Script[str]:
    """Hand a mission over and start it, from the ground or in the air."""
    yield from client.connect()
    yield from hand_over(client, plan)
    if not client.vehicle.armed:
        yield from client.arm()
    yield from start_mission(client)
    return f"mission {plan.name} under way"


def start_mission(client: Client, patience_s: float = 0.0) -> Script[None]:
    """Start the stored mission and see its mode in force; where that is refused, motors on the ground are stopped."""
    v = client.vehicle
    try:
        yield from client.require("starting the mission", mav.MAV_CMD_MISSION_START, 0.0, 0.0, patience_s=patience_s)
    except LinkError:
        disarm = mav.MAV_CMD_COMPONENT_ARM_DISARM
        client.send(codec.message("COMMAND_LONG", command=disarm, param1=0.0, **client.address()))
        raise
    yield from client.wait(lambda: v.mode == "mission", SEEN_S, "the mission was started but its mode isn't in force")
