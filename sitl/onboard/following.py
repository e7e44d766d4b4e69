"""Offboard flight: the newest target in force, and a halt where the next one stays away."""

from sitl.control.guidance import Steering
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.offboard import AttitudeTarget, Offboard

_STOP_AHEAD_S = 0.021  # a halt begins at the last tick before the target's trajectory ends
_SINK_SHARE = 0.7  # of the thrust that lifts: less than this means to stand, where the feet are down


class Following:
    """Puts the targets of `offboard` in force with `guide`.

    lifting: of targets with a thrust, whether it lifts the vehicle; None for the others.
    """

    def __init__(self, offboard: Offboard, guide: Guide) -> None:
        self._offboard, self._guide = offboard, guide
        self._seen = -1  # number of the target in force
        self._halting = False
        self.lifting: bool | None = None

    def start(self) -> None:
        self._seen, self._halting, self.lifting = -1, False, None
        self._offboard.enter()

    def tick(self, fix: Fix) -> None:
        offboard, guide = self._offboard, self._guide
        if offboard.number != self._seen:
            self._seen, self._halting = offboard.number, False
            if offboard.attitude is not None:
                self._steer(fix, offboard.attitude)
                return
            self.lifting = None
            start = guide.motion(fix)
            guide.put(offboard.trajectory(fix.now_us, start.heading_rad, start.position_N), offboard.follow())
        elif offboard.moving and not self._halting and fix.t_s >= guide.trajectory.end_s - _STOP_AHEAD_S:
            self._halting = True
            guide.stop(fix)

    def _steer(self, fix: Fix, target: AttitudeTarget) -> None:
        thrust = target.thrust * self._offboard.thrust_full_N
        lifts = self._offboard.thrust_hover_N
        if thrust > lifts:
            self.lifting = True
        elif thrust < _SINK_SHARE * lifts or self.lifting is None:
            self.lifting = False
        steered, q = (2.0, (1.0, 0.0, 0.0, 0.0)) if target.q_NB is None else (1.0, target.q_NB)
        self._guide.steer(fix, Steering(steered, *q, *target.rates_B, thrust))
