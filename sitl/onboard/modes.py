"""Flight modes, what a request to the vehicle can come to, and the events it tells."""

from enum import Enum, IntEnum
from typing import NamedTuple


class Mode(Enum):
    POSITION = "position"
    ORBIT = "orbit"
    TAKEOFF = "takeoff"
    HOLD = "hold"
    MISSION = "mission"
    RETURN = "return"
    LAND = "land"
    OFFBOARD = "offboard"


class Landed(Enum):
    ON_GROUND = "on ground"
    TAKING_OFF = "taking off"
    IN_AIR = "in air"
    LANDING = "landing"


class Verdict(Enum):
    ACCEPTED = "accepted"
    TEMPORARILY_REJECTED = "temporarily rejected"  # ask again later: the state of now forbids it
    DENIED = "denied"  # the request itself is wrong
    UNSUPPORTED = "unsupported"
    FAILED = "failed"


class Outcome(NamedTuple):
    """The answer to a request: a verdict and, where it is a refusal, why, in one sentence."""

    verdict: Verdict
    reason: str = ""

    @property
    def ok(self) -> bool:
        return self.verdict is Verdict.ACCEPTED


ACCEPTED = Outcome(Verdict.ACCEPTED)


class Severity(IntEnum):
    """MAV_SEVERITY."""

    EMERGENCY = 0
    ALERT = 1
    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6
    DEBUG = 7


class EventKind(Enum):
    TEXT = "text"
    MODE = "mode"
    ARMED = "armed"  # value: 1 armed, 0 disarmed
    LANDED = "landed"
    ITEM_REACHED = "item reached"  # value: index of the mission item
    ITEM_CURRENT = "item current"  # value: index of the mission item
    PARAMETER = "parameter"  # text: its name
    PLAN = "plan"  # the stored mission, fence or rally points were replaced or cleared
    FENCE = "fence"  # it was left, or entered again
    HOME = "home"


class Event(NamedTuple):
    """Something that happened, numbered without gaps so that each listener keeps its own place."""

    number: int
    now_us: int
    kind: EventKind
    severity: Severity
    text: str
    value: int = 0
