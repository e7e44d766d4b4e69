"""Offboard flight: the newest target in force, and a halt where the next one stays away."""

from sitl.control.guidance import Steering
from sitl.control.reference import Trajectory
from sitl.onboard.calm import Wait
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
        self._ahead: Trajectory | None = None  # of foreseen targets

    def start(self) -> None:
        self._seen, self._halting, self.lifting, self._ahead = -1, False, None, None
        self._offboard.enter()

    def tick(self, fix: Fix) -> None:
        offboard, guide = self._offboard, self._guide
        if offboard.foreseen is not None:
            self._seen, self._halting, self.lifting = offboard.number, False, None
            # a vehicle that stands has the heading that it stands at, if the targets tell none
            if guide.trajectory is not self._ahead or (guide.standing and not offboard.foreseen.headed):
                self._ahead = offboard.foreseen.trajectory(guide.motion(fix).heading_rad)
                guide.put(self._ahead)
            return
        if offboard.number != self._seen:
            self._seen, self._halting = offboard.number, False
            if offboard.attitude is not None:
                self._steer(fix, offboard.attitude)
                return
            self.lifting = None
            heading_rad, position_N = 0.0, fix.position_N
            if not offboard.places:
                start = guide.motion(fix)
                heading_rad, position_N = start.heading_rad, start.position_N
            guide.put(offboard.trajectory(fix.now_us, heading_rad, position_N), offboard.follow())
        elif offboard.moving and not self._halting and fix.t_s >= guide.trajectory.end_s - _STOP_AHEAD_S:
            self._halting = True
            guide.stop(fix)

    def waits(self) -> Wait | None:
        """For nothing as long as the targets are foreseen."""
        foreseen = self._offboard.foreseen
        if foreseen is None or self._guide.trajectory is not self._ahead:
            return None
        return Wait(foreseen.until_s)

    def _steer(self, fix: Fix, target: AttitudeTarget) -> None:
        thrust = target.thrust * self._offboard.thrust_full_N
        lifts = self._offboard.thrust_hover_N
        if thrust > lifts:
            self.lifting = True
        elif thrust < _SINK_SHARE * lifts or self.lifting is None:
            self.lifting = False
        steered, q = (2.0, (1.0, 0.0, 0.0, 0.0)) if target.q_NB is None else (1.0, target.q_NB)
        self._guide.steer(fix, Steering(steered, *q, *target.rates_B, thrust))
