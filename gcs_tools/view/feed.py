"""The viewer's Zenoh edge: which vehicles are there, and what they send, taken when the page asks for it.

The session is a peer that listens nowhere and looks for nobody: it connects to the given endpoints, and goes on trying
while nobody is there. Every subscription is a short ring that keeps the newest messages, so a page that falls behind
skips some and never runs late; the vehicle drops what is not taken (docs/telemetry.md) and loses no time.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import zenoh

from gcs_tools.view import topics
from gcs_tools.view.vehicle import Vehicle

ROOT = "yawsitter"
PORT = 7447  # of instance 0
RING = 16  # messages of a topic between two polls; more are the oldest's loss
SUBSCRIBED = (*topics.SAMPLED, "mode", "loop", "event")
ANSWER_LIMIT_S = 30.0  # a vehicle that still compiles its kernels answers late
PAUSED_ASK_S = 0.25  # nothing is sampled while the simulation is paused
ASK_S = 1.0  # between two questions of the same kind
CHECK_S = 1.0  # whether endpoints are connected
RETRY_MS = 1000


class FeedError(Exception):
    """The endpoints can't be used; the message is one line."""


class Status(NamedTuple):
    """How the link to the vehicles stands."""

    connected: bool
    text: str  # one line for people


def endpoint_of(instance: int) -> str:
    """Where a vehicle on this machine listens by default."""
    return f"tcp/127.0.0.1:{PORT + instance}"


def open_session(endpoints: Sequence[str]) -> Any:
    """A session that connects to `endpoints` now or later. Raises FeedError for one that can't be an endpoint."""
    config = zenoh.Config()
    for name, value in (
        ("mode", "peer"),
        ("connect/timeout_ms", -1),  # never give up
        ("connect/exit_on_failure", False),
        ("connect/retry", {"period_init_ms": RETRY_MS, "period_max_ms": RETRY_MS, "period_increase_factor": 1.0}),
        ("listen/endpoints", []),
        ("scouting/multicast/enabled", False),
        ("scouting/gossip/enabled", False),
    ):
        config.insert_json5(name, json.dumps(value))
    try:
        config.insert_json5("connect/endpoints", json.dumps(list(endpoints)))
    except zenoh.ZError:
        raise FeedError(f"not a Zenoh endpoint: {' or '.join(endpoints)} (one is tcp/127.0.0.1:7447)") from None
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        text = str(error).partition(" at /")[0]
        raise FeedError(f"no Zenoh session with {' and '.join(endpoints)}: {text}") from None


class Feed:
    """A live source. `poll` often, from one thread; then `vehicles` holds what is known."""

    def __init__(self, endpoints: Sequence[str], instances: Sequence[int] = ()) -> None:
        """`instances`: show these alone (all that are heard)."""
        self.endpoints = tuple(endpoints)
        self._instances = frozenset(instances)
        self._session = open_session(endpoints)
        self._tokens = self._session.liveliness().declare_subscriber(
            f"{ROOT}/*/alive", zenoh.handlers.RingChannel(1024), history=True
        )
        self._listeners: dict[int, _Listener] = {}
        self._vehicles: dict[int, Vehicle] = {}
        self._check_s = float("-inf")
        self._connected = False

    @property
    def vehicles(self) -> Mapping[int, Vehicle]:
        """By instance: all that were ever there."""
        return self._vehicles

    @property
    def status(self) -> Status:
        where = ", ".join(self.endpoints)
        if not self._connected and not self._listeners:
            return Status(False, f"Nobody answers at {where}. Trying on: start a vehicle with `sitl run`.")
        if not self._listeners:
            return Status(True, f"Connected to {where}, but no vehicle is there.")
        return Status(True, f"Connected to {where}.")

    def poll(self, wall_s: float) -> None:
        while (token := self._tokens.try_recv()) is not None:
            self._token(str(token.key_expr), token.kind == zenoh.SampleKind.PUT)
        for listener in self._listeners.values():
            listener.poll(wall_s)
        if wall_s >= self._check_s:
            self._check_s = wall_s + CHECK_S
            info = self._session.info
            self._connected = bool(list(info.peers_zid()) or list(info.routers_zid()))

    def _token(self, key: str, stands: bool) -> None:
        instance = int(key.split("/")[1])
        if self._instances and instance not in self._instances:
            return
        if stands and instance not in self._listeners:
            vehicle = self._vehicles.setdefault(instance, Vehicle(instance))
            vehicle.forget()
            vehicle.alive = True
            self._listeners[instance] = _Listener(self._session, vehicle)
        elif not stands and instance in self._listeners:
            self._listeners.pop(instance).close()
            self._vehicles[instance].alive = False

    def close(self) -> None:
        for listener in self._listeners.values():
            listener.close()
        self._session.close()


class _Listener:
    """Subscriptions and questions to one vehicle, while it is there."""

    def __init__(self, session: Any, vehicle: Vehicle) -> None:
        self._session, self._vehicle = session, vehicle
        self._subscribers = {
            topic: session.declare_subscriber(f"{ROOT}/{vehicle.instance}/{topic}", zenoh.handlers.RingChannel(RING))
            for topic in SUBSCRIBED
        }
        self._answers: list[Any] = []
        self._ask_s = self._paused_ask_s = float("-inf")
        self._parameters_asked = self._plans_asked = 0  # number of the event after which they were

    def poll(self, wall_s: float) -> None:
        for topic, subscriber in self._subscribers.items():
            while (sample := subscriber.try_recv()) is not None:
                self._vehicle.take(topic, sample.payload.to_bytes())
        self._answers = [answers for answers in self._answers if self._hear(answers)]
        self._ask(wall_s)

    def _hear(self, answers: Any) -> bool:
        """Take what has come of a question's answers; whether more may come."""
        try:
            while (reply := answers.try_recv()) is not None:
                if reply.ok is not None:
                    topic = str(reply.ok.key_expr).split("/", 2)[2]
                    if topic in topics.TYPES:
                        self._vehicle.take(topic, reply.ok.payload.to_bytes())
        except zenoh.ZError:
            return False  # all are there
        return True

    def _ask(self, wall_s: float) -> None:
        vehicle = self._vehicle
        if vehicle.description is None:
            self._question(wall_s, "*")
        elif self._plans_asked != (number := self._newest("plan")):
            if self._question(wall_s, "mission"):
                self._plans_asked = number
        elif vehicle.mission is not None and vehicle.mode and vehicle.mode.mission_plan_id != vehicle.mission.plan_id:
            self._question(wall_s, "mission")
        elif self._parameters_asked != (number := self._newest("parameter")):
            if self._question(wall_s, "parameters"):
                self._parameters_asked = number
        elif vehicle.mode is not None and vehicle.mode.paused and wall_s >= self._paused_ask_s and not self._answers:
            self._paused_ask_s = wall_s + PAUSED_ASK_S
            for topic in topics.SAMPLED:
                self._get(topic)

    def _newest(self, kind: str) -> int:
        """Number of the newest event of a kind."""
        return next((e.number for e in reversed(self._vehicle.events) if e.kind == kind), 0)

    def _question(self, wall_s: float, topic: str) -> bool:
        """Ask unless an answer is under way or it was only just asked; whether it was."""
        if self._answers or wall_s < self._ask_s:
            return False
        self._ask_s = wall_s + ASK_S
        self._get(topic)
        return True

    def _get(self, topic: str) -> None:
        self._answers.append(
            self._session.get(
                f"{ROOT}/{self._vehicle.instance}/{topic}",
                handler=zenoh.handlers.FifoChannel(64),
                timeout=ANSWER_LIMIT_S,
            )
        )

    def close(self) -> None:
        for subscriber in self._subscribers.values():
            subscriber.undeclare()
