"""The Zenoh edge: sends what the feeds say, answers queries, holds the liveliness tokens. One session, all vehicles.

Sending runs inside the loop's turn. A put takes some microseconds and never waits: congestion control is DROP with no
grace time, so a full queue behind a slow, stopped or dead subscriber costs the subscriber its messages only.

Answering can wait for the asker, as long as `PATIENCE_S`: a reply goes out with the congestion control that the query
asked for, and that is BLOCK unless the asker says otherwise. So a thread of its own takes queries and sends replies,
for all vehicles; the loop only builds the payloads and hands them over, one vehicle's in a turn, and telemetry goes out
in another priority's queue than replies.
"""

import logging
import queue
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import zenoh

from sitl.telemetry import keys
from sitl.telemetry.feed import Feed
from sitl.telemetry.keys import Topic

log = logging.getLogger(__name__)

DEFAULT_PORT = 7447
PATIENCE_S = 0.5  # with an asker that does not take its answer; then its connection is closed
QUERIES_WAITING = 64  # more wait with whoever sent them
QUIET_S = 1.0  # between two reports of the same kind of fault


class ZenohUnavailableError(Exception):
    """The session could not be opened; the message is one line."""


def default_endpoint(instance: int) -> str:
    return f"tcp/127.0.0.1:{DEFAULT_PORT + instance}"


def open_session(endpoint: str) -> Any:
    """A session that listens on `endpoint` and looks for nobody else by itself."""
    config = zenoh.Config()
    for name, value in (
        ("mode", '"peer"'),
        ("listen/endpoints", f'["{endpoint}"]'),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
        # by default a put waits a millisecond for room before it drops
        ("transport/link/tx/queue/congestion_control/drop/wait_before_drop", "0"),
        ("transport/link/tx/queue/congestion_control/block/wait_before_close", str(round(PATIENCE_S * 1e6))),
    ):
        try:
            config.insert_json5(name, value)
        except zenoh.ZError:
            raise ZenohUnavailableError(f"'{endpoint}' is no Zenoh endpoint (such as tcp/127.0.0.1:7447)") from None
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        text = str(error)
        reason = "the address is in use" if "in use" in text else text.partition(" at /")[0]
        raise ZenohUnavailableError(f"Zenoh can't listen on {endpoint}: {reason}") from None


class Answerer(threading.Thread):
    """Takes queries, has the loop build the answers, and sends them: one query after the other, vehicle by vehicle.

    The queue is first-in, first-out and never gives a query up: giving one up would tell the asker so, and wait for it
    to listen while holding the lock that the next query needs.
    """

    def __init__(self, session: Any, instances: Sequence[int]) -> None:
        super().__init__(name="zenoh answers", daemon=True)
        # to the loop, vehicle by vehicle
        self.asked: dict[int, queue.SimpleQueue[list[Topic]]] = {i: queue.SimpleQueue() for i in instances}
        self.answers: queue.SimpleQueue[list[tuple[Topic, bytes]] | None] = queue.SimpleQueue()  # back; None: the end
        self._topics = {
            (instance, zenoh.KeyExpr(keys.all_keys(instance))): {
                topic: zenoh.KeyExpr(keys.key(instance, topic)) for topic in keys.TOPICS if topic.queryable
            }
            for instance in instances
        }
        whose = instances[0] if len(instances) == 1 else None
        self._queries = session.declare_queryable(keys.all_keys(whose), zenoh.handlers.FifoChannel(QUERIES_WAITING))

    def run(self) -> None:
        while True:
            try:
                query = self._queries.recv()
            except zenoh.ZError:
                return  # the session is closed
            try:
                for (instance, everything), topics in self._topics.items():
                    if not query.key_expr.intersects(everything):
                        continue
                    self.asked[instance].put([topic for topic, key in topics.items() if query.key_expr.intersects(key)])
                    answers = self.answers.get()
                    if answers is None:
                        return
                    for topic, payload in answers:
                        query.reply(topics[topic], payload, encoding=topic.encoding)
                query.drop()  # tells the asker that there are no more replies
            except zenoh.ZError as error:
                log.debug("an asker went away: %s", error)


class Session:
    """An open session, and the one who answers there for all the vehicles that it carries."""

    def __init__(self, endpoint: str, instances: Sequence[int]) -> None:
        """Raises ZenohUnavailableError."""
        self.zenoh = open_session(endpoint)
        self.answerer = Answerer(self.zenoh, instances)
        self.answerer.start()

    def close(self) -> None:
        self.answerer.answers.put(None)
        try:
            self.zenoh.close()
        except zenoh.ZError as error:
            log.warning("Zenoh did not close cleanly: %s", error)
        self.answerer.join(2.0 * PATIENCE_S)  # a thread inside Zenoh as the interpreter ends would abort the process


class Publisher:
    """One vehicle's telemetry on an open session."""

    def __init__(self, session: Session, instance: int, clock: Callable[[], float] = time.perf_counter) -> None:
        self.messages = 0
        self.busy_s = 0.0  # spent in `turn` in all
        self.worst_s = 0.0  # longest `turn`
        self.faults = 0
        self._clock = clock
        self._complained_s = float("-inf")
        self._feed: Feed | None = None
        self._publishers = {
            topic: session.zenoh.declare_publisher(
                keys.key(instance, topic),
                encoding=topic.encoding,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.DATA_LOW,
            )
            for topic in keys.TOPICS
            if topic.cadence is not keys.Cadence.QUERY
        }
        self._asked, self._answers = session.answerer.asked[instance], session.answerer.answers
        self._token = session.zenoh.liveliness().declare_token(keys.alive_key(instance))

    def attach(self, feed: Feed | None) -> None:
        """Send this feed from now on; None: nothing, and answer nothing."""
        self._feed = feed

    def turn(self, wall_s: float) -> None:
        """Send what is due and answer what was asked. Never raises: telemetry must not stop a flight."""
        if self._feed is None:
            self._decline()
            return
        start = self._clock()
        try:
            for topic, payload in self._feed.due(wall_s, self._wanted):
                self._publishers[topic].put(payload)
                self.messages += 1
            self._answer(self._feed)
        except Exception:
            self._complain(wall_s)
        spent = self._clock() - start
        self.busy_s += spent
        if spent > self.worst_s:
            self.worst_s = spent

    def _wanted(self, topic: Topic) -> bool:
        return bool(self._publishers[topic].matching_status.matching)

    def _answer(self, feed: Feed) -> None:
        if self._asked.empty():
            return
        answers: list[tuple[Topic, bytes]] = []
        try:
            answers.extend((topic, feed.latest(topic)) for topic in self._asked.get())
        finally:
            self._answers.put(answers)  # also where it failed: somebody waits for it

    def _decline(self) -> None:
        """Somebody waits for an answer all the same."""
        if not self._asked.empty():
            self._asked.get()
            self._answers.put([])

    def _complain(self, wall_s: float) -> None:
        self.faults += 1
        if wall_s - self._complained_s >= QUIET_S:
            self._complained_s = wall_s
            log.exception("telemetry: fault %d", self.faults)

    def close(self) -> None:
        """Undeclare the token, so that listeners hear at once that the vehicle is gone. Twice is once."""
        token, self._token = self._token, None
        if token is None:
            return
        try:
            token.undeclare()
        except zenoh.ZError as error:
            log.warning("Zenoh did not take the vehicle's token back: %s", error)
