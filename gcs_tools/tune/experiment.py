"""An experiment on one loop: everything a client does from the first heartbeat to the last landing.

A script of its Client, as a flight is (gcs_tools/flight.py): it climbs in Offboard mode (or takes over a vehicle that
hovers), and for every set of gains writes them, waits for rest, excites the loop, records, and goes back to its place.

    connecting → configuring → climbing → settling → exciting → … → restoring → landing → done

The vehicle's own gains are written back at once where a set can't hold it, and at the end. Where the script doesn't get
so far (Ctrl-C, a lost link), `leave` is the script that does it, on whatever link there is by then.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from gcs_tools import params
from gcs_tools.client import Client, LinkError, Script
from gcs_tools.flight import STREAM_S, UNWANTED
from gcs_tools.tune import recorder, targets
from gcs_tools.tune.loops import GAIN_NAMES, Excitation, Loop
from gcs_tools.tune.pilot import ATTITUDE, FAR_M, LostError, Pilot
from gcs_tools.tune.recorder import Recorder, Taken
from gcs_tools.undertaking import Undertaking
from sitl.frames import body_quaternion
from sitl.quaternion import Quat

HEIGHT_M = 10.0  # above where it stood, if the experiment has to take off
FULL_RATE_US = 1000  # the shortest interval between two messages of a stream
REACH_PATIENCE_S = 30.0  # for a vehicle that was lost to be heard again
_SLOW_US = {recorder.POSITION: 20_000, ATTITUDE: 20_000, recorder.ATTITUDE_TARGET: 20_000,
            "EXTENDED_SYS_STATE": 200_000, "SYS_STATUS": 500_000, "SYSTEM_TIME": 1_000_000}  # fmt: skip
_STEERED_FAR_M = 40.0  # from its place, while attitudes or rates are flown, which let it drift
_HOVER_S = 1.0  # of hover, over which attitude and thrust are learned


class GainSet(NamedTuple):
    """gains: values by parameter name, the others as they are; None: the vehicle's own."""

    name: str
    gains: Mapping[str, float] | None


class Trial(NamedTuple):
    """What a set of gains came to. gains: all 36 as they were in force. fault: why records are missing, or empty."""

    name: str
    gains: dict[str, float]
    records: list[Taken]
    fault: str


class Experiment(Undertaking):
    """Steps or doublets on one loop, one set of gains after the other; its time starts when the vehicle attends to it.

    full_rate_us: interval of the streams that are recorded. land: whether it ends on the ground, or just ends.
    """

    def __init__(
        self,
        client: Client,
        loop: Loop,
        excitation: Excitation,
        sets: Sequence[GainSet],
        *,
        repeat: int = 1,
        height_m: float = HEIGHT_M,
        full_rate_us: int = FULL_RATE_US,
        land: bool = True,
    ) -> None:
        super().__init__(client)
        self.loop, self.excitation, self.sets, self.repeat = loop, excitation, sets, repeat
        self._height_m, self._full_rate_us, self._lands = height_m, full_rate_us, land
        self.trials: list[Trial] = []
        self.own: dict[str, float] = {}  # the vehicle's gains before anything was written
        self.written = False  # whether others may be in force
        self._done = 0
        self._recorder = Recorder(client, loop)
        self._pilot = Pilot(client, self._note)
        self._hover: tuple[Quat, float] = ((1.0, 0.0, 0.0, 0.0), 0.0)  # attitude and thrust that hold the place
        targets.load_kernels()

    # What the outside sees.

    @property
    def recording(self) -> bool:
        return self._recorder.open

    @property
    def progress(self) -> float:
        return self._done / max(1, len(self.sets) * self.repeat)

    def script(self) -> Script[None]:
        client, pilot = self.client, self._pilot
        yield from client.connect()
        self._note(f"vehicle {client.system} heard")
        self.phase = "configuring"
        fast = dict.fromkeys(recorder.streams(self.loop), self._full_rate_us)
        intervals = dict.fromkeys(UNWANTED, -1) | _SLOW_US | fast
        yield from client.set_intervals(intervals)
        v = client.vehicle
        yield from client.wait(
            lambda: v.position_m is not None and v.clock.known and v.ready is not None and pilot.q is not None,
            5.0,
            "the vehicle doesn't tell its position, attitude, time and readiness",
        )
        found = yield from params.fetch_all(client)
        missing = [name for name in GAIN_NAMES if name not in found]
        if missing:
            raise LinkError(f"the vehicle has no {missing[0]}: it isn't one whose gains these are")
        self.own = {name: found[name].value for name in GAIN_NAMES}
        self.t0_s = pilot.now_s
        self.phase = "climbing"
        yield from pilot.go_up(self._height_m, self._descent_m())
        for gain_set in self.sets:
            self.trials.append((yield from self._try(gain_set)))
        yield from self._put_back()
        if self._lands:
            self.phase = "landing"
            yield from pilot.finish()
        client.background = None
        client.send_intervals(dict.fromkeys(intervals, 0))
        self.phase = "done"

    def leave(self) -> Script[None]:
        """Put everything back as it was, after the script has ended early: gains first, then where the vehicle is."""
        self.client.background = None
        self.client.vehicle.heard_s = None  # a silence until now is no reason to end
        self._recorder.open = False
        return self._left()

    def _left(self) -> Script[None]:
        client = self.client
        yield from client.connect(REACH_PATIENCE_S)
        if self.written:
            yield from params.apply(client, self.own)
            self._back_in_force()
        yield from self._pilot.let_go()
        client.send_intervals(dict.fromkeys((*UNWANTED, *_SLOW_US, *recorder.streams(self.loop)), 0))

    # The parts of the script.

    def _try(self, gain_set: GainSet) -> Script[Trial]:
        """One set of gains: written, flown, and taken back at once where it can't hold the vehicle."""
        pilot = self._pilot
        gains, records, fault = self.own | dict(gain_set.gains or {}), [], ""
        self.written = self.written or gain_set.gains is not None
        if self.written:
            yield from pilot.guarded(params.apply(self.client, gains))
        try:
            for _ in range(self.repeat):
                self.phase = "settling"
                yield from pilot.rest()
                records.append((yield from self._excite()))
                self._done += 1
        except LostError as lost:
            fault = f"{lost}, at t = {self.t_s:.1f} s"
            self._done = (len(self.trials) + 1) * self.repeat
            self._note(f"gains {gain_set.name} don't hold the vehicle: {lost}")
            self.phase = "recovering"
            pilot.stay(pilot.place_m)
            yield from pilot.guarded(params.apply(self.client, self.own))
            yield from pilot.come_back()
        return Trial(gain_set.name, gains, records, fault)

    def _excite(self) -> Script[Taken]:
        client, loop, excitation, pilot = self.client, self.loop, self.excitation, self._pilot
        self.phase = "exciting"
        if loop.steers:
            yield from self._learn_hover()
        edge_s = math.ceil((pilot.now_s + excitation.before_s) / STREAM_S) * STREAM_S

        def target(ms: int) -> Any:
            level = loop.inside(excitation.at(ms * 1e-3 - edge_s))
            if not loop.steers:
                return targets.excited(client, ms, loop, pilot.place_m, level)
            base_q, thrust = self._hover
            assert pilot.q is not None
            sinking_m_s = client.vehicle.velocity_m_s[2]
            thrust = targets.height_keeping(thrust, pilot.q, base_q, pilot.below_m, sinking_m_s)
            return targets.steered(client, ms, loop, base_q, level, thrust)

        pilot.target = target
        self._recorder.open = True
        try:
            while pilot.now_s < edge_s + excitation.duration_s:
                pilot.held(self._reach_m())
                yield math.inf
        finally:
            self._recorder.open = False
            taken = self._recorder.taken(excitation)
        yield from pilot.return_to_place()
        if taken is None:
            raise LinkError("the vehicle never told that it had taken the step: too little of its streams came through")
        return taken

    def _learn_hover(self) -> Script[None]:
        """Attitude and thrust of the hover, as the vehicle's own loops want them, averaged."""
        told: list[tuple[Quat, float]] = []
        on, name, pilot = self.client.on, recorder.ATTITUDE_TARGET, self._pilot
        usual = on[name]
        on[name] = lambda m: told.append((body_quaternion(*m.q), m.thrust))
        try:
            end_s = pilot.now_s + _HOVER_S
            while pilot.now_s < end_s:
                pilot.held()
                yield math.inf
        finally:
            on[name] = usual
        if not told:
            raise LinkError("the vehicle doesn't tell the attitude that it flies (ATTITUDE_TARGET)")
        first = told[0][0]
        signs = [math.copysign(1.0, sum(a * b for a, b in zip(q, first, strict=True))) for q, _ in told]
        mean = [sum(sign * q[k] for sign, (q, _) in zip(signs, told, strict=True)) for k in range(4)]
        w, x, y, z = (component / math.hypot(*mean) for component in mean)
        self._hover = (w, x, y, z), sum(thrust for _, thrust in told) / len(told)
        self._recorder.base_q = (w, x, y, z)

    def _reach_m(self) -> float:
        """How far from its place the excitation itself may take the vehicle."""
        if self.loop.steers:
            return _STEERED_FAR_M
        size, kind = abs(self.excitation.size), self.loop.kind.name
        return FAR_M + (size if kind == "position" else size * self.excitation.hold_s * 2.0)

    def _descent_m(self) -> float:
        """How far below its place the excitation leads."""
        levels, kind = self.excitation.levels, self.loop.kind.name
        if self.loop.axis != 2 or self.loop.steers:
            return 0.0
        if kind == "position":
            return max(0.0, *levels)
        return max(0.0, *(self.excitation.hold_s * sum(levels[: k + 1]) for k in range(len(levels))))

    def _put_back(self) -> Script[None]:
        if self.written:
            self.phase = "restoring"
            yield from self._pilot.guarded(params.apply(self.client, self.own))
            self._back_in_force()

    def _back_in_force(self) -> None:
        self.written = False
        self._note("the vehicle's own gains are back in force")
