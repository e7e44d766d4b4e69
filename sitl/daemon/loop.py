"""The loop: one thread, absolute deadlines; datagrams in, simulation on, datagrams and telemetry out.

Between turns it sleeps on the sockets, so a request is answered at once and not at the next turn. It turns one vehicle,
or the vehicles of a swarm, all on one clock: who changes the pace of one changes it for all.
"""

from collections.abc import Callable, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Generic

from sitl.daemon.clock import SLICE_US, TURN_S, Lateness, Pacing
from sitl.daemon.config import Address
from sitl.daemon.member import Complaints, Member
from sitl.daemon.udp import Place, Sockets
from sitl.mavlink.peers import PortKind
from sitl.telemetry.schema import LoopMessage

if TYPE_CHECKING:
    from sitl.mavlink.shared import SharedPort
    from sitl.telemetry.publisher import Publisher

TURN_BUDGET_S = 0.02  # simulation that takes longer goes on in the next turn, after the sockets were looked at
RECEIVE_BUDGET_S = 0.001  # datagrams that take longer to answer wait, so that the next turn is not late
WAKES_MAX = 32  # for datagrams, between two turns: what a flood brings beyond that waits for the turn
FACTOR_WINDOW_S = 1.0  # over which the achieved speed is averaged
EARLY_US = 100  # a turn that begins so much before its time counts as on time


class Ending(Enum):
    STOPPED = "stopped"  # by a signal
    SHUTDOWN = "shut down"  # by a command over the link
    REBOOT = "reboot"


class Loop(Generic[Place]):
    """Runs its members. `clock` gives wall time [s], never backwards.

    shared: the place of a port that all of them have together, and who deals out what comes there. restart: builds a
    member anew, standing at its start; None: a reboot ends the loop. turn_s: wall time between turns; those longer
    than a control step simulate whole slices.
    """

    def __init__(
        self,
        members: Sequence[Member[Place]],
        sockets: Sockets[Place],
        clock: Callable[[], float],
        *,
        shared: "tuple[Place, SharedPort] | None" = None,
        restart: Callable[[Member[Place]], Member[Place]] | None = None,
        turn_s: float = TURN_S,
    ) -> None:
        self.turns = 0
        self.lateness = Lateness(turn_s)
        self.members = list(members)
        self.now_us = self.members[0].vehicle.now_us
        self._sockets = sockets
        self._clock = clock
        self._shared = shared
        self._restart = restart
        self._turn_s = turn_s
        self._step_us = self.members[0].vehicle.step_us
        self._start_s = clock()
        self.pacing = Pacing(self._step_us, self.now_us, self._start_s, turn_s)
        self._pace: tuple[float, float] | None = None  # SIM_SPEED and SIM_PAUSE in force
        self._complaints = Complaints()
        self._factor = 0.0
        self._factor_from = (self.now_us, self._start_s)
        self._retired: list[Publisher] = []
        self._ports: dict[Place, tuple[Member[Place], PortKind]] = {}
        for member in self.members:
            self._open(member)

    def _open(self, member: Member[Place]) -> None:
        own = [(place, kind) for kind, place in member.places.items() if kind is not PortKind.SHARED]
        self._ports.update({place: (member, kind) for place, kind in own})
        member.watch_frames(self._clock)

    @property
    def faults(self) -> int:
        shared = self._shared[1].faults if self._shared else 0
        return self._complaints.count + shared + sum(member.faults for member in self.members)

    def run(self, stopping: Callable[[], bool]) -> Ending:
        """Turn until `stopping()` or until the link asks for an end."""
        wake_s = self._clock()
        self.pacing = Pacing(self._step_us, self.now_us, wake_s, self._turn_s)  # what came before is not caught up
        for member in self.members:
            member.generation = -1
        while not stopping():
            wall_s = self._clock()
            if self.pacing.has_deadlines:
                self.lateness.record(wake_s, wall_s)
            wake_s = self.turn(wall_s)
            ending = self._ending()
            if ending is not None:
                return ending
            for _ in range(WAKES_MAX):
                now_s = self._clock()
                if now_s >= wake_s or not self._sockets.wait(wake_s - now_s):
                    break
                now_s = self._clock()
                self._receive(now_s)
                self._send(now_s)
            else:
                self._sockets.rest(wake_s - self._clock())
        return Ending.STOPPED

    def turn(self, wall_s: float) -> float:
        """One turn at `wall_s`; returns the wall time of the next."""
        self.turns += 1
        self._sockets.pardon(wall_s)
        self._receive(wall_s)
        self._follow_parameters(wall_s)
        due_us = self._due_us(wall_s)
        until_s = wall_s + TURN_BUDGET_S
        behind = due_us - self.now_us >= self._step_us
        while behind:
            self._advance(min(due_us, self._slice_end_us()), wall_s)
            behind = due_us - self.now_us >= self._step_us
            now_s = self._clock()
            if behind:
                self._serve(now_s)
            if now_s >= until_s or any(m.vehicle.parameters.generation != m.generation for m in self.members):
                break
        now_s = self._clock()
        self._follow_parameters(now_s)
        self._serve(now_s)
        for member in self.members:
            member.log_events()
        self._measure_factor(now_s)
        return now_s if behind else self.pacing.wake_s(self.now_us, wall_s)

    def figures(self, member: Member[Place] | None = None) -> LoopMessage:
        """How the loop is doing, and this vehicle (the first one) in it."""
        member = member or self.members[0]
        p, e, shared = member.publisher, member.endpoint, self._shared[1] if self._shared else None
        return LoopMessage(
            now_us=member.vehicle.now_us,
            up_wall_s=self._clock() - self._start_s,
            real_time_factor=self._factor,
            turns=self.turns,
            overruns=self.lateness.overruns,
            worst_late_ms=self.lateness.worst_s * 1e3,
            slipped_s=self.pacing.slipped_s,
            datagrams_in=self._sockets.received,
            datagrams_out=self._sockets.sent,
            datagrams_dropped=self._sockets.dropped,
            datagrams_refused=e.refused + (shared.refused if shared else 0),
            senders_shunned=self._sockets.shunned,
            datagrams_unreadable=e.unreadable + (shared.unreadable if shared else 0),
            frames_unauthentic=e.unauthentic + (shared.unauthentic if shared else 0),
            frames_forwarded=e.forwarded,
            peers=len(e.peers),
            faults=self.faults,
            telemetry_messages=p.messages if p else 0,
            telemetry_busy_ms=p.busy_s * 1e3 if p else 0.0,
            telemetry_worst_ms=p.worst_s * 1e3 if p else 0.0,
        )

    def _follow_parameters(self, wall_s: float) -> None:
        for member in self.members:
            p = member.vehicle.parameters
            if p.generation != member.generation:
                pace = p["SIM_SPEED"], p["SIM_PAUSE"]
                self.pacing.set(pace[0], pace[1] > 0, int(p["SIM_STEP_MS"]), self.now_us, wall_s)
                member.generation = p.generation
                if pace != self._pace:
                    self._pace = pace
                    for other in self.members:
                        self._take_on_pace(other)
            if p["SIM_STEP_MS"] > 0 and not self.pacing.stepping(self.now_us):
                p.put_back("SIM_STEP_MS", 0)  # done, or not paused
                member.generation = p.generation

    def _take_on_pace(self, member: Member[Place]) -> None:
        """Have its parameters say what is in force."""
        p = member.vehicle.parameters
        for name, value in zip(("SIM_SPEED", "SIM_PAUSE"), self._pace or (), strict=True):
            if p[name] != value:
                p.put_back(name, value)

    def _due_us(self, wall_s: float) -> int:
        due_us = self.pacing.due_us(self.now_us, wall_s)
        if self._turn_s > TURN_S and self.pacing.has_deadlines:
            due_us = (due_us + EARLY_US) // SLICE_US * SLICE_US
        return due_us

    def _slice_end_us(self) -> int:
        return self.now_us + SLICE_US - (self.now_us % SLICE_US if self._turn_s > TURN_S else 0)

    def _advance(self, until_us: int, wall_s: float) -> None:
        self.now_us += (until_us - self.now_us) // self._step_us * self._step_us
        for member in self.members:
            if not member.failed:
                member.advance(self.now_us, wall_s)
        member = self.members[0]
        if member.failed and len(self.members) == 1:  # whoever mends it may let it go on
            member.failed, member.began_us = False, self.now_us - member.vehicle.now_us
            member.vehicle.parameters.set("SIM_PAUSE", 1.0)

    def _serve(self, wall_s: float) -> None:
        self._send(wall_s)
        for member in self.members:
            if member.publisher is not None:
                member.publisher.turn(wall_s)
        for publisher in self._retired:
            publisher.turn(wall_s)

    def receive(self, place: Place, address: Address, data: bytes, wall_s: float) -> bool:
        """Take a datagram. False: it was more than its sender may send."""
        owner = self._ports.get(place)
        if owner is not None:
            member, kind = owner
            return member.receive(data, address, kind, wall_s)
        if self._shared is not None and place == self._shared[0]:
            return self._shared[1].receive(data, address, wall_s)
        return True  # for a vehicle that was shut down

    def _receive(self, wall_s: float) -> None:
        until_s = self._clock() + RECEIVE_BUDGET_S
        for number, (place, address, data) in enumerate(self._sockets.receive(), 1):
            if not self.receive(place, address, data, wall_s):
                self._sockets.refused(place, address, wall_s)
            if number % 8 == 0 and self._clock() > until_s:
                break

    def _send(self, wall_s: float) -> None:
        for member in self.members:
            member.send(self._sockets, wall_s)

    def _ending(self) -> Ending | None:
        """What the link has asked for: of a lone vehicle or the last one, the loop's end."""
        for member in tuple(self.members):
            if member.endpoint.shutdown_requested:
                if len(self.members) == 1:
                    return Ending.SHUTDOWN
                self._retire(member)
            elif member.endpoint.reboot_requested:
                if self._restart is None:
                    return Ending.REBOOT
                self._renew(member, self._restart)
        return None

    def _retire(self, member: Member[Place]) -> None:
        """One vehicle of several is switched off: its ports stay silent."""
        self.members.remove(member)
        self._ports = {place: owner for place, owner in self._ports.items() if owner[0] is not member}
        if self._shared is not None:
            del self._shared[1].endpoints[member.endpoint.system_id]
        if member.publisher is not None:
            member.publisher.attach(None)
            member.publisher.close()
            self._retired.append(member.publisher)

    def _renew(self, member: Member[Place], restart: Callable[[Member[Place]], Member[Place]]) -> None:
        """One vehicle of several starts again, on its own clock from zero, at the pace of the others."""
        try:
            fresh = restart(member)
        except Exception:
            self._complaints.add(f"system {member.endpoint.system_id} can't be built again", self._clock())
            self._retire(member)
            return
        fresh.began_us = self.now_us
        self._take_on_pace(fresh)
        fresh.generation = fresh.vehicle.parameters.generation
        self.members[self.members.index(member)] = fresh
        if self._shared is not None:
            self._shared[1].endpoints[fresh.endpoint.system_id] = fresh.endpoint
        self._open(fresh)

    def _measure_factor(self, wall_s: float) -> None:
        from_us, from_s = self._factor_from
        if wall_s - from_s >= FACTOR_WINDOW_S:
            self._factor = (self.now_us - from_us) * 1e-6 / (wall_s - from_s)
            self._factor_from = (self.now_us, wall_s)
