"""The loop: one thread, absolute deadlines; datagrams in, simulation on, datagrams and telemetry out.

Between turns it sleeps on the sockets, so a request is answered at once and not at the next turn. What a datagram does
wrong is counted, logged at most once a second, and survived.
"""

import logging
from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING

from sitl.daemon.clock import SLICE_US, Lateness, Pacing
from sitl.daemon.config import Port
from sitl.daemon.udp import Sockets
from sitl.mavlink.peers import PortKind
from sitl.onboard.modes import EventKind, Severity
from sitl.telemetry.messages import LoopMessage

if TYPE_CHECKING:
    from sitl.daemon.flight_recorder import FlightRecorder
    from sitl.mavlink.endpoint import Endpoint
    from sitl.telemetry.feed import Feed
    from sitl.telemetry.publisher import Publisher
    from sitl.vehicle import Vehicle

log = logging.getLogger(__name__)

TURN_BUDGET_S = 0.02  # simulation that takes longer goes on in the next turn, after the sockets were looked at
QUIET_S = 1.0  # between two reports of faults
RECEIVE_BUDGET_S = 0.001  # datagrams that take longer to answer wait, so that the next turn is not late
WAKES_MAX = 32  # for datagrams, between two turns: what a flood brings beyond that waits for the turn
FACTOR_WINDOW_S = 1.0  # over which the achieved speed is averaged

_TOLD = (EventKind.TEXT, EventKind.MODE, EventKind.ARMED)
_LEVELS = {
    Severity.EMERGENCY: logging.CRITICAL,
    Severity.ALERT: logging.CRITICAL,
    Severity.CRITICAL: logging.CRITICAL,
    Severity.ERROR: logging.ERROR,
    Severity.WARNING: logging.WARNING,
    Severity.DEBUG: logging.DEBUG,
}
_KINDS = {port: PortKind(port.value) for port in Port}
_PORTS = {PortKind(port.value): port for port in Port}


class Ending(Enum):
    STOPPED = "stopped"  # by a signal
    SHUTDOWN = "shut down"  # by a command over the link
    REBOOT = "reboot"


class Loop:
    """Runs one vehicle behind its endpoint. `clock` gives wall time [s], never backwards."""

    def __init__(
        self,
        vehicle: "Vehicle",
        endpoint: "Endpoint",
        sockets: Sockets,
        clock: Callable[[], float],
        *,
        publisher: "Publisher | None" = None,
    ) -> None:
        self.faults = 0
        self.turns = 0
        self.lateness = Lateness()
        self._vehicle = vehicle
        self._endpoint = endpoint
        self._sockets = sockets
        self._publisher = publisher
        self._recorder: FlightRecorder | None = None
        self._feed: Feed | None = None
        self._clock = clock
        self._start_s = clock()
        self.pacing = Pacing(vehicle.step_us, vehicle.now_us, self._start_s)
        self._generation = -1
        self._complained_s = float("-inf")
        self._factor = 0.0
        self._factor_from = (vehicle.now_us, self._start_s)
        self._next_event = 0
        endpoint.on_frame = self._frame

    def feed_from(self, feed: "Feed") -> None:
        """The feed that is to see the MAVLink frames too."""
        self._feed = feed

    def record_with(self, recorder: "FlightRecorder") -> None:
        """The recorder that is to see flights and MAVLink frames."""
        self._recorder = recorder

    def run(self, stopping: Callable[[], bool]) -> Ending:
        """Turn until `stopping()` or until the link asks for an end."""
        wake_s = self._clock()
        self.pacing = Pacing(self._vehicle.step_us, self._vehicle.now_us, wake_s)  # what came before is not caught up
        self._generation = -1
        while not stopping():
            wall_s = self._clock()
            if self.pacing.has_deadlines:
                self.lateness.record(wake_s, wall_s)
            wake_s = self.turn(wall_s)
            if self._endpoint.shutdown_requested:
                return Ending.SHUTDOWN
            if self._endpoint.reboot_requested:
                return Ending.REBOOT
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
        vehicle = self._vehicle
        self.turns += 1
        self._sockets.pardon(wall_s)
        self._receive(wall_s)
        self._follow_parameters(wall_s)
        due_us = self.pacing.due_us(vehicle.now_us, wall_s)
        until_s = wall_s + TURN_BUDGET_S
        behind = due_us - vehicle.now_us >= vehicle.step_us
        while behind:
            self._advance(min(due_us, vehicle.now_us + SLICE_US), wall_s)
            behind = due_us - vehicle.now_us >= vehicle.step_us
            now_s = self._clock()
            if behind:
                self._serve(now_s)
            if now_s >= until_s or vehicle.parameters.generation != self._generation:
                break
        now_s = self._clock()
        self._follow_parameters(now_s)
        self._serve(now_s)
        self._log_events()
        self._measure_factor(now_s)
        return now_s if behind else self.pacing.wake_s(vehicle.now_us, wall_s)

    def figures(self) -> LoopMessage:
        """How the loop is doing."""
        p, e = self._publisher, self._endpoint
        return LoopMessage(
            now_us=self._vehicle.now_us,
            up_wall_s=self._clock() - self._start_s,
            real_time_factor=self._factor,
            turns=self.turns,
            overruns=self.lateness.overruns,
            worst_late_ms=self.lateness.worst_s * 1e3,
            slipped_s=self.pacing.slipped_s,
            datagrams_in=self._sockets.received,
            datagrams_out=self._sockets.sent,
            datagrams_dropped=self._sockets.dropped,
            datagrams_refused=e.refused,
            senders_shunned=self._sockets.shunned,
            datagrams_unreadable=e.unreadable,
            frames_unauthentic=e.unauthentic,
            frames_forwarded=e.forwarded,
            peers=len(e.peers),
            faults=self.faults + e.faults,
            telemetry_messages=p.messages if p else 0,
            telemetry_busy_ms=p.busy_s * 1e3 if p else 0.0,
            telemetry_worst_ms=p.worst_s * 1e3 if p else 0.0,
        )

    def _follow_parameters(self, wall_s: float) -> None:
        p = self._vehicle.parameters
        if p.generation != self._generation:
            now_us, step_ms, paused = self._vehicle.now_us, int(p["SIM_STEP_MS"]), p["SIM_PAUSE"] > 0
            self.pacing.set(p["SIM_SPEED"], paused, step_ms, now_us, wall_s)
            self._generation = p.generation
        if p["SIM_STEP_MS"] > 0 and not self.pacing.stepping(self._vehicle.now_us):
            p.put_back("SIM_STEP_MS", 0)  # done, or not paused
            self._generation = p.generation

    def _advance(self, until_us: int, wall_s: float) -> None:
        recorder = self._recorder
        try:
            if recorder is None:
                self._vehicle.advance(until_us)
            else:
                trace = recorder.trace(until_us, wall_s)
                self._vehicle.advance(until_us, trace)
                recorder.take(trace)
        except Exception as error:
            self._complain("the simulation failed and is paused", wall_s)
            self._vehicle.events.tell(Severity.CRITICAL, f"Simulation failed and is paused: {type(error).__name__}")
            self._vehicle.parameters.set("SIM_PAUSE", 1.0)

    def _serve(self, wall_s: float) -> None:
        self._send(wall_s)
        if self._publisher is not None:
            self._publisher.turn(wall_s)

    def _receive(self, wall_s: float) -> None:
        until_s = self._clock() + RECEIVE_BUDGET_S
        for number, (port, address, data) in enumerate(self._sockets.receive(), 1):
            try:
                if not self._endpoint.receive(data, address, _KINDS[port], wall_s):
                    self._sockets.refused(port, address, wall_s)
            except Exception:
                self._complain(f"a datagram of {len(data)} bytes from {address[0]}:{address[1]}", wall_s)
            if number % 8 == 0 and self._clock() > until_s:
                break

    def _send(self, wall_s: float) -> None:
        try:
            for kind, address, data in self._endpoint.poll(wall_s):
                self._sockets.send(_PORTS[kind], address, data)
        except Exception:
            self._complain("the link", wall_s)

    def _frame(self, frame: bytes, outgoing: bool) -> None:
        if self._feed is not None:
            self._feed.frame(frame, outgoing)
        if self._recorder is not None:
            self._recorder.frame(frame, self._clock())

    def _log_events(self) -> None:
        events = self._vehicle.events
        if events.next_number != self._next_event:
            for event in events.since(self._next_event):
                level = _LEVELS.get(event.severity, logging.INFO) if event.kind in _TOLD else logging.DEBUG
                log.log(level, "%.3f s: %s: %s", event.now_us * 1e-6, event.kind.value, event.text or event.value)
            self._next_event = events.next_number

    def _measure_factor(self, wall_s: float) -> None:
        from_us, from_s = self._factor_from
        if wall_s - from_s >= FACTOR_WINDOW_S:
            self._factor = (self._vehicle.now_us - from_us) * 1e-6 / (wall_s - from_s)
            self._factor_from = (self._vehicle.now_us, wall_s)

    def _complain(self, what: str, wall_s: float) -> None:
        self.faults += 1
        if wall_s - self._complained_s >= QUIET_S:
            self._complained_s = wall_s
            log.exception("fault %d: %s", self.faults, what)
