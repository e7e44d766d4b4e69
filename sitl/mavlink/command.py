"""A command in one form, whichever message brought it, and what a handler of one has to work with."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from sitl.geodesy import to_local
from sitl.mavlink.codec import mav
from sitl.mavlink.offboard import AMSL_FRAMES, RELATIVE_FRAMES
from sitl.mavlink.wire import NAN
from sitl.onboard.guided import Task
from sitl.onboard.modes import Outcome, Verdict

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

UNSUPPORTED_FRAME = 9  # MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME

_RESULTS = {
    Verdict.ACCEPTED: mav.MAV_RESULT_ACCEPTED,
    Verdict.TEMPORARILY_REJECTED: mav.MAV_RESULT_TEMPORARILY_REJECTED,
    Verdict.DENIED: mav.MAV_RESULT_DENIED,
    Verdict.UNSUPPORTED: mav.MAV_RESULT_UNSUPPORTED,
    Verdict.FAILED: mav.MAV_RESULT_FAILED,
}


class Reply(NamedTuple):
    """MAV_RESULT and, of a refusal, the reason; with a task the result is told when that has ended."""

    result: int
    reason: str = ""
    task: Task | None = None


DONE = Reply(mav.MAV_RESULT_ACCEPTED)


class Command(NamedTuple):
    """A command of either form. param5 and param6 are degrees or metres where they name a place."""

    id: int
    params: tuple[float, float, float, float, float, float, float]
    frame: int | None  # MAV_FRAME; None: COMMAND_LONG, which has none

    def number(self, index: int, default: float = 0.0) -> float:
        """param`index`; `default` where it is unset."""
        value = self.params[index - 1]
        return default if math.isnan(value) else value


class Place(NamedTuple):
    """In N [m]; NaN where the command leaves it open."""

    north_m: float
    east_m: float
    down_m: float


class Entry(NamedTuple):
    """One row of the table.

    used: the numbers of the parameters that may be set. place: param5 to 7 name one. query: a repetition is carried
    out again, the message asked for may have been lost. amsl: with PX4's identity an altitude in
    MAV_FRAME_GLOBAL_RELATIVE_ALT is above the sea nevertheless: PX4 heeds no frame here, and MAVSDK relies on it.
    """

    handle: "Callable[[Link, Peer, Command], Reply]"
    used: str
    place: bool = False
    query: bool = False
    amsl: bool = False


def denied(reason: str) -> Reply:
    return Reply(mav.MAV_RESULT_DENIED, reason)


def reply_to(outcome: Outcome) -> Reply:
    return Reply(_RESULTS[outcome.verdict], outcome.reason)


def reply_later(outcome: Outcome, task: Task | None) -> Reply:
    """In progress, if it has been taken."""
    return Reply(mav.MAV_RESULT_IN_PROGRESS, task=task) if outcome.ok else reply_to(outcome)


def has_place(frame: int) -> bool:
    return frame in AMSL_FRAMES or frame in RELATIVE_FRAMES or frame == mav.MAV_FRAME_LOCAL_NED


def place_of(link: "Link", command: Command) -> Place | None:
    """Where param5, 6, 7 are; None if there is no such latitude or longitude. COMMAND_LONG: above sea level."""
    x, y, z = command.params[4:]
    if command.frame == mav.MAV_FRAME_LOCAL_NED:
        return Place(x, y, z)
    commander = link.vehicle.commander
    ground = commander.home.alt_amsl_m if command.frame in RELATIVE_FRAMES else 0.0
    down = commander.origin.alt_amsl_m - ground - z
    if math.isnan(x) or math.isnan(y):
        return Place(NAN, NAN, down)
    if abs(x) > 90.0 or abs(y) > 180.0:
        return None
    return Place(*to_local(commander.origin, x, y), down)


def altitude_amsl(link: "Link", down_m: float) -> float:
    return link.vehicle.commander.origin.alt_amsl_m - down_m
