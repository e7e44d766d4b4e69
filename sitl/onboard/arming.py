"""Pre-arm checks: what must be true before the motors may run, each with the sentence that says what is not."""

from typing import NamedTuple

from sitl.onboard.modes import ACCEPTED, Outcome, Verdict

MOVING_M_S = 0.5  # faster than this is not standing


class Condition(NamedTuple):
    """What arming depends on."""

    tipped_over: bool
    standing: bool
    moving: bool
    terminated: bool
    coming_down: bool = False  # in a mode that ends in a landing
    outside: str = ""  # what of the fence it violates


_CHECKS = (
    ("terminated", "flight was terminated: reboot first"),
    ("tipped_over", "the vehicle has tipped over"),
    ("moving", "the vehicle is moving"),
    ("coming_down", "the mode is to land or to return: choose another"),
)


def check(condition: Condition) -> Outcome:
    """ACCEPTED, or the first check that fails."""
    for field, sentence in _CHECKS:
        if getattr(condition, field):
            return Outcome(Verdict.TEMPORARILY_REJECTED, sentence)
    if condition.outside:
        return Outcome(Verdict.TEMPORARILY_REJECTED, f"the vehicle is outside the fence: {condition.outside}")
    if not condition.standing:
        return Outcome(Verdict.TEMPORARILY_REJECTED, "the vehicle does not stand on its feet")
    return ACCEPTED
