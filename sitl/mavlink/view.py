"""One snapshot as the wire shows it: what several messages need is worked out once, and only if one is due."""

import math
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from sitl.frames import quaternion_to_yxz
from sitl.geodesy import to_global
from sitl.mavlink.attitude import WireAttitude, body_vector_on_wire, wire_attitude
from sitl.model.airframe import Airframe
from sitl.model.rigid_body import State
from sitl.navigation import NavState
from sitl.quaternion import Quat, Vec3, rotate_back

if TYPE_CHECKING:
    from sitl.snapshot import Snapshot

# International Standard Atmosphere below 11 km
_PRESSURE_HPA, _TEMPERATURE_K, _LAPSE_K_M, _EXPONENT = 1013.25, 288.15, 0.0065, 5.25588
# the magnetic field of middle northern latitudes, without declination [gauss, NED]
_FIELD_N: Vec3 = (0.2, 0.0, 0.45)


class Craft(NamedTuple):
    """What scales the actuator messages."""

    thrust_max_N: float  # of one motor
    flap_max_rad: float
    air_density_kg_m3: float

    @classmethod
    def of(cls, airframe: Airframe) -> "Craft":
        return cls(airframe.thrust_max_N, airframe.flap_max_rad, airframe.air_density_kg_m3)


class View:
    """A snapshot and what follows from it. `payloads` keeps, by stream, what was already packed from it."""

    def __init__(self, snapshot: "Snapshot", craft: Craft) -> None:
        self.s = snapshot
        self.craft = craft
        self.boot_ms = snapshot.now_us // 1000 & 0xFFFFFFFF
        self.payloads: dict[int, bytes] = {}

    @cached_property
    def attitude(self) -> WireAttitude:
        return wire_attitude(self.s.nav)

    @cached_property
    def true_attitude(self) -> WireAttitude:
        return wire_attitude(self.s.truth)

    @cached_property
    def place(self) -> tuple[float, float]:
        """Latitude and longitude [deg]."""
        return to_global(self.s.origin, self.s.nav.north_m, self.s.nav.east_m)

    @cached_property
    def true_place(self) -> tuple[float, float]:
        return to_global(self.s.origin, self.s.truth.north_m, self.s.truth.east_m)

    @cached_property
    def paper_angles(self) -> Vec3:
        """The paper's φ, θ, ψ [rad]."""
        nav = self.s.nav
        return quaternion_to_yxz(nav.qw, nav.qx, nav.qy, nav.qz)

    @property
    def true_alt_amsl_m(self) -> float:
        return self.s.origin.alt_amsl_m - self.s.truth.down_m

    @property
    def alt_amsl_m(self) -> float:
        return self.s.origin.alt_amsl_m - self.s.nav.down_m

    @property
    def alt_above_home_m(self) -> float:
        return self.alt_amsl_m - self.s.home.alt_amsl_m

    @property
    def groundspeed_m_s(self) -> float:
        return math.hypot(self.s.nav.v_north_m_s, self.s.nav.v_east_m_s)

    @property
    def airspeed_m_s(self) -> float:
        return self._speed_through_air(self.s.nav)

    @property
    def true_airspeed_m_s(self) -> float:
        return self._speed_through_air(self.s.truth)

    def _speed_through_air(self, x: NavState | State) -> float:
        wind = self.s.wind_N
        return math.hypot(x.v_north_m_s - wind[0], x.v_east_m_s - wind[1], x.v_down_m_s - wind[2])

    @cached_property
    def motors(self) -> tuple[float, float]:
        """Left and right thrust command as a share of the largest."""
        c, largest = self.s.command, self.craft.thrust_max_N
        return c.thrust_left_N / largest, c.thrust_right_N / largest

    @cached_property
    def flaps(self) -> tuple[float, float]:
        """Left and right flap command as a share of the largest deflection, −1 … 1."""
        c, largest = self.s.command, self.craft.flap_max_rad
        return c.flap_left_rad / largest, c.flap_right_rad / largest

    @property
    def throttle(self) -> float:
        """Mean of both motors' thrust command, 0 … 1."""
        return 0.5 * (self.motors[0] + self.motors[1])

    @property
    def target_q(self) -> Quat:
        c = self.s.command
        return c.qw, c.qx, c.qy, c.qz

    @property
    def specific_force(self) -> Vec3:
        """What the accelerometer reads [m/s²], in the multicopter frame."""
        return body_vector_on_wire(self.s.acceleration_B)

    @property
    def magnetic_field(self) -> Vec3:
        """What a magnetometer would read [gauss], in the multicopter frame."""
        return rotate_back(self.attitude.q, _FIELD_N)

    @property
    def temperature_C(self) -> float:
        """Of the standard atmosphere at this altitude."""
        return _TEMPERATURE_K - 273.15 - _LAPSE_K_M * self.alt_amsl_m

    @property
    def pressure_hPa(self) -> float:
        """Of the standard atmosphere at this altitude."""
        base = max(0.0, 1.0 - _LAPSE_K_M * self.alt_amsl_m / _TEMPERATURE_K)
        return float(_PRESSURE_HPA * base**_EXPONENT)

    @property
    def dynamic_pressure_hPa(self) -> float:
        return 0.005 * self.craft.air_density_kg_m3 * self.airspeed_m_s**2

    @property
    def nav_is_finite(self) -> bool:
        return all(map(math.isfinite, self.s.nav))
