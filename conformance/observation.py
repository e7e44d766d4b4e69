"""What one client said, and what it was answered.

Only what a client chose to say is kept, and as sets: counts and order differ from run to run.
"""

from collections.abc import Iterable
from typing import Any

import msgspec

from sitl.mavlink.codec import Frame, by_id, mav

ANSWERS: dict[str, tuple[str, ...]] = {
    "HEARTBEAT": ("HEARTBEAT",),
    "COMMAND_LONG": ("COMMAND_ACK",),
    "COMMAND_INT": ("COMMAND_ACK",),
    "COMMAND_CANCEL": ("COMMAND_ACK",),
    "SET_MODE": ("HEARTBEAT",),
    "PING": ("PING",),
    "TIMESYNC": ("TIMESYNC",),
    "PARAM_REQUEST_LIST": ("PARAM_VALUE",),
    "PARAM_REQUEST_READ": ("PARAM_VALUE", "PARAM_ERROR"),
    "PARAM_SET": ("PARAM_VALUE", "PARAM_ERROR"),
    "MISSION_COUNT": ("MISSION_REQUEST_INT", "MISSION_ACK"),
    "MISSION_ITEM": ("MISSION_REQUEST_INT", "MISSION_ACK"),
    "MISSION_ITEM_INT": ("MISSION_REQUEST_INT", "MISSION_ACK"),
    "MISSION_REQUEST_LIST": ("MISSION_COUNT",),
    "MISSION_REQUEST": ("MISSION_ITEM_INT", "MISSION_ACK"),
    "MISSION_REQUEST_INT": ("MISSION_ITEM_INT", "MISSION_ACK"),
    "MISSION_REQUEST_PARTIAL_LIST": ("MISSION_ACK",),
    "MISSION_WRITE_PARTIAL_LIST": ("MISSION_ACK",),
    "MISSION_CLEAR_ALL": ("MISSION_ACK",),
    "MISSION_SET_CURRENT": ("MISSION_CURRENT",),
    "SET_POSITION_TARGET_LOCAL_NED": ("POSITION_TARGET_LOCAL_NED",),
    "SET_POSITION_TARGET_GLOBAL_INT": ("POSITION_TARGET_GLOBAL_INT",),
    "SET_ATTITUDE_TARGET": ("ATTITUDE_TARGET",),
    "FILE_TRANSFER_PROTOCOL": ("FILE_TRANSFER_PROTOCOL",),
    "LOG_REQUEST_LIST": ("LOG_ENTRY",),
    "LOG_REQUEST_DATA": ("LOG_DATA",),
}
"""By message: the messages one of which answers it. What is missing here is taken without an answer."""

Results = dict[str, set[str]]

COMPONENT_INFORMATION = 395  # deprecated, and gone from pymavlink
_REQUESTS = {
    mav.MAV_CMD_REQUEST_PROTOCOL_VERSION: "PROTOCOL_VERSION",
    mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: "AUTOPILOT_VERSION",
}


UNSUPPORTED = "unsupported"


class Observation(msgspec.Struct, frozen=True):
    """One client.

    messages: what it sent, and whether an answer was seen (true for what is taken without one).
    commands: MAV_CMD by the results they were acknowledged with. requests, rates: the messages that it asked for once,
    or at a rate, and the results.
    """

    messages: dict[str, bool] = {}
    commands: dict[str, list[str]] = {}
    requests: dict[str, list[str]] = {}
    rates: dict[str, list[str]] = {}


def observe(frames: Iterable[Frame], vehicle: int) -> Observation:
    """Reduce what passed, in its order, between the system `vehicle` and one client."""
    sent: set[str] = set()
    heard: set[str] = set()
    results: tuple[Results, Results, Results] = ({}, {}, {})
    asked: dict[int, list[tuple[Results, str]]] = {}
    for frame in frames:
        name, m = frame.name, frame.message
        if frame.system != vehicle:
            sent.add(name)
            if name in ("COMMAND_LONG", "COMMAND_INT"):
                asked[m.command] = _entries(m, *results)
        else:
            heard.add(name)
            if name == "COMMAND_ACK" and m.result != mav.MAV_RESULT_IN_PROGRESS:
                for kind, what in asked.get(m.command, ()):
                    kind.setdefault(what, set()).add(_result_name(m.result))
    messages = {name: not (answers := ANSWERS.get(name)) or not heard.isdisjoint(answers) for name in sorted(sent)}
    commands, requests, rates = ({what: sorted(kind[what]) for what in sorted(kind)} for kind in results)
    return Observation(messages, commands, requests, rates)


def _entries(m: Any, commands: Results, requests: Results, rates: Results) -> list[tuple[Results, str]]:
    """Where the result of a command is to be entered: under its own name, and under that of the message it is about."""
    entries = [(commands, command_name(m.command))]
    if m.command in _REQUESTS:
        entries.append((requests, _REQUESTS[m.command]))
    elif m.command == mav.MAV_CMD_REQUEST_MESSAGE:
        entries.append((requests, _message_name(m.param1)))
    elif m.command == mav.MAV_CMD_SET_MESSAGE_INTERVAL:
        entries.append((rates, _message_name(m.param1)))
    return entries


def _message_name(number: float) -> str:
    try:
        return "COMPONENT_INFORMATION" if number == COMPONENT_INFORMATION else by_id(int(number)).name
    except (KeyError, ValueError, OverflowError):
        return f"{number:g}"


def command_name(number: int) -> str:
    """MAV_CMD without its prefix; the number of one that the dialect lacks."""
    entry = mav.enums["MAV_CMD"].get(number)
    return entry.name.removeprefix("MAV_CMD_") if entry else str(number)


def _result_name(number: int) -> str:
    entry = mav.enums["MAV_RESULT"].get(number)
    return entry.name.removeprefix("MAV_RESULT_").lower().replace("_", " ") if entry else str(number)
