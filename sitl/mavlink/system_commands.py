"""Commands to the vehicle as a system: checks, storage, rates, messages on request, its end."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from sitl.mavlink import requests
from sitl.mavlink.codec import mav
from sitl.mavlink.command import DONE, Command, Entry, Reply, denied, reply_to

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer


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
    return reply_to(link.vehicle.commander.terminate())


def _reboot_shutdown(link: "Link", _peer: "Peer", c: Command) -> Reply:
    action = c.number(1)
    if action not in (0.0, 1.0, 2.0):
        return denied("Reboot refused: param1 must be 0 (nothing), 1 (reboot) or 2 (shut down)")
    if action == 0.0:
        return DONE
    reply = reply_to(link.vehicle.commander.reboot())  # its conditions hold for shutting down too
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


COMMANDS: dict[int, Entry] = {
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
