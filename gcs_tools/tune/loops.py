"""Which loops can be excited, how a target excites them, and how their output is read from what the vehicle tells.

A loop is excited in Offboard flight by the target that enters at its own error: a position or a velocity on one axis
(SET_POSITION_TARGET_LOCAL_NED, without feed-forward, the other axes held in place), an attitude or a body rate
(SET_ATTITUDE_TARGET). Attitudes turn about the body axis that the paper's angle turns about in hover: x for φ, y for θ,
z for ψ. At heading north they are the paper's angles; unlike these they mean the same at any heading.
"""

import difflib
import math
from typing import NamedTuple

from gcs_tools.reference import Vector
from sitl.quaternion import Quat, about_x, about_y, about_z, conjugate, multiply

_ABOUT = (about_x, about_y, about_z)


class Kind(NamedTuple):
    """What the three axes of a loop have in common.

    size, hold_s: of the usual step, and how long a level lasts. scale_s: the time in which such a loop is expected to
    answer, by which costs are made comparable. degrees: levels are told in degrees and flown in radians.
    """

    name: str
    prefix: str  # of its gains
    axes: tuple[str, str, str]
    unit: str
    size: float
    hold_s: float
    scale_s: float
    degrees: bool


KINDS = (
    Kind("position", "POS", ("x", "y", "z"), "m", 1.0, 8.0, 1.0, False),
    Kind("velocity", "VEL", ("x", "y", "z"), "m/s", 1.0, 4.0, 0.4, False),
    Kind("attitude", "ATT", ("phi", "theta", "psi"), "deg", 10.0, 2.0, 0.15, True),
    Kind("rate", "RATE", ("p", "q", "r"), "deg/s", 20.0, 0.8, 0.05, True),
)
_GREEK = {"φ": "phi", "θ": "theta", "ψ": "psi"}


class Loop(NamedTuple):
    kind: Kind
    axis: int  # 0, 1, 2

    @property
    def name(self) -> str:
        return f"{self.kind.name}.{self.kind.axes[self.axis]}"

    @property
    def gains(self) -> tuple[str, str, str]:
        """The parameters of its P, I and D."""
        p, i, d = (f"{self.kind.prefix}_{'XYZ'[self.axis]}_{term}" for term in "PID")
        return p, i, d

    @property
    def steers(self) -> bool:
        """Whether it is excited by an attitude target."""
        return self.kind.degrees

    def inside(self, level: float) -> float:
        """A level as it is told, in SI."""
        return math.radians(level) if self.kind.degrees else level

    def outside(self, value: float) -> float:
        """The reverse of `inside`."""
        return math.degrees(value) if self.kind.degrees else value


LOOPS = {loop.name: loop for kind in KINDS for loop in (Loop(kind, axis) for axis in range(3))}
GAIN_NAMES = tuple(name for loop in LOOPS.values() for name in loop.gains)


def parse(text: str) -> Loop:
    """A loop by its name; axes may be x, y, z and Greek letters too. Raises ValueError that names what there is."""
    kind, _, axis = text.lower().partition(".")
    for loop in LOOPS.values():
        if kind == loop.kind.name and _GREEK.get(axis, axis) in (loop.kind.axes[loop.axis], "xyz"[loop.axis]):
            return loop
    near = difflib.get_close_matches(text.lower(), LOOPS, 1)
    hint = f" (do you mean {near[0]}?)" if near else ""
    known = ", ".join(f"{kind.name}.{'|'.join(kind.axes)}" for kind in KINDS)
    raise ValueError(f"'{text}' is not a loop{hint}: {known}")


def turned(base: Quat, axis: int, angle_rad: float) -> Quat:
    """q_NB of `base` turned about one of its body axes."""
    return multiply(base, _ABOUT[axis](angle_rad))


def turn_between(base: Quat, q: Quat) -> Vector:
    """The rotation vector from one attitude to the other [rad, body axes of `base`]."""
    w, x, y, z = multiply(conjugate(base), q)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    k = 2.0 if sine < 1e-12 else 2.0 * math.atan2(sine, w) / sine
    return k * x, k * y, k * z


class Excitation(NamedTuple):
    """Levels around the place of rest, each held for a time; the record begins `before_s` ahead of the first."""

    name: str
    levels: tuple[float, ...]  # in the loop's unit
    hold_s: float
    before_s: float = 1.0

    @property
    def duration_s(self) -> float:
        return self.hold_s * len(self.levels)

    def at(self, t_s: float) -> float:
        """The level t_s after the first edge."""
        k = math.floor(t_s / self.hold_s + 1e-9)
        return 0.0 if k < 0 else self.levels[min(k, len(self.levels) - 1)]

    @property
    def size(self) -> float:
        """Of the first edge."""
        return self.levels[0]

    @property
    def settled_spans_s(self) -> list[tuple[float, float, float]]:
        """(edge, start, end) of the parts whose frequency response can be told apart: that begin and end at rest."""
        if self.name == "step":
            return [
                (0.0, -self.before_s, self.hold_s),
                (self.hold_s, 0.75 * self.hold_s, self.duration_s),
            ]
        return [(0.0, -self.before_s, self.duration_s)]


def step(size: float, hold_s: float) -> Excitation:
    """Out, and back."""
    return Excitation("step", (size, 0.0), hold_s)


def doublet(size: float, hold_s: float) -> Excitation:
    """Out, over to the other side, and back to rest for twice as long."""
    return Excitation("doublet", (size, -size, 0.0, 0.0), hold_s)
