"""What goes out, under which key and in which cadence; data, no behaviour beyond spelling a key.

A key is `yawsitter/<instance>/<topic>`. Everything is sent with congestion control DROP: a subscriber that can't keep
up loses messages, the vehicle loses no time.
"""

from enum import StrEnum
from typing import NamedTuple

ROOT = "yawsitter"
JSON = "application/json"
BYTES = "application/octet-stream"


class Cadence(StrEnum):
    SAMPLED = "SIM_TLM_RATE times a second"
    CHANGE = "on every change, and once a second"
    EVENT = "once for each event"
    SECOND = "once a second"
    FRAMES = "whole MAVLink frames as they pass, gathered for at most 10 ms"
    QUERY = "answers queries only"


class Topic(NamedTuple):
    name: str
    cadence: Cadence
    encoding: str
    queryable: bool  # a get on the key is answered with its latest value


STATE = Topic("state", Cadence.SAMPLED, JSON, True)
ATTITUDE = Topic("attitude", Cadence.SAMPLED, JSON, True)
SETPOINT = Topic("setpoint", Cadence.SAMPLED, JSON, True)
ACTUATORS = Topic("actuators", Cadence.SAMPLED, JSON, True)
LOADS = Topic("loads", Cadence.SAMPLED, JSON, True)
MODE = Topic("mode", Cadence.CHANGE, JSON, True)
LOOP = Topic("loop", Cadence.SECOND, JSON, True)
EVENT = Topic("event", Cadence.EVENT, JSON, False)
EVENTS = Topic("events", Cadence.QUERY, JSON, True)
PARAMETERS = Topic("parameters", Cadence.QUERY, JSON, True)
MISSION = Topic("mission", Cadence.QUERY, JSON, True)
DESCRIPTION = Topic("description", Cadence.QUERY, JSON, True)
MAVLINK_OUT = Topic("mavlink/out", Cadence.FRAMES, BYTES, False)
MAVLINK_IN = Topic("mavlink/in", Cadence.FRAMES, BYTES, False)

TOPICS = (
    STATE,
    ATTITUDE,
    SETPOINT,
    ACTUATORS,
    LOADS,
    MODE,
    LOOP,
    EVENT,
    EVENTS,
    PARAMETERS,
    DESCRIPTION,
    MAVLINK_OUT,
    MAVLINK_IN,
    MISSION,
)


def key(instance: int, topic: Topic) -> str:
    return f"{ROOT}/{instance}/{topic.name}"


def alive_key(instance: int) -> str:
    """The liveliness token that stands while the daemon runs."""
    return f"{ROOT}/{instance}/alive"


def all_keys(instance: int | None = None) -> str:
    """The key expression of everything that one vehicle publishes and answers; None: every vehicle."""
    return f"{ROOT}/{'*' if instance is None else instance}/**"
