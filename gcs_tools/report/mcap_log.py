"""An .mcap of `sitl run --record` → a Log: messages of docs/telemetry.md, a set of them for each control step."""

import importlib.util
import json
import math
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from gcs_tools.mcap_reader import messages
from gcs_tools.report import mcap_messages
from gcs_tools.report.log import Event, Log, Status
from gcs_tools.vehicle_state import SEVERITIES
from sitl.frames import quaternion_to_yxz
from sitl.strict_yaml import ConfigError

_LANDED = {"on ground": "on the ground", "in air": "in the air"}
_EXACT_M = 1e-9  # apart at most: belief is truth
_SILENT = {"text", "mode", "armed", "landed", "item reached", "item current", "parameter"}  # kinds told otherwise


def read(path: Path, data: bytes, system: int | None) -> Log:
    """Raises ConfigError."""
    if importlib.util.find_spec("mcap") is None:
        raise ConfigError(f"{path}: reading .mcap needs the package mcap: pip install 'yawsitter-sitl[report]'")
    log = Log(path, ".mcap")
    taker = _Taker(log)
    foreign: set[str] = set()
    first_ns = last_ns = 0
    for key, instance, topic, log_ns, payload in messages(data, log.damage):
        take = _TAKERS.get(topic)
        if take is None or instance is None or (system is not None and instance + 1 != system):
            foreign.add(key)
            continue
        system = instance + 1
        first_ns, last_ns = first_ns or log_ns, max(last_ns, log_ns)
        try:
            take(taker, payload)
        except msgspec.DecodeError as error:
            taker.unreadable[topic] = str(error)
    if not first_ns:
        heard = f"; in it: {', '.join(sorted(foreign)[:5])}" if foreign else ""
        raise ConfigError(f"{path}: no record of a vehicle is in it (keys yawsitter/<instance>/…){heard}")
    log.damage += [f"{topic}: a message can't be read: {why}" for topic, why in taker.unreadable.items()]
    log.facts = {"system": str(system), **log.facts}
    log.unix_s = first_ns * 1e-9, last_ns * 1e-9
    taker.finish()
    return log


class _Taker:
    """Takes messages into a Log."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self._q: list[tuple[float | None, ...]] = []  # true and believed, by row
        self.unreadable: dict[str, str] = {}

    def state(self, data: bytes) -> None:
        m = mcap_messages.state(data)
        t, rows = m.now_us * 1e-6, self._log.rows
        self._log.true.positions.append((t, *m.position_N_m))
        self._log.reported.positions.append((t, *m.nav_position_N_m))
        rows["true_velocity"].append((t, *m.velocity_N_m_s))
        rows["velocity"].append((t, *m.nav_velocity_N_m_s))
        rows["wind"].append((t, *m.wind_N_m_s))

    def attitude(self, data: bytes) -> None:
        m = mcap_messages.attitude(data)
        t = m.now_us * 1e-6
        self._log.true.angles.append((t, m.phi_deg, m.theta_deg, m.psi_deg))
        self._q.append((t, *m.q_NB, *m.nav_q_NB))

    def setpoint(self, data: bytes) -> None:
        m = mcap_messages.setpoint(data)
        t, rows = m.now_us * 1e-6, self._log.rows
        self._log.reported.targets.append((t, *m.position_N_m))
        rows["reference_velocity"].append((t, *m.velocity_N_m_s))
        rows["angles_command"].append((t, m.phi_command_deg, m.theta_command_deg, m.psi_command_deg))

    def actuators(self, data: bytes) -> None:
        m = mcap_messages.actuators(data)
        t, left, right = m.now_us * 1e-6, m.thrust_left_command_N, m.thrust_right_command_N
        self._log.rows["thrust"].append((t, left, right))
        self._log.reported.thrust.append((t, None if left is None or right is None else left + right))
        self._log.reported.flaps.append((t, m.flap_left_deg, m.flap_right_deg))

    def mode(self, data: bytes) -> None:
        m = mcap_messages.mode(data)
        t = m.now_us * 1e-6
        self._log.note_status(Status(t, m.mode, m.armed, _LANDED.get(m.landed, m.landed)))
        share = None if m.battery_remaining is None else 100.0 * m.battery_remaining
        self._log.rows["battery"].append((t, m.battery_voltage_V, m.battery_current_A, share))
        if m.failsafe:
            self._log.events.append(Event(t, "failsafe", m.failsafe))
        speed = f"{m.speed_factor:g} × real time" if m.speed_factor else "as fast as possible"
        self._log.facts["pace"] = speed

    def event(self, data: bytes) -> None:
        m = mcap_messages.event(data)
        t = m.now_us * 1e-6
        if m.kind == "text":
            self._log.events.append(Event(t, SEVERITIES[m.severity & 7], m.text))
        elif m.kind == "item reached":
            self._log.reached.append((t, m.value))
            self._log.events.append(Event(t, "mission", f"item {m.value} reached"))
        elif m.kind not in _SILENT:
            self._log.events.append(Event(t, m.kind, m.text))

    def parameters(self, data: bytes) -> None:
        m = mcap_messages.parameters(data)
        t, log = m.now_us * 1e-6, self._log
        if not log.parameters:
            log.defaults = {p.name: p.default for p in m.parameters if p.default is not None}
        for p in m.parameters:
            told = log.parameters[p.name]
            if p.value is None or (told and told[-1][1] == p.value):
                continue
            if told:
                log.events.append(Event(t, "parameter", f"{p.name} = {p.value:g}"))
            told.append((t, p.value))

    def description(self, data: bytes) -> None:
        vehicle = json.loads(data)["vehicle"]
        self._log.vehicle = vehicle["name"]
        self._log.facts["gains"] = str(vehicle["gains"])
        self._log.facts["seed"] = str(vehicle["seed"])
        self._log.facts["control"] = f"{vehicle['control_rate_hz']} Hz"

    def finish(self) -> None:
        """The believed angles; the truth is dropped where it is all the vehicle believes."""
        log = self._log
        angles, q = log.true.angles, np.array(self._q, dtype=float).reshape(-1, 9)
        believed, true = (np.array(r.positions, dtype=float).reshape(-1, 4) for r in (log.reported, log.true))
        apart_m = np.nanmax(np.abs(believed - true), initial=0.0)
        if apart_m <= _EXACT_M:
            log.reported.angles, log.rows["angles"] = angles, list(angles)
            log.true = type(log.true)()
            del log.rows["true_velocity"]
            return
        log.rows["angles"] = [
            (t, *map(math.degrees, quaternion_to_yxz(*nav))) for t, *nav in q[:, (0, 5, 6, 7, 8)].tolist()
        ]
        log.reported.angles = list(log.rows["angles"])
        log.true.targets, log.true.thrust, log.true.flaps = (
            log.reported.targets,
            log.reported.thrust,
            log.reported.flaps,
        )
        between = np.abs(np.sum(q[:, 1:5] * q[:, 5:9], axis=1)).clip(0.0, 1.0)
        log.rows["turned"] = np.column_stack([q[:, 0], np.degrees(2.0 * np.arccos(between))]).tolist()


_TAKERS: dict[str, Callable[[_Taker, bytes], None]] = {
    "state": _Taker.state,
    "attitude": _Taker.attitude,
    "setpoint": _Taker.setpoint,
    "actuators": _Taker.actuators,
    "mode": _Taker.mode,
    "event": _Taker.event,
    "parameters": _Taker.parameters,
    "description": _Taker.description,
}
