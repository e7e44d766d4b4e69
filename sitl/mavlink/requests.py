"""Messages on request: REQUEST_MESSAGE and its older relatives, intervals and data streams."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from sitl.mavlink import streams
from sitl.mavlink.codec import Frame, by_id, by_name, mav, message
from sitl.mavlink.identity import (
    MODE_CODES,
    autopilot_version,
    available_mode,
    available_modes_monitor,
    heartbeat,
    protocol_version,
)
from sitl.onboard.modes import Landed

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

_LONGEST_US = 3_600_000_000  # an interval beyond an hour is a mistake


def system_status(link: "Link") -> int:
    """MAV_STATE of the vehicle."""
    c = link.vehicle.commander
    if c.failsafe and c.landed is not Landed.ON_GROUND:
        state = mav.MAV_STATE_CRITICAL
    elif c.tipped_over:
        state = mav.MAV_STATE_EMERGENCY
    else:
        state = mav.MAV_STATE_ACTIVE if c.armed else mav.MAV_STATE_STANDBY
    return int(state)


def vehicle_heartbeat(link: "Link") -> Any:
    c = link.vehicle.commander
    return heartbeat(link.identity, c.mode, c.armed, system_status(link))


def send_message(link: "Link", peer: "Peer", message_id: int, detail: float) -> bool:
    """Send one message to one peer. `detail` is the request's second parameter. False: it can't be had."""
    if message_id > 0xFF and peer.encoder.version == 1:
        return False
    places = streams.BY_ID.get(message_id)
    if places is not None:
        view = link.view()
        packed = [(streams.STREAMS[k].definition, streams.STREAMS[k].payload(view)) for k in places]
        if not all(payload for _, payload in packed):
            return False
        for definition, payload in packed:
            link.send_packed(peer, definition, payload)
        return True
    maker = ONE_SHOT.get(message_id)
    replies = maker(link, peer, int(detail) if math.isfinite(detail) else 0) if maker else []
    for reply in replies:
        link.send(peer, reply)
    return bool(replies)


def _modes(_link: "Link", _peer: "Peer", index: int) -> list[Any]:
    """All modes for index 0, or one of them: never a part of the list."""
    if index == 0:
        return [available_mode(k + 1) for k in range(len(MODE_CODES))]
    return [available_mode(index)] if 1 <= index <= len(MODE_CODES) else []


def _interval_of(_link: "Link", peer: "Peer", message_id: int) -> list[Any]:
    known = message_id in streams.BY_ID
    interval = peer.schedule.interval(message_id) if known else streams.DEFAULT  # 0: not available
    return [message("MESSAGE_INTERVAL", message_id=message_id & 0xFFFF, interval_us=interval)]


def _metadata(link: "Link", _peer: "Peer", _detail: int) -> list[Any]:
    return [link.metadata.message(link.vehicle.now_us)]


ONE_SHOT: dict[int, Callable[["Link", "Peer", int], list[Any]]] = {
    by_name("HEARTBEAT").id: lambda link, _peer, _detail: [vehicle_heartbeat(link)],
    by_name("AUTOPILOT_VERSION").id: lambda link, _peer, _detail: [autopilot_version(link.system_id)],
    by_name("PROTOCOL_VERSION").id: lambda _link, _peer, _detail: [protocol_version()],
    by_name("AVAILABLE_MODES").id: _modes,
    by_name("AVAILABLE_MODES_MONITOR").id: lambda _link, _peer, _detail: [available_modes_monitor()],
    by_name("MESSAGE_INTERVAL").id: _interval_of,
    by_name("COMPONENT_METADATA").id: _metadata,
}


def set_interval(link: "Link", peer: "Peer", message_id: float, interval_us: float) -> str:
    """Change one peer's rate of a message. Returns why not, or nothing."""
    if message_id not in streams.BY_ID:
        name = _name_of(message_id)
        return f"{name} can't be streamed" if name else f"There is no message {message_id:g}"
    if not (interval_us in (streams.DEFAULT, streams.OFF) or 0.0 < interval_us <= _LONGEST_US):
        return f"An interval of {interval_us:g} us is not possible"
    microseconds = max(1, round(interval_us)) if interval_us > 0.0 else int(interval_us)
    if not peer.schedule.set_interval(int(message_id), microseconds, link.vehicle.now_us):
        return f"All streams together would exceed {streams.TOTAL_MAX_HZ:g} messages a second"
    return ""


def _name_of(message_id: float) -> str:
    try:
        return by_id(int(message_id)).name
    except (KeyError, ValueError, OverflowError):
        return ""


def on_request_data_stream(link: "Link", peer: "Peer", frame: Frame) -> None:
    """REQUEST_DATA_STREAM: the rate of a whole group; a rate of 0 means the default."""
    m = frame.message
    interval = streams.OFF
    if m.start_stop:
        interval = round(1e6 / m.req_message_rate) if m.req_message_rate else streams.DEFAULT
    for message_id in streams.group_members(m.req_stream_id):
        peer.schedule.set_interval(message_id, interval, link.vehicle.now_us)
