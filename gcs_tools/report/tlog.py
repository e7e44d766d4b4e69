"""A .tlog → a Log: MAVLink frames, each behind the wall time at which it passed (8 bytes, µs since 1970, big-endian).

Messages without a time of their own carry that of the newest one that has it.
"""

import math
from collections import defaultdict
from pathlib import Path
from typing import Any

from gcs_tools.client import LAST_VEHICLE, command_name
from gcs_tools.params import Parameter
from gcs_tools.report.link_quality import quality
from gcs_tools.report.log import Event, Log, Status, bundled_defaults
from gcs_tools.report.tlog_frames import Stamped, frames
from gcs_tools.vehicle_state import LANDED, SEVERITIES, VehicleState
from sitl.frames import body_quaternion, quaternion_to_yxz
from sitl.mavlink.codec import Frame, mav
from sitl.strict_yaml import ConfigError

_RESTART_S = 1.0  # back in the vehicle's time: it has started anew
_AUTOPILOT = 1
_QUIET = (mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAV_CMD_REQUEST_MESSAGE)  # commands not worth an entry
_TARGET_IGNORES_POSITION = 0b111
_ACCEPTED, _IN_PROGRESS = 0, 5


def read(path: Path, data: bytes, system: int | None) -> Log:
    """Raises ConfigError."""
    log = Log(path, ".tlog")
    stamped = list(frames(data, path, log.damage))
    vehicles = list(dict.fromkeys(s.frame.system for s in stamped if _is_vehicle(s.frame)))
    if not vehicles:
        raise ConfigError(f"{path}: no vehicle is heard in it")
    system = vehicles[0] if system is None else system
    if system not in vehicles:
        raise ConfigError(f"{path}: no system {system} in it; allowed: {', '.join(map(str, vehicles))}")
    if len(vehicles) > 1:
        others = ", ".join(str(v) for v in vehicles if v != system)
        log.facts["other vehicles"] = f"system {others} (--system ID reports another)"
    log.unix_s = stamped[0].unix_s, max(s.unix_s for s in stamped)
    reader = _Reader(log, system)
    for each in stamped:
        reader.take(each)
    reader.finish()
    log.link = quality(stamped, (system, _AUTOPILOT), reader.stamps)
    return log


def _is_vehicle(frame: Frame) -> bool:
    return (
        frame.component == _AUTOPILOT
        and frame.system <= LAST_VEHICLE
        and frame.name == "HEARTBEAT"
        and frame.message.autopilot != mav.MAV_AUTOPILOT_INVALID
    )


class _Reader:
    """Takes one vehicle's frames, in their order, into a Log."""

    def __init__(self, log: Log, system: int) -> None:
        self._log, self._system = log, system
        self._state = VehicleState()
        self._t_s: float | None = None  # the vehicle's time, on from before where it has started anew
        self._offset_s = 0.0
        self._unix_s = 0.0
        self._reached: int | None = None
        self._told: dict[str, float] = {}  # parameters, their newest values
        self._early: list[Any] = []  # what came before any time was known
        self.stamps: dict[str, list[float]] = defaultdict(list)  # message → the vehicle's time of each
        log.facts["system"] = str(system)

    def take(self, stamped: Stamped) -> None:
        frame = stamped.frame
        if frame.system != self._system or frame.component != _AUTOPILOT:
            if frame.name == "SET_POSITION_TARGET_LOCAL_NED" and frame.message.target_system == self._system:
                self._sent(frame.message)
            return
        self._keep_time(frame.message, stamped.unix_s)
        if self._t_s is None:
            self._early.append(frame)
        else:
            self._handle(frame)

    def finish(self) -> None:
        """What came before the first time, if none has followed, is at zero. What isn't told is stood in for."""
        if self._t_s is None:
            self._t_s = 0.0
            self._handle_early()
        log = self._log
        if not log.reported.targets:
            log.reported.targets = log.rows["sent"]
        if not log.rows["angles"]:
            log.rows["angles"] = log.reported.angles
        if log.parameters and log.vehicle:
            log.defaults = bundled_defaults(log.vehicle)

    def _keep_time(self, m: Any, unix_s: float) -> None:
        stamp_ms = getattr(m, "time_boot_ms", None)
        if stamp_ms is None:
            return
        t = stamp_ms * 1e-3 + self._offset_s
        if self._t_s is None:
            self._t_s, self._unix_s = t, unix_s
            self._handle_early()
        elif t < self._t_s - _RESTART_S:
            between_s = max(0.0, unix_s - self._unix_s)
            self._offset_s += self._t_s + between_s - t
            self._log.events.append(Event(self._t_s + between_s, "restart", "the vehicle has started anew"))
            self._t_s += between_s
        self._t_s, self._unix_s = max(self._t_s, stamp_ms * 1e-3 + self._offset_s), unix_s

    def _handle_early(self) -> None:
        early, self._early = self._early, []
        for frame in early:
            self._handle(frame)

    def _handle(self, frame: Frame) -> None:
        assert self._t_s is not None
        name, m = frame.name, frame.message
        self.stamps[name].append(self._t_s)
        handler = _HANDLERS.get(name)
        if handler is not None:
            handler(self, m)

    def _time_of(self, stamp_s: float) -> float:
        return stamp_s + self._offset_s

    def _shifted(self, m: Any) -> Any:
        """The message with its stamp in the log's time, for a Recording."""
        if not self._offset_s:
            return m
        if hasattr(m, "time_boot_ms"):
            return m._replace(time_boot_ms=m.time_boot_ms + self._offset_s * 1e3)
        return m._replace(time_usec=m.time_usec + self._offset_s * 1e6)

    def _row(self, name: str, stamp_s: float, *values: float) -> None:
        self._log.rows[name].append((self._time_of(stamp_s), *values))

    def _heartbeat(self, m: Any) -> None:
        self._state.heartbeat(m, 0.0)
        self._status()

    def _landed(self, m: Any) -> None:
        self._state.extended_sys_state(m, 0.0)
        self._status()

    def _status(self) -> None:
        v, landed = self._state, self._state.landed
        assert self._t_s is not None
        where = LANDED.get(landed)
        self._log.note_status(Status(self._t_s, v.mode, v.armed if v.mode else None, where))

    def _text(self, m: Any) -> None:
        assert self._t_s is not None
        v = self._state
        v.statustext(m, self._t_s)
        self._log.vehicle = self._log.vehicle or v.name
        while v.texts:
            text = v.texts.popleft()
            self._log.events.append(Event(text.wall_s, SEVERITIES[text.severity & 7], text.text))

    def _position(self, m: Any) -> None:
        self._log.reported.position(self._shifted(m))
        self._row("velocity", m.time_boot_ms * 1e-3, m.vx, m.vy, m.vz)

    def _target(self, m: Any) -> None:
        self._log.reported.target(self._shifted(m))
        self._row("reference_velocity", m.time_boot_ms * 1e-3, m.vx, m.vy, m.vz)

    def _debug(self, m: Any) -> None:
        self._log.reported.debug(self._shifted(m))
        if m.name == "THRUST_N":
            self._row("thrust", m.time_usec * 1e-6, m.x, m.y)

    def _attitude(self, m: Any) -> None:
        self._row("angles", m.time_boot_ms * 1e-3, *_yxz_deg(m.q1, m.q2, m.q3, m.q4))

    def _attitude_target(self, m: Any) -> None:
        self._row("angles_command", m.time_boot_ms * 1e-3, *_yxz_deg(*m.q))

    def _wind(self, m: Any) -> None:
        self._row("wind", m.time_usec * 1e-6, m.wind_x, m.wind_y, m.wind_z)

    def _battery(self, m: Any) -> None:
        assert self._t_s is not None
        if m.voltage_battery != 0xFFFF:
            amps = m.current_battery * 1e-2 if m.current_battery >= 0 else math.nan
            self._log.rows["battery"].append((self._t_s, m.voltage_battery * 1e-3, amps, m.battery_remaining))

    def _item_reached(self, m: Any) -> None:
        assert self._t_s is not None
        if m.seq != self._reached:  # told to each listener
            self._reached = m.seq
            self._log.reached.append((self._t_s, m.seq))
            self._log.events.append(Event(self._t_s, "mission", f"item {m.seq} reached"))

    def _ack(self, m: Any) -> None:
        assert self._t_s is not None
        if m.command in _QUIET or m.result == _IN_PROGRESS:
            return
        entry = mav.enums["MAV_RESULT"].get(m.result)
        result = entry.name.removeprefix("MAV_RESULT_").lower().replace("_", " ") if entry else str(m.result)
        self._log.events.append(Event(self._t_s, "command", f"{command_name(m.command)}: {result}"))

    def _parameter(self, m: Any) -> None:
        assert self._t_s is not None
        parameter = Parameter.of(m)
        name, value = parameter.name, parameter.value
        if name.startswith("_") or self._told.get(name) == value:
            return
        if name in self._told:
            self._log.events.append(Event(self._t_s, "parameter", f"{name} = {parameter.text}"))
        self._told[name] = value
        self._log.parameters[name].append((self._t_s, value))

    def _version(self, m: Any) -> None:
        number = m.flight_sw_version
        kinds = {0: "dev", 64: "alpha", 128: "beta", 192: "rc", 255: "release"}
        release = kinds.get(number & 0xFF, "")
        version = f"{number >> 24}.{number >> 16 & 0xFF}.{number >> 8 & 0xFF} {release}".strip()
        self._log.facts["firmware"] = f"{version}, vendor {m.vendor_id:04x}, product {m.product_id:04x}"

    def _sent(self, m: Any) -> None:
        if not m.type_mask & _TARGET_IGNORES_POSITION and m.coordinate_frame == mav.MAV_FRAME_LOCAL_NED:
            self._row("sent", m.time_boot_ms * 1e-3, m.x, m.y, m.z)


def _yxz_deg(w: float, x: float, y: float, z: float) -> tuple[float, ...]:
    """The paper's angles of an attitude as MAVLink shows it."""
    return tuple(math.degrees(a) for a in quaternion_to_yxz(*body_quaternion(w, x, y, z)))


_HANDLERS = {
    "HEARTBEAT": _Reader._heartbeat,
    "EXTENDED_SYS_STATE": _Reader._landed,
    "STATUSTEXT": _Reader._text,
    "LOCAL_POSITION_NED": _Reader._position,
    "POSITION_TARGET_LOCAL_NED": _Reader._target,
    "DEBUG_VECT": _Reader._debug,
    "ATTITUDE_QUATERNION": _Reader._attitude,
    "ATTITUDE_TARGET": _Reader._attitude_target,
    "WIND_COV": _Reader._wind,
    "SYS_STATUS": _Reader._battery,
    "MISSION_ITEM_REACHED": _Reader._item_reached,
    "COMMAND_ACK": _Reader._ack,
    "PARAM_VALUE": _Reader._parameter,
    "AUTOPILOT_VERSION": _Reader._version,
}
