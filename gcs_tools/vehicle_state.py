"""What a vehicle has told of itself, as far as the tools look at it."""

import math
import re
from collections import deque
from typing import Any, NamedTuple

from gcs_tools.clock import VehicleClock
from gcs_tools.parameter import Parameter, is_hash
from gcs_tools.reference import Vector
from sitl.mavlink.codec import mav

# Modes by name and their custom_mode, main << 16 | sub << 24 as PX4 numbers them.
MODES = {
    "position": 3 << 16,
    "takeoff": 4 << 16 | 2 << 24,
    "hold": 4 << 16 | 3 << 24,
    "mission": 4 << 16 | 4 << 24,
    "return": 4 << 16 | 5 << 24,
    "land": 4 << 16 | 6 << 24,
    "offboard": 6 << 16,
}
MODE_NAMES = {number: name for name, number in MODES.items()}
LANDED = {1: "on the ground", 2: "in the air", 3: "taking off", 4: "landing"}  # MAV_LANDED_STATE that is told
SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
_UNKNOWN_U16 = 0xFFFF
_TEXT_PIECE = 50  # a STATUSTEXT of this length goes on in the next
_ON_CONNECT = re.compile(r"SITL.*'([^']+)'")


class Text(NamedTuple):
    wall_s: float
    severity: int
    text: str

    @property
    def introduces(self) -> bool:
        """Whether the vehicle tells who it is, as it does to whom it doesn't know (any more)."""
        return _ON_CONNECT.search(self.text) is not None


class VehicleState:
    """The newest of everything heard. Each method named after a message takes that message in."""

    def __init__(self) -> None:
        self.clock = VehicleClock()
        self.heard_s: float | None = None  # when the last frame came (the caller's clock)
        self.status = 0  # MAV_STATE
        self.armed = False
        self.mode: str | None = None
        self.ready: bool | None = None  # pre-arm checks passed; None: not told
        self.unhealthy: list[str] = []  # sensors and the like that are in use and not well
        self.landed = 0  # MAV_LANDED_STATE
        self.position_m: Vector | None = None  # north, east, down of the vehicle's origin
        self.velocity_m_s: Vector = (0.0, 0.0, 0.0)
        self.reference_m: Vector | None = None  # where it is to be now
        self.angles_deg: Vector | None = None  # the paper's φ, θ, ψ
        self.thrust_N: float | None = None
        self.thrusts_N: tuple[float, float] | None = None  # left, right
        self.flaps_deg: tuple[float, float] | None = None  # left, right
        self.battery = -1  # percent
        self.battery_V: float | None = None
        self.battery_A: float | None = None
        self.home: tuple[float, float, float] | None = None  # degrees, degrees, metres AMSL
        self.mission_state = 0  # MISSION_STATE
        self.mission_item: int | None = None
        self.mission_total: int | None = None  # items; None: not told, or no mission
        self.parameters: dict[str, Parameter] = {}  # whoever asked for them, or changed them
        self.texts: deque[Text] = deque(maxlen=200)
        self._pieces: dict[int, list[str]] = {}

    def heartbeat(self, m: Any, wall_s: float) -> None:
        self.status = m.system_status
        self.armed = bool(m.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED)
        self.mode = MODE_NAMES.get(m.custom_mode, f"mode {m.custom_mode}")

    def local_position_ned(self, m: Any, wall_s: float) -> None:
        self.clock.hear(m.time_boot_ms * 1e-3, wall_s)
        self.position_m = (m.x, m.y, m.z)
        self.velocity_m_s = (m.vx, m.vy, m.vz)

    def position_target_local_ned(self, m: Any, wall_s: float) -> None:
        self.reference_m = (m.x, m.y, m.z) if math.isfinite(m.x + m.y + m.z) else None

    def system_time(self, m: Any, wall_s: float) -> None:
        self.clock.hear(m.time_boot_ms * 1e-3, wall_s)

    def sys_status(self, m: Any, wall_s: float) -> None:
        if m.onboard_control_sensors_present & mav.MAV_SYS_STATUS_PREARM_CHECK:
            self.ready = bool(m.onboard_control_sensors_health & mav.MAV_SYS_STATUS_PREARM_CHECK)
        enabled = m.onboard_control_sensors_enabled & ~mav.MAV_SYS_STATUS_PREARM_CHECK
        self.unhealthy = _parts(enabled & ~m.onboard_control_sensors_health)
        self.battery = m.battery_remaining
        self.battery_V = m.voltage_battery * 1e-3 if m.voltage_battery != _UNKNOWN_U16 else None
        self.battery_A = m.current_battery * 1e-2 if m.current_battery != -1 else None

    def extended_sys_state(self, m: Any, wall_s: float) -> None:
        self.landed = m.landed_state

    def debug_vect(self, m: Any, wall_s: float) -> None:
        if m.name == "YXZ_DEG":
            self.angles_deg = (m.x, m.y, m.z)
        elif m.name == "THRUST_N":
            self.thrust_N, self.thrusts_N = m.z, (m.x, m.y)
        elif m.name == "FLAP_DEG":
            self.flaps_deg = (m.x, m.y)

    def home_position(self, m: Any, wall_s: float) -> None:
        self.home = (m.latitude * 1e-7, m.longitude * 1e-7, m.altitude * 1e-3)

    def mission_current(self, m: Any, wall_s: float) -> None:
        self.mission_state, self.mission_item = m.mission_state, m.seq
        self.mission_total = m.total if 0 < m.total < _UNKNOWN_U16 else None

    def param_value(self, m: Any, wall_s: float) -> None:
        if not is_hash(m):
            self.parameters[m.param_id] = Parameter.of(m)

    def statustext(self, m: Any, wall_s: float) -> None:
        """Whole texts at once, those in pieces when the last piece has come."""
        if m.id == 0:
            self.texts.append(Text(wall_s, m.severity, m.text))
            return
        if m.chunk_seq == 0:
            self._pieces = {m.id: []}
        pieces = self._pieces.get(m.id)
        if pieces is None:
            return
        pieces.append(m.text)
        if len(m.text.encode()) < _TEXT_PIECE:
            self.texts.append(Text(wall_s, m.severity, "".join(pieces)))
            del self._pieces[m.id]

    def reasons_since(self, wall_s: float) -> str:
        """What the vehicle has complained of since then, to put behind a refusal."""
        told = [t.text for t in self.texts if t.wall_s >= wall_s and t.severity <= mav.MAV_SEVERITY_WARNING]
        return "; ".join(dict.fromkeys(told))

    @property
    def name(self) -> str | None:
        """The vehicle's name where a text on connecting has told it."""
        for t in self.texts:
            found = _ON_CONNECT.search(t.text)
            if found:
                return found[1]
        return None


def _parts(flags: int) -> list[str]:
    """Names of MAV_SYS_STATUS_SENSOR flags."""
    named = ((bit, entry.name) for bit, entry in mav.enums["MAV_SYS_STATUS_SENSOR"].items() if flags & bit)
    return [_PREFIX.sub("", name).lower().replace("_", " ") for _, name in sorted(named)]


_PREFIX = re.compile("MAV_SYS_STATUS_(SENSOR_)?")

HANDLERS = {
    "HEARTBEAT": VehicleState.heartbeat,
    "LOCAL_POSITION_NED": VehicleState.local_position_ned,
    "POSITION_TARGET_LOCAL_NED": VehicleState.position_target_local_ned,
    "SYSTEM_TIME": VehicleState.system_time,
    "SYS_STATUS": VehicleState.sys_status,
    "EXTENDED_SYS_STATE": VehicleState.extended_sys_state,
    "DEBUG_VECT": VehicleState.debug_vect,
    "HOME_POSITION": VehicleState.home_position,
    "MISSION_CURRENT": VehicleState.mission_current,
    "PARAM_VALUE": VehicleState.param_value,
    "STATUSTEXT": VehicleState.statustext,
}
