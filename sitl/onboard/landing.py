"""Coming down: descend, slow near the ground, go on until the feet touch."""

from sitl.onboard.calm import FOREVER, Wait
from sitl.onboard.guide import Fix, Guide
from sitl.onboard.parameters import Parameters

SLOW_BELOW_M = 1.5
_THROUGH_M = 1.0  # the reference goes on below the ground, so that contact does not depend on the height estimate


class Landing:
    """A landing in two stages; `tick` until the vehicle stands."""

    def __init__(self, parameters: Parameters, guide: Guide) -> None:
        self._p, self._guide = parameters, guide
        self._stage = 0

    def start(self, fix: Fix) -> None:
        self._stage = 0
        if fix.nav.down_m < -SLOW_BELOW_M - 0.2:
            self._guide.sink(fix, self._p["MPC_Z_V_AUTO_DN"], -SLOW_BELOW_M)
        else:
            self._slow(fix)

    def _slow(self, fix: Fix) -> None:
        self._stage = 1
        self._guide.sink(fix, self._p["MPC_LAND_SPEED"], _THROUGH_M)

    def tick(self, fix: Fix) -> None:
        if self._stage == 0 and self._guide.done(fix):
            self._slow(fix)

    def waits(self) -> Wait:
        """For the slow part, then for the ground alone."""
        return Wait(self._guide.done_s) if self._stage == 0 else FOREVER
