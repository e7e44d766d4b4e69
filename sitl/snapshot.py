"""The vehicle at one instant: everything that links and telemetry may show."""

from typing import NamedTuple

from sitl.control.cascade import Command
from sitl.control.reference import Reference
from sitl.geodesy import GeoPoint
from sitl.model.rigid_body import State
from sitl.navigation import NavState
from sitl.onboard.geofence import Breach
from sitl.onboard.guided import Orbiting
from sitl.onboard.mission import MissionState
from sitl.onboard.modes import Landed, Mode


class Battery(NamedTuple):
    voltage_V: float
    current_A: float
    remaining: float  # 1 full, 0 empty
    used_mAh: float


class Snapshot(NamedTuple):
    """SI and radians; immutable. `nav` is what the vehicle believes and MAVLink shows; `truth` is the plant's state."""

    now_us: int
    truth: State
    nav: NavState
    acceleration_B: tuple[float, float, float]  # specific force at the CM, as an accelerometer reads it [m/s2]
    acceleration_N: tuple[float, float, float]  # kinematic [m/s2]
    wind_N: tuple[float, float, float]  # air's motion at the vehicle [m/s]
    reference: Reference
    command: Command
    feet_down: int  # how many of the landing gear's feet touch the ground
    mode: Mode
    armed: bool
    landed: Landed
    tipped_over: bool
    failsafe: str  # empty, or which one is active
    ready_to_arm: bool
    origin: GeoPoint  # of world N
    home: GeoPoint
    home_N: tuple[float, float, float]
    home_heading_rad: float
    mission_state: MissionState
    mission_current: int
    mission_total: int
    plan_id: int  # of the mission
    battery: Battery
    fence_id: int = 0
    rally_id: int = 0
    breach: Breach = Breach()
    fenced: bool = False  # there is a fence to keep to
    orbiting: Orbiting | None = None
    nav_accuracy_m: tuple[float, float] = (0.0, 0.0)  # of level position and height, by the filter's own deviations
    gnss_heard: bool = True  # the satellite receiver gives fixes
