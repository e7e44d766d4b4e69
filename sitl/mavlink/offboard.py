"""Targets from the wire to the vehicle's own frame (positions and their derivatives, attitudes), and the sticks.

Frames of SET_POSITION_TARGET_LOCAL_NED: 1 LOCAL_NED; 7 LOCAL_OFFSET_NED, position from where the vehicle is;
8 BODY_NED, position as in 1, velocity and acceleration along and across the heading; 9 BODY_OFFSET_NED and
12 BODY_FRD, all along and across the heading and position from where the vehicle is. Body frames are level: they turn
with the heading only.
Yaw is from north in every frame. SET_POSITION_TARGET_GLOBAL_INT: 5 above sea level, 6 above home, 11 above the terrain,
which is flat and at home's altitude; 0, 3, 10 are other names for them.

An axis is ignored if its bit of type_mask says so or its value is NaN. Of a level pair in a body frame, or of latitude
and longitude, one alone can't be ignored: both are.
"""

import math
from typing import TYPE_CHECKING, Any

from sitl.frames import body_quaternion, body_rates
from sitl.geodesy import to_local
from sitl.mavlink.codec import Frame, mav
from sitl.mavlink.wire import INT16_UNSET, INT32_UNSET, NAN, boot_time_us
from sitl.onboard.modes import Outcome
from sitl.onboard.offboard import AttitudeTarget, OffboardTarget
from sitl.quaternion import Vec3

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

ACCELERATION_IGNORE, FORCE_SET, YAW_IGNORE, YAW_RATE_IGNORE = 0x1C0, 0x200, 0x400, 0x800
THRUST_BODY_SET, THROTTLE_IGNORE, ATTITUDE_IGNORE = 0x20, 0x40, 0x80

_OFFSET_FRAMES = (mav.MAV_FRAME_LOCAL_OFFSET_NED, mav.MAV_FRAME_BODY_OFFSET_NED, mav.MAV_FRAME_BODY_FRD)
_BODY_FRAMES = (mav.MAV_FRAME_BODY_NED, mav.MAV_FRAME_BODY_OFFSET_NED, mav.MAV_FRAME_BODY_FRD)
_LOCAL_FRAMES = (mav.MAV_FRAME_LOCAL_NED, *_OFFSET_FRAMES, mav.MAV_FRAME_BODY_NED)
AMSL_FRAMES = (mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_INT)
RELATIVE_FRAMES = (
    mav.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    mav.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    mav.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)


class OffboardService:
    """Takes targets and sticks; what it refuses it says, but not at the rate of the stream."""

    def __init__(self, link: "Link") -> None:
        self._link = link

    def on_local(self, peer: "Peer", frame: Frame) -> None:
        m = frame.message
        mask = m.type_mask
        if m.coordinate_frame not in _LOCAL_FRAMES:
            self._link.complain(peer, f"Position target refused: frame {m.coordinate_frame} is not supported")
            return
        position = _masked(m.x, m.y, m.z, mask)
        if m.coordinate_frame == mav.MAV_FRAME_LOCAL_NED:
            self._submit(peer, m, position, _masked(m.vx, m.vy, m.vz, mask >> 3))
            return
        snapshot = self._link.vehicle.snapshot()
        body = m.coordinate_frame in _BODY_FRAMES
        yaw = self._link.view().attitude.yaw if body else 0.0
        if m.coordinate_frame in _OFFSET_FRAMES:
            n, e, d = _turned(position, yaw)
            nav = snapshot.nav
            position = (nav.north_m + n, nav.east_m + e, nav.down_m + d)
        self._submit(peer, m, position, _turned(_masked(m.vx, m.vy, m.vz, mask >> 3), yaw), yaw)

    def on_global(self, peer: "Peer", frame: Frame) -> None:
        m = frame.message
        if m.coordinate_frame not in AMSL_FRAMES and m.coordinate_frame not in RELATIVE_FRAMES:
            self._link.complain(peer, f"Position target refused: frame {m.coordinate_frame} is not supported")
            return
        commander = self._link.vehicle.commander
        origin = commander.origin
        north, east = NAN, NAN
        if not m.type_mask & 3 and INT32_UNSET not in (m.lat_int, m.lon_int):
            if abs(m.lat_int) > 900_000_000 or abs(m.lon_int) > 1_800_000_000:
                self._link.complain(peer, "Position target refused: no such latitude and longitude")
                return
            north, east = to_local(origin, m.lat_int * 1e-7, m.lon_int * 1e-7)
        ground = 0.0 if m.coordinate_frame in AMSL_FRAMES else commander.home.alt_amsl_m
        down = origin.alt_amsl_m - ground - m.alt if not m.type_mask & 4 else NAN
        self._submit(peer, m, (north, east, down), _masked(m.vx, m.vy, m.vz, m.type_mask >> 3))

    def _submit(self, peer: "Peer", m: Any, position: Vec3, velocity: Vec3, yaw: float = 0.0) -> None:
        mask = m.type_mask
        if mask & FORCE_SET and mask & ACCELERATION_IGNORE != ACCELERATION_IGNORE:  # else it qualifies nothing
            self._link.complain(peer, "Position target refused: forces are not supported, only accelerations")
            return
        now_us = self._link.vehicle.now_us
        target = OffboardTarget(
            stamp_us=boot_time_us(m.time_boot_ms, now_us) if m.time_boot_ms else None,
            position_N=position,
            velocity_N=velocity,
            acceleration_N=_turned(_masked(m.afx, m.afy, m.afz, mask >> 6), yaw),
            heading_rad=NAN if mask & YAW_IGNORE else m.yaw,
            heading_rate_rad_s=NAN if mask & YAW_RATE_IGNORE else m.yaw_rate,
        )
        outcome: Outcome = self._link.vehicle.offboard.submit(target, now_us)
        if not outcome.ok:
            self._link.complain(peer, outcome.reason)

    def on_manual_control(self, peer: "Peer", frame: Frame) -> None:
        """Sticks for Position mode. z is the throttle, 0 … 1000 with 500 in the middle, as PX4 reads it."""
        m = frame.message
        x, y, r = (_stick(v) for v in (m.x, m.y, m.r))
        z = _stick(2 * m.z - 1000) if m.z != INT16_UNSET else 0.0
        self._link.vehicle.commander.manual(x, y, z, r)

    def on_attitude_target(self, peer: "Peer", frame: Frame) -> None:
        """Attitude and thrust, or body rates and thrust, in the multicopter frame; NaN and the mask both ignore."""
        m = frame.message
        mask = m.type_mask
        roll, pitch, yaw = _masked(m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate, mask)
        attitude = None if mask & ATTITUDE_IGNORE or any(map(math.isnan, m.q)) else body_quaternion(*m.q)
        if attitude is None and any(map(math.isnan, (roll, pitch, yaw))):
            self._link.complain(peer, "Attitude target refused: without attitude it takes all three body rates")
        elif mask & THROTTLE_IGNORE or math.isnan(m.thrust):
            self._link.complain(peer, "Attitude target refused: it takes a thrust")
        elif mask & THRUST_BODY_SET:
            self._link.complain(peer, "Attitude target refused: thrust is along the nose only")
        else:
            roll, pitch, yaw = (0.0 if math.isnan(rate) else rate for rate in (roll, pitch, yaw))
            target = AttitudeTarget(attitude, body_rates(roll, pitch, yaw), m.thrust)
            outcome = self._link.vehicle.offboard.submit_attitude(target, self._link.vehicle.now_us)
            if not outcome.ok:
                self._link.complain(peer, outcome.reason)


def _masked(x: float, y: float, z: float, mask: int) -> Vec3:
    return (NAN if mask & 1 else x, NAN if mask & 2 else y, NAN if mask & 4 else z)


def _turned(v: Vec3, yaw: float) -> Vec3:
    """A level body frame's vector in N."""
    if yaw == 0.0:
        return v
    c, s = math.cos(yaw), math.sin(yaw)
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


def _stick(value: int) -> float:
    return max(-1.0, min(1.0, value / 1000.0)) if value != INT16_UNSET else 0.0
