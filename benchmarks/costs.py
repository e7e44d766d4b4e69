"""What single things cost, one by one: a message, a put, a tick, a crossing into compiled code, a record, a turn.

Each is done many times in a row; told is what one takes of its thread's processor time, the median of several rounds
in which all take turns, and how many of a simple yardstick of the same round that is.
"""

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import NamedTuple

from benchmarks import cost_subjects as subjects
from benchmarks.figure import Figure, spread, told

ROUNDS = 15
_PROCESS_NS = time.process_time_ns
_SPAN_S = 0.01  # that one thing is measured for in a round, about


class Cost(NamedTuple):
    what: str
    yardstick: str  # the name of another cost; empty: it is one
    do: Callable[[], object]
    at_once: int = 1  # how often `do` does it
    clock_ns: Callable[[], int] = time.thread_time_ns


def measure(quick: bool) -> Iterator[Figure]:
    with ExitStack() as stack:
        costs = _costs(stack)
        repeats = {cost: _repeats(cost.do) for cost in costs}
        rounds: dict[str, list[float]] = {cost.what: [] for cost in costs}
        for _ in range(3 if quick else ROUNDS):
            for cost in costs:
                rounds[cost.what].append(_once_us(cost, repeats[cost]))
    for cost in costs:
        ratio = ""
        if cost.yardstick:
            pairs = zip(rounds[cost.what], rounds[cost.yardstick], strict=True)
            ratio = f", {statistics.median(mine / theirs for mine, theirs in pairs):.3g} of {cost.yardstick}"
        yield told(cost.what, spread(rounds[cost.what], "µs") + ratio)
    yield told(
        "daemon: that, over and over", spread([us * 1e-4 / subjects.TURN_S for us in rounds[TURN]], "% of a core")
    )


CALL, EXCHANGE, COMPILED = "an empty Python call", "a bare UDP sendto and recv", "an empty compiled call"
TURN = "daemon: sleeping 4 ms, then a turn, two peers"


def _costs(stack: ExitStack) -> list[Cost]:
    """Everything that is measured, in the table's order."""
    wire, craft = stack.enter_context(subjects.Wire()), subjects.Craft()
    turns = subjects.Turns(served=False), subjects.Turns(served=True)
    for loop in turns:
        stack.callback(loop.close)
    zenoh, records = stack.enter_context(subjects.Zenoh()), stack.enter_context(subjects.Records())
    return [
        Cost(CALL, "", subjects.nothing),
        Cost(EXCHANGE, "", wire.exchange),
        Cost(COMPILED, "", subjects.compiled_nothing),
        Cost("MAVLink: pack LOCAL_POSITION_NED", CALL, craft.pack),
        Cost("MAVLink: pack, mean of a ground station's default streams", CALL, craft.pack_streams()),
        Cost("MAVLink: find and open a frame of it", CALL, craft.open),
        Cost("MAVLink: pack, send, receive and open one", EXCHANGE, lambda: wire.carry(craft)),
        Cost("MAVLink: take a position target in, to the onboard logic", CALL, craft.take_target),
        Cost("the vehicle as messages show it, once a turn", CALL, craft.look),
        Cost("Zenoh: ask whether anybody listens", CALL, zenoh.ask),
        Cost("Zenoh: encode the state", CALL, craft.encode),
        Cost("Zenoh: put it, to nobody", EXCHANGE, zenoh.put_unheard),
        Cost("Zenoh: put it, to one subscriber", EXCHANGE, zenoh.put_heard, subjects.PUTS),
        Cost("Zenoh: the same with the session's own threads", EXCHANGE, zenoh.put_heard, subjects.PUTS, _PROCESS_NS),
        Cost("onboard: a tick in Hold", CALL, craft.tick),
        Cost("onboard: a tick with a new target", CALL, craft.tick_target),
        Cost("compiled: crossing, no control step", COMPILED, craft.cross(0)),
        Cost("compiled: crossing with 10 control steps", COMPILED, craft.cross(10)),
        Cost("recording: a frame for the .tlog, in the loop", CALL, records.frame),
        Cost("recording: a control step for the .mcap, in the loop", CALL, records.step),
        Cost("recording: the frame, in the process that writes", CALL, records.write_frame),
        Cost("recording: the control step there, five messages", CALL, records.write_step),
        Cost("daemon: a turn of 4 ms, nobody served", EXCHANGE, turns[0].turn),
        Cost("daemon: the same, default streams to two peers", EXCHANGE, turns[1].turn),
        Cost("daemon: sleeping 4 ms", EXCHANGE, turns[1].wait),
        Cost("daemon: sleeping 4 ms, then a turn, nobody served", EXCHANGE, turns[0].wait_and_turn),
        Cost(TURN, EXCHANGE, turns[1].wait_and_turn),
    ]


def _repeats(do: Callable[[], object]) -> int:
    """How often to do it in a row; this warms it up too."""
    do()
    begin_s, count = time.perf_counter(), 0
    while time.perf_counter() - begin_s < _SPAN_S:
        do()
        count += 1
    return max(10, count)


def _once_us(cost: Cost, repeats: int) -> float:
    begin_ns = cost.clock_ns()
    for _ in range(repeats):
        cost.do()
    return (cost.clock_ns() - begin_ns) * 1e-3 / repeats / cost.at_once
