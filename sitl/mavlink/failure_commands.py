"""INJECT_FAILURE: what can be made to fail, and how. Only with SYS_FAILURE_EN 1, as in PX4.

| unit | failures | instance (0: all) |
|---|---|---|
| motor (101) | off, stuck | 1 left, 2 right |
| servo (102): flap | off (hangs in the stream), stuck | 1 left, 2 right |
| GPS (4) | off, wrong, intermittent | 1 |
| MAVLink signal (105) | off, for SIM_LINK_OFF_T | 1 |

Ok (0) mends any of them. Anything else is UNSUPPORTED.
"""

from typing import TYPE_CHECKING

from sitl.mavlink.codec import mav
from sitl.mavlink.command import DONE, Command, Entry, Reply, denied
from sitl.model.failures import INTERMITTENT, OFF, STUCK, WRONG
from sitl.onboard.modes import Severity

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

_OK = 0.0
_NAMES = {_OK: "mended", OFF: "off", STUCK: "stuck", WRONG: "wrong", INTERMITTENT: "intermittent"}
_PARTS: dict[float, tuple[tuple[str, ...], tuple[float, ...]]] = {
    mav.FAILURE_UNIT_SYSTEM_MOTOR: (("motor_left", "motor_right"), (_OK, OFF, STUCK)),
    mav.FAILURE_UNIT_SYSTEM_SERVO: (("flap_left", "flap_right"), (_OK, OFF, STUCK)),
    mav.FAILURE_UNIT_SENSOR_GPS: (("gnss",), (_OK, OFF, WRONG, INTERMITTENT)),
}


def _inject(link: "Link", _peer: "Peer", c: Command) -> Reply:
    unit, kind, instance = c.number(1, -1.0), c.number(2, -1.0), c.number(3)
    vehicle = link.vehicle
    if not vehicle.parameters["SYS_FAILURE_EN"]:
        return denied("Failure refused: SYS_FAILURE_EN is 0")
    if unit == mav.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL and kind in (_OK, OFF) and instance in (0.0, 1.0):
        link.silence(vehicle.parameters["SIM_LINK_OFF_T"] if kind == OFF else 0.0)
        return DONE
    parts, kinds = _PARTS.get(unit, ((), ()))
    if kind not in kinds or instance not in range(len(parts) + 1):
        return Reply(
            mav.MAV_RESULT_UNSUPPORTED, f"There is no failure {kind:g} of unit {unit:g}, instance {instance:g}"
        )
    chosen = parts if instance == 0.0 else (parts[int(instance) - 1],)
    vehicle.failures = vehicle.failures._replace(**dict.fromkeys(chosen, kind))
    vehicle.events.tell(Severity.WARNING, f"failure: {', '.join(chosen).replace('_', ' ')} {_NAMES[kind]}")
    return DONE


COMMANDS: dict[int, Entry] = {mav.MAV_CMD_INJECT_FAILURE: Entry(_inject, "123")}
