"""What `gcs watch` shows of a vehicle."""

import math

from gcs_tools.client import Client
from gcs_tools.vehicle_state import HANDLERS
from gcs_tools.watch.plain import line, rows
from sitl.mavlink.codec import mav


def told(*messages: object) -> dict[str, str]:
    client = Client()
    for message in messages:
        HANDLERS[message.get_type()](client.vehicle, message, 0.0)  # type: ignore[attr-defined]
    assert all(text in line(client) for text, _ in rows(client))
    return dict(rows(client))


def heartbeat(armed: bool) -> object:
    flags = mav.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return mav.MAVLink_heartbeat_message(mav.MAV_TYPE_VTOL_DUOROTOR, mav.MAV_AUTOPILOT_PX4, flags, 6 << 16, 4, 3)


def position(north: float, east: float, down: float) -> object:
    return mav.MAVLink_local_position_ned_message(1000, north, east, down, 0.0, 0.0, 0.0)


def target(north: float, east: float, down: float) -> object:
    return mav.MAVLink_position_target_local_ned_message(1000, 1, 0, north, east, down, 0, 0, 0, 0, 0, 0, 0, 0)


def test_it_shows_how_far_the_vehicle_is_from_where_it_should_be() -> None:
    shown = told(heartbeat(armed=True), position(3.0, 0.5, -5.0), target(3.0, 0.1, -4.7))
    assert " ".join(shown["error"].split()) == "north 0.000 east 0.400 down -0.300 m, 0.500 m in all"


def test_it_shows_no_error_where_nothing_is_to_be_followed() -> None:
    assert "error" not in told(heartbeat(armed=False), position(0.0, 0.0, 0.0), target(0.0, 0.0, 0.0))
    assert "error" not in told(heartbeat(armed=True), position(0.0, 0.0, 0.0), target(math.nan, 0.0, 0.0))
