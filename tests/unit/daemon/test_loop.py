"""The loop, with stand-ins for all that it ties together and a clock that only moves when told."""

import logging
from itertools import pairwise

import pytest

from sitl.daemon.clock import SLICE_US, TURN_S
from sitl.daemon.config import Port
from sitl.daemon.loop import RECEIVE_BUDGET_S, WAKES_MAX, Ending, Loop
from sitl.daemon.member import QUIET_S, Member
from sitl.mavlink.peers import PortKind
from sitl.onboard.events import EventLog
from sitl.onboard.modes import EventKind

CLIENT = ("127.0.0.1", 50_000)


class Clock:
    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


class Registry(dict):
    """Parameters without declarations."""

    generation = 0

    def set(self, name, value) -> None:
        self[name] = value
        self.generation += 1

    put_back = set


class Craft:
    """A vehicle that only passes time."""

    step_us = 2000

    def __init__(self) -> None:
        self.now_us = 0
        self.parameters = Registry(SIM_SPEED=1.0, SIM_PAUSE=0, SIM_STEP_MS=0)
        self.events = EventLog()
        self.slices: list[int] = []
        self.broken = False

    def advance(self, until_us: int) -> None:
        if self.broken:
            raise FloatingPointError("overflow")
        steps = (until_us - self.now_us) // self.step_us
        self.now_us += steps * self.step_us
        self.slices.append(until_us)


class Link:
    """An endpoint that notes what it is given, echoes it, and fails at what is told to break it."""

    def __init__(self, craft: Craft) -> None:
        self.shutdown_requested = self.reboot_requested = False
        self.faults = self.refused = self.unreadable = self.unauthentic = self.forwarded = 0
        self.peers = ()
        self.on_frame = None
        self.received: list = []
        self.polled: list[tuple[float, int]] = []
        self._craft = craft
        self._replies: list = []

    def receive(self, data, address, kind, wall_s) -> bool:
        if data == b"poison":
            raise ValueError("poisoned")
        self.shutdown_requested |= data == b"shut down"
        self.reboot_requested |= data == b"reboot"
        self.received.append((data, address, kind, wall_s))
        self._replies.append((kind, address, b"re: " + data))
        return data != b"too much"

    def poll(self, wall_s):
        self.polled.append((wall_s, self._craft.now_us))
        replies, self._replies = self._replies, []
        return replies


class Wire:
    """Sockets on which datagrams arrive when the script says; waiting moves the clock."""

    received = sent = dropped = shunned = 0

    def __init__(self, clock: Clock) -> None:
        self.script: list = []  # (wall time, port, data)
        self.outgoing: list = []
        self.refusals: list = []
        self._clock = clock

    def receive(self):
        while self.script and self.script[0][0] <= self._clock():
            _, port, data = self.script.pop(0)
            yield port, CLIENT, data

    def wait(self, timeout_s: float) -> bool:
        end_s = self._clock() + timeout_s
        if self.script and self.script[0][0] < end_s:
            self._clock.now_s = max(self._clock.now_s, self.script[0][0])
            return True
        self._clock.now_s = end_s
        return False

    def refused(self, port, address, wall_s) -> None:
        self.refusals.append((port, address))

    def pardon(self, wall_s) -> None:
        pass

    def rest(self, seconds: float) -> None:
        self._clock.now_s += max(0.0, seconds)

    def send(self, port, address, data) -> None:
        self.outgoing.append((self._clock(), port, address, data))


class Bench:
    """A loop with its stand-ins."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.craft = Craft()
        self.link = Link(self.craft)
        self.wire = Wire(self.clock)
        self.member = Member(self.craft, self.link, {PortKind.GCS: Port.GCS, PortKind.ONBOARD: Port.ONBOARD})
        self.loop = Loop([self.member], self.wire, self.clock)

    def run(self, seconds: float) -> Ending:
        end_s = self.clock() + seconds
        return self.loop.run(lambda: self.clock() >= end_s)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_real_time_is_kept(bench) -> None:
    assert bench.run(2.0) is Ending.STOPPED
    assert bench.craft.now_us == pytest.approx(2_000_000, abs=2 * TURN_S * 1e6)
    assert bench.loop.lateness.turns == pytest.approx(2.0 / TURN_S, abs=2)
    assert bench.loop.lateness.overruns == 0


def test_the_time_that_building_took_is_not_caught_up(bench) -> None:
    bench.clock.now_s += 0.2
    bench.run(TURN_S)
    assert bench.craft.now_us <= 2 * TURN_S * 1e6
    assert bench.loop.pacing.slipped_s == 0.0


def test_at_ten_times_real_time_the_link_is_served_at_least_each_slice(bench) -> None:
    bench.craft.parameters.set("SIM_SPEED", 10.0)
    bench.run(1.0)
    assert bench.craft.now_us == pytest.approx(10_000_000, abs=20 * TURN_S * 1e6)
    served = [now_us for _, now_us in bench.link.polled]
    assert max(later - sooner for sooner, later in pairwise(served)) <= SLICE_US


def test_a_request_is_answered_when_it_comes_and_not_at_the_next_turn(bench) -> None:
    arrival_s = bench.clock() + 10 * TURN_S + 0.001
    bench.wire.script = [(arrival_s, Port.ONBOARD, b"ping")]
    bench.run(1.0)
    assert bench.link.received == [(b"ping", CLIENT, PortKind.ONBOARD, arrival_s)]
    assert bench.wire.outgoing == [(arrival_s, Port.ONBOARD, CLIENT, b"re: ping")]


def test_requests_between_turns_do_not_shift_the_turns(bench) -> None:
    start_s = bench.clock()
    bench.wire.script = [(start_s + k * 0.0007, Port.GCS, b"x") for k in range(1, 1000)]
    bench.run(1.0)
    assert bench.loop.lateness.turns == pytest.approx(1.0 / TURN_S, abs=2)
    assert bench.craft.now_us == pytest.approx(1_000_000, abs=2 * TURN_S * 1e6)


def test_a_flood_wakes_the_loop_so_often_and_then_waits_for_the_turn(bench) -> None:
    start_s = bench.clock()
    bench.wire.script = [(start_s + k * 20e-6, Port.GCS, b"x") for k in range(1, 50_000)]
    bench.run(1.0)
    assert len(bench.link.received) == pytest.approx(50_000, abs=300)
    assert len(bench.link.polled) <= (1.0 / TURN_S + 2) * (WAKES_MAX + 1)
    assert bench.loop.lateness.turns == pytest.approx(1.0 / TURN_S, abs=2)


def test_datagrams_that_take_long_to_answer_do_not_make_the_turn_late(bench) -> None:
    answer, cost_s = bench.link.receive, 0.0005

    def slow(*arguments) -> bool:
        bench.clock.now_s += cost_s
        return answer(*arguments)

    bench.link.receive = slow
    bench.wire.script = [(bench.clock() + 0.1, Port.GCS, b"x")] * 500
    bench.run(2.0)
    assert len(bench.link.received) == 500
    assert bench.loop.lateness.worst_s <= RECEIVE_BUDGET_S + 8 * cost_s + 0.0005


def test_what_the_link_refuses_is_told_to_the_sockets(bench) -> None:
    bench.wire.script = [(bench.clock() + 0.1, Port.GCS, data) for data in (b"fine", b"too much")]
    bench.run(0.5)
    assert bench.wire.refusals == [(Port.GCS, CLIENT)]


def test_a_datagram_that_breaks_the_link_is_counted_and_survived(bench, caplog) -> None:
    start_s = bench.clock()
    bench.wire.script = [(start_s + k * 0.001, Port.GCS, b"poison") for k in range(500)]
    bench.wire.script.append((start_s + 0.6, Port.GCS, b"fine"))
    with caplog.at_level(logging.ERROR):
        bench.run(1.0)
    assert bench.loop.faults == 500
    assert [data for data, *_ in bench.link.received] == [b"fine"]
    assert len(caplog.records) <= 1 + 0.5 / QUIET_S  # not once for each


def test_a_failing_simulation_is_paused_and_told_and_the_link_stays_up(bench) -> None:
    bench.craft.broken = True
    bench.wire.script = [(bench.clock() + 0.5, Port.GCS, b"still there?")]
    bench.run(1.0)
    assert bench.craft.parameters["SIM_PAUSE"] == 1
    assert bench.loop.faults == 1
    (event,) = [event for event in bench.craft.events.since(0) if event.kind is EventKind.TEXT]
    assert "FloatingPointError" in event.text
    assert [data for *_, data in bench.wire.outgoing] == [b"re: still there?"]


def test_a_paused_simulation_stands_while_the_link_goes_on(bench) -> None:
    bench.craft.parameters.set("SIM_PAUSE", 1)
    bench.wire.script = [(bench.clock() + 0.5, Port.GCS, b"hello")]
    bench.run(1.0)
    assert bench.craft.now_us == 0
    assert len(bench.wire.outgoing) == 1
    assert len(bench.link.polled) >= 10


def test_a_step_runs_as_asked_and_then_reads_zero(bench) -> None:
    bench.craft.parameters.set("SIM_PAUSE", 1)
    bench.run(0.1)
    bench.craft.parameters.set("SIM_STEP_MS", 150)
    bench.run(0.1)
    assert bench.craft.now_us == 150_000
    assert bench.craft.parameters["SIM_STEP_MS"] == 0
    bench.craft.parameters.set("SIM_STEP_MS", 3)  # whole control steps of 2 ms
    bench.run(0.1)
    assert bench.craft.now_us == 154_000
    assert bench.craft.parameters["SIM_STEP_MS"] == 0


def test_a_step_is_nothing_while_the_simulation_runs(bench) -> None:
    bench.craft.parameters.set("SIM_STEP_MS", 5000)
    bench.run(0.1)
    assert bench.craft.parameters["SIM_STEP_MS"] == 0
    assert bench.craft.now_us == pytest.approx(100_000, abs=TURN_S * 1e6)


def test_going_on_after_a_pause_does_not_catch_up(bench) -> None:
    bench.craft.parameters.set("SIM_PAUSE", 1)
    bench.run(5.0)
    bench.craft.parameters.set("SIM_PAUSE", 0)
    bench.run(0.1)
    assert bench.craft.now_us == pytest.approx(100_000, abs=2 * TURN_S * 1e6)


def test_a_late_turn_is_an_overrun_and_is_caught_up(bench) -> None:
    bench.run(0.1)
    bench.clock.now_s += 0.05
    planned = bench.loop.pacing
    bench.loop.lateness.record(bench.clock() - 0.05, bench.clock())
    bench.loop.turn(bench.clock())
    assert bench.loop.lateness.overruns == 1
    assert bench.craft.now_us == pytest.approx(150_000, abs=TURN_S * 1e6)
    assert planned.slipped_s == 0.0


def test_as_fast_as_possible_looks_at_the_link_after_each_slice(bench) -> None:
    bench.craft.parameters.set("SIM_SPEED", 0.0)
    turns = iter(range(20))
    bench.loop.run(lambda: next(turns, None) is None)
    assert bench.craft.now_us == 20 * SLICE_US
    assert len(bench.link.polled) == bench.loop.figures().turns == 20


@pytest.mark.parametrize(
    ("data", "ending"), [(b"shut down", Ending.SHUTDOWN), (b"reboot", Ending.REBOOT)], ids=["shutdown", "reboot"]
)
def test_the_link_ends_the_loop_after_the_answer_is_out(bench, data, ending) -> None:
    bench.wire.script = [(bench.clock() + 0.0105, Port.GCS, data)]
    assert bench.run(1.0) is ending
    assert bench.wire.outgoing[-1][-1] == b"re: " + data


def test_the_figures_count_what_happened(bench) -> None:
    bench.run(3.0)
    figures = bench.loop.figures()
    assert figures.real_time_factor == pytest.approx(1.0, abs=0.01)
    assert figures.turns == bench.loop.turns == bench.loop.lateness.turns
    assert figures.up_wall_s == pytest.approx(3.0, abs=0.01)


def test_the_recorder_sees_frames_with_their_time_and_room_is_asked_for_before_each_advance(bench) -> None:
    class Tape:
        def __init__(self) -> None:
            self.seen: list = []

        def frame(self, frame, unix_s) -> None:
            self.seen.append((frame, unix_s))

        def trace(self, until_us, unix_s):
            self.seen.append("trace")
            return "rows"

        def take(self, trace) -> None:
            assert trace == "rows"
            self.seen.append(bench.craft.now_us)

    tape = Tape()
    bench.craft.advance = lambda until_us, trace: Craft.advance(bench.craft, until_us)
    bench.member.recorder = tape
    bench.member.watch_frames(bench.clock)
    bench.link.on_frame(b"\xfdabc", True)
    bench.run(0.005)
    assert tape.seen[0] == (b"\xfdabc", 1000.0)
    assert tape.seen[1:3] == ["trace", 4000]
