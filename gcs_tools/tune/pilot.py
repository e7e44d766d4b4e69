"""Flying for an experiment: up to a place in Offboard mode, at rest there, back to it, and down; targets all the while.

Each method that takes time is a script of the Client (gcs_tools/client.py).
"""

import math
from collections.abc import Callable
from contextlib import closing
from typing import Any

from gcs_tools.client import Client, LinkError, Script
from gcs_tools.clock import Metronome
from gcs_tools.flight import ARMING_PATIENCE_S, LANDING_S, STREAM_S, WARM_UP_S
from gcs_tools.reference import TimedPoint, Vector, Waypoints
from gcs_tools.tune import targets
from sitl.frames import body_quaternion
from sitl.mavlink.codec import mav
from sitl.quaternion import Quat

ATTITUDE = "ATTITUDE_QUATERNION"
FAR_M = 5.0  # from its place, beyond which a set of gains has lost the vehicle
_TUMBLING_DEG = 75.0  # between the nose and straight up
_LEAST_HEIGHT_M = 1.0  # above the origin, below which an excitation may not lead
_CLIMB_M_S, _BACK_M_S, _LEAST_WAY_S = 1.5, 1.0, 2.0
_PEAK = 1.9  # of a smooth way's speed over its mean
_REST_M, _REST_M_S, _REST_S, _REST_PATIENCE_S = 0.3, 0.3, 1.0, 15.0
_BACK_PATIENCE_S = 30.0
_UPRIGHT: Quat = body_quaternion(1.0, 0.0, 0.0, 0.0)


class LostError(Exception):
    """A set of gains doesn't hold the vehicle; the message says how that showed."""


class Pilot:
    """Sends targets through `client`: what `target` makes of a stamp [ms] is what is flown. place_m: where to rest."""

    def __init__(self, client: Client, note: Callable[[str], None]) -> None:
        self.client, self._note = client, note
        self.place_m: Vector = (0.0, 0.0, 0.0)
        self.q: Quat | None = None  # the newest attitude heard, q_NB
        self.target: Callable[[int], Any] | None = None
        self.took_off = False
        self._metronome = Metronome(client.vehicle.clock, STREAM_S)
        other = client.on.get(ATTITUDE)

        def heard(m: Any) -> None:
            self.q = body_quaternion(m.q1, m.q2, m.q3, m.q4)
            if other is not None:
                other(m)

        client.on[ATTITUDE] = heard

    @property
    def now_s(self) -> float:
        """The vehicle's time."""
        return self.client.vehicle.clock.at(self.client.wall_s)

    @property
    def below_m(self) -> float:
        """How far it is below its place."""
        position = self.client.vehicle.position_m
        return position[2] - self.place_m[2] if position is not None else 0.0

    def go_up(self, height_m: float, descent_m: float) -> Script[None]:
        """Into Offboard mode: `height_m` up from the ground, or taken over where it hovers.

        descent_m: how far down the experiment leads from there. Raises LinkError where there is no room for it.
        """
        client, v = self.client, self.client.vehicle
        x = v.position_m
        assert x is not None
        flying = v.armed and v.landed == mav.MAV_LANDED_STATE_IN_AIR
        if v.armed and not flying:
            raise LinkError("the vehicle is armed on the ground; an experiment starts disarmed, or from a hover")
        self.place_m = x if flying else (x[0], x[1], x[2] - height_m)
        left_m = -self.place_m[2] - descent_m
        if left_m < _LEAST_HEIGHT_M:
            raise LinkError(f"it would come down to {left_m:.1f} m: begin higher, or step up (a negative size)")
        self.stay(x)
        client.background = self._stream
        began_s = self.now_s
        yield from client.wait(lambda: self.now_s - began_s > WARM_UP_S, 60.0, "the vehicle's clock stands still")
        yield from client.set_mode("offboard", patience_s=3.0)
        if not flying:
            yield from client.arm(ARMING_PATIENCE_S)
            self.took_off = True
            self._note("armed")
        try:
            yield from self._way_to_place(_CLIMB_M_S)
            yield from self.rest()
        except LostError as lost:
            raise LinkError(f"the vehicle's own gains don't hold it: {lost}") from None

    def ours(self) -> None:
        """Raises LinkError where the vehicle no longer flies what it is told to."""
        v = self.client.vehicle
        if not v.armed or v.mode != "offboard":
            became = "disarmed" if not v.armed else f"left Offboard mode for {v.mode}"
            reason = v.reasons_since(self.client.wall_s - 3.0)
            raise LinkError(f"the vehicle {became}{': ' + reason if reason else ''}")

    def held(self, reach_m: float = FAR_M) -> None:
        """Raises LostError where gains don't hold the vehicle upright and within reach of its place; as `ours`."""
        self.ours()
        v = self.client.vehicle
        assert v.position_m is not None
        assert self.q is not None
        away_m = math.dist(v.position_m, self.place_m)
        if not away_m < reach_m:
            raise LostError(f"it was {away_m:.1f} m from its place")
        if not targets.nose_between_deg(self.q, _UPRIGHT) < _TUMBLING_DEG:
            raise LostError("it tumbled")

    def guarded(self, script: Script[Any]) -> Script[Any]:
        """Another script, for as long as the vehicle is ours."""
        with closing(script):
            for value in script:
                yield value
                self.ours()

    def rest(self) -> Script[None]:
        """Until the vehicle has been at rest at its place for a while. Raises LostError."""
        v = self.client.vehicle
        self.stay(self.place_m)
        since_s = self.now_s
        give_up_s = since_s + _REST_PATIENCE_S
        while self.now_s < since_s + _REST_S:
            self.held()
            assert v.position_m is not None
            if math.dist(v.position_m, self.place_m) > _REST_M or math.hypot(*v.velocity_m_s) > _REST_M_S:
                since_s = self.now_s
            if self.now_s > give_up_s:
                raise LostError("it did not come to rest")
            yield math.inf

    def come_back(self) -> Script[None]:
        """Rest at the place again, from wherever gains have left it. Raises LinkError where that takes too long."""
        end_s = self.now_s + _BACK_PATIENCE_S
        while True:
            try:
                yield from self.rest()
                return
            except LostError as lost:
                if self.now_s > end_s:
                    raise LinkError(f"the vehicle doesn't come back: {lost}") from None
                yield math.inf

    def return_to_place(self) -> Script[None]:
        yield from self._way_to_place(_BACK_M_S)

    def _way_to_place(self, speed_m_s: float) -> Script[None]:
        """Along a smooth way, from wherever the vehicle is."""
        client = self.client
        x = client.vehicle.position_m
        assert x is not None
        began_s = self.now_s
        took_s = max(_LEAST_WAY_S, _PEAK * math.dist(x, self.place_m) / speed_m_s)
        path = Waypoints([TimedPoint(began_s, x), TimedPoint(began_s + took_s, self.place_m)])
        self.target = lambda ms: targets.along(client, ms, path.at(ms * 1e-3))
        while self.now_s < began_s + took_s:
            self.held(math.inf)
            yield math.inf

    def stay(self, at_m: Vector) -> None:
        point = Waypoints([TimedPoint(0.0, at_m)]).at(0.0)
        self.target = lambda ms: targets.along(self.client, ms, point)

    def finish(self) -> Script[None]:
        """Down again, or left in Hold if it hovered before."""
        client, v = self.client, self.client.vehicle
        yield from self.let_go()
        client.background = None
        if not self.took_off:
            return
        began_s = self.now_s
        while v.armed:
            if self.now_s - began_s > LANDING_S:
                raise LinkError("the vehicle landed no sooner than it was given up on")
            yield math.inf
        self._note("disarmed")

    def let_go(self) -> Script[None]:
        """Send it down, or to Hold if it hovered before."""
        if not self.client.vehicle.armed or self.target is None:
            return
        if self.took_off:
            self._note("landing")
            nan = math.nan
            yield from self.client.require("landing", mav.MAV_CMD_NAV_LAND, 0.0, 0.0, 0.0, nan, nan, nan, nan)
        else:
            yield from self.client.set_mode("hold")

    def _stream(self) -> float:
        """Send the target that is due; when the next one will be, on the caller's clock."""
        return self._metronome.beat(self.client.wall_s, self._send_target)

    def _send_target(self, now_s: float) -> None:
        if self.target is not None:
            self.client.send(self.target(round(now_s * 1000.0)))
