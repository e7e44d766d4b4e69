"""What a vehicle tells of an excited loop, at whatever rate it tells it: output, reference, actuators."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcs_tools.client import Client
from gcs_tools.tune.loops import Excitation, Loop, turn_between
from sitl.frames import body_quaternion, body_rates
from sitl.quaternion import Quat

Array = NDArray[np.float64]
POSITION, TARGET = "LOCAL_POSITION_NED", "POSITION_TARGET_LOCAL_NED"
ATTITUDE, ATTITUDE_TARGET = "ATTITUDE_QUATERNION", "ATTITUDE_TARGET"
ACTUATORS = "ACTUATOR_OUTPUT_STATUS"
_MOTORS_AND_FLAPS = 4  # of the outputs told; the rest are zero


class Taken(NamedTuple):
    """One record, times in s from the first edge of the reference as the vehicle tells it; levels in the loop's unit.

    t_s, output, reference: (n,), deviations from rest. actuators: (m, 5) t_s and shares of their ranges.
    """

    t_s: Array
    output: Array
    reference: Array
    actuators: Array

    @property
    def rate_Hz(self) -> float:
        return 1.0 / float(np.median(np.diff(self.t_s))) if self.t_s.size > 1 else 0.0


def streams(loop: Loop) -> tuple[str, ...]:
    """What to listen to at the full rate."""
    return (ATTITUDE, ATTITUDE_TARGET, ACTUATORS) if loop.steers else (POSITION, TARGET, ACTUATORS)


class Recorder:
    """Takes messages in while `open`; `taken` makes a record of them and begins anew."""

    def __init__(self, client: Client, loop: Loop) -> None:
        self.open = False
        self._loop = loop
        self.base_q: Quat = (1.0, 0.0, 0.0, 0.0)  # attitude at rest
        self._outputs: list[tuple[float, float]] = []
        self._references: list[tuple[float, float]] = []
        self._actuators: list[tuple[float, ...]] = []
        self._clear()
        output, reference = streams(loop)[:2]
        client.on[output] = self._output
        client.on[reference] = self._reference
        client.on[ACTUATORS] = self._outputs_to_actuators

    def _clear(self) -> None:
        self._outputs, self._references, self._actuators = [], [], []

    def _output(self, m: Any) -> None:
        if self.open:
            turning = ((m.q1, m.q2, m.q3, m.q4), (m.rollspeed, m.pitchspeed, m.yawspeed)) if self._loop.steers else ()
            self._outputs.append((m.time_boot_ms * 1e-3, self._value(m, *turning)))

    def _reference(self, m: Any) -> None:
        if self.open:
            turning = (m.q, (m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate)) if self._loop.steers else ()
            self._references.append((m.time_boot_ms * 1e-3, self._value(m, *turning)))

    def _outputs_to_actuators(self, m: Any) -> None:
        if self.open:
            self._actuators.append((m.time_usec * 1e-6, *m.actuator[:_MOTORS_AND_FLAPS]))

    def _value(self, m: Any, q: Any = None, rates: Any = None) -> float:
        """The loop's quantity in a message that tells its output or its reference; q, rates: the message's, if any."""
        axis, kind = self._loop.axis, self._loop.kind.name
        if kind == "position":
            return float((m.x, m.y, m.z)[axis])
        if kind == "velocity":
            return float((m.vx, m.vy, m.vz)[axis])
        if kind == "attitude":
            return turn_between(self.base_q, body_quaternion(*q))[axis]
        return body_rates(*rates)[axis]

    def taken(self, excitation: Excitation) -> Taken | None:
        """The record so far; None where the first edge isn't in it, as after a stream that was lost."""
        outputs, references = _in_order(self._outputs, 2), _in_order(self._references, 2)
        actuators = _in_order(self._actuators, 1 + _MOTORS_AND_FLAPS)
        self._clear()
        if outputs.shape[0] < 2 or references.shape[0] < 2:
            return None
        before = outputs[0, 0] + 0.5 * excitation.before_s
        rest_r = float(np.median(references[references[:, 0] <= max(before, references[0, 0]), 1]))
        moved = np.abs(references[:, 1] - rest_r) > 0.5 * abs(self._loop.inside(excitation.size))
        if not moved.any():
            return None
        # what is told at t was in force since the control step before: the edge came with the last sample at rest
        edge_s = references[max(0, int(np.argmax(moved)) - 1), 0]
        t = outputs[:, 0] - edge_s
        held = np.clip(np.searchsorted(references[:, 0], outputs[:, 0] + 1e-6, side="right") - 1, 0, None)
        scale = self._loop.outside(1.0)
        actuators[:, 0] -= edge_s
        return Taken(t, scale * (outputs[:, 1] - rest_r), scale * (references[held, 1] - rest_r), actuators)


def _in_order(rows: list[Any], width: int) -> Array:
    """In the order of their times, each time once: datagrams may arrive twice or in another order."""
    table = np.array(rows, dtype=float).reshape(-1, width)
    _, first = np.unique(table[:, 0], return_index=True)
    ordered: Array = table[first]
    return ordered
