"""Offboard flight: the newest target in force, and a halt where the next one stays away."""

from sitl.onboard.guide import Fix, Guide
from sitl.onboard.offboard import Offboard

_STOP_AHEAD_S = 0.021  # a halt begins at the last tick before the target's trajectory ends


class Following:
    """Puts the targets of `offboard` in force with `guide`."""

    def __init__(self, offboard: Offboard, guide: Guide) -> None:
        self._offboard, self._guide = offboard, guide
        self._seen = -1  # number of the target in force
        self._halting = False

    def start(self) -> None:
        self._seen, self._halting = -1, False
        self._offboard.enter()

    def tick(self, fix: Fix) -> None:
        offboard, guide = self._offboard, self._guide
        if offboard.number != self._seen:
            self._seen, self._halting = offboard.number, False
            start = guide.motion(fix)
            guide.put(offboard.trajectory(fix.now_us, start.heading_rad, start.position_N), offboard.follow())
        elif offboard.moving and not self._halting and fix.t_s >= guide.trajectory.end_s - _STOP_AHEAD_S:
            self._halting = True
            guide.stop(fix)
