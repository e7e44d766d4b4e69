"""Gains: how soon a written gain acts, and what it does to a step response. In lockstep, so without chance in it.

Two vehicles fly the same flight to the same bit; one of them is sent a PARAM_SET between two control steps. The first
control step whose command differs is the first one that uses the gain.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.figure import Figure, told
from benchmarks.processes import BenchmarkError
from sitl.closed_loop import TRACE_COLUMNS
from sitl.mavlink import codec
from sitl.mavlink.codec import mav
from sitl.mavlink.endpoint import Endpoint, PortKind
from sitl.onboard.modes import Mode
from sitl.onboard.offboard import OffboardTarget
from sitl.vehicle import Vehicle, load_vehicle

VEHICLE = "yawsitter"
GAIN = "POS_X_P"
HEIGHT_M, STEP_M = 3.0, 1.0
RESPONSE_S = 10.0
TURN_US = 20_000
_STATE = slice(1, 18)
_COMMAND = slice(18, 33)


class Craft(NamedTuple):
    """A vehicle and its end of the link."""

    vehicle: Vehicle
    endpoint: Endpoint
    encoder: codec.Encoder

    def write(self, name: str, value: float) -> None:
        """A gain as PARAM_SET bytes, and its answer."""
        target = {"target_system": 1, "target_component": 1}
        kind = mav.MAV_PARAM_TYPE_REAL32
        frame = self.encoder.encode(
            codec.message("PARAM_SET", param_id=name, param_value=value, param_type=kind, **target)
        )
        wall_s = self.vehicle.now_us * 1e-6
        self.endpoint.receive(frame, ("127.0.0.1", 14540), PortKind.ONBOARD, wall_s)
        self.endpoint.poll(wall_s)
        if abs(self.vehicle.parameters[name] - value) > 1e-6:
            raise BenchmarkError(f"{name} = {value:g} was not taken")

    def trace(self, steps: int) -> NDArray[np.float64]:
        """A row a control step, columns TRACE_COLUMNS."""
        rows = np.zeros((steps, len(TRACE_COLUMNS)))
        self.vehicle.advance(self.vehicle.now_us + steps * self.vehicle.step_us, rows)
        return rows


def measure(quick: bool) -> Iterator[Figure]:
    steps = _steps_until_it_acts()
    yield Figure("gain written to the control step that uses it", "the next one", f"control step {steps}", steps == 1)
    gains = Vehicle(load_vehicle(VEHICLE)).parameters
    usual = gains[GAIN]
    for value in (usual, 0.5 * usual, 2.0 * usual):
        rise_s, overshoot_m, settled_s = _response(value)
        yield told(
            f"  step of {STEP_M:g} m north, {GAIN} = {value:.3g}",
            f"rise {rise_s:.2f} s, overshoot {100 * overshoot_m / STEP_M:.1f} %, within 2 % after {settled_s:.2f} s",
        )


def _hovering() -> Craft:
    vehicle = Vehicle(load_vehicle(VEHICLE))
    vehicle.advance(100_000)
    vehicle.commander.takeoff(vehicle.commander.origin.alt_amsl_m + HEIGHT_M)
    vehicle.commander.arm()
    vehicle.advance(12_000_000)
    if vehicle.commander.mode is not Mode.HOLD:
        raise BenchmarkError("the vehicle does not hover")
    return Craft(vehicle, Endpoint(vehicle), codec.Encoder(252, mav.MAV_COMP_ID_MISSIONPLANNER))


def _steps_until_it_acts() -> int:
    """1 for the very next control step after the PARAM_SET was taken in."""
    one, other = _hovering(), _hovering()
    for craft in (one, other):
        craft.vehicle.commander.guided.reposition((STEP_M, 0.0, -HEIGHT_M))
        craft.vehicle.advance(craft.vehicle.now_us + 507 * craft.vehicle.step_us)  # between two ticks, in mid-move
    if one.vehicle.snapshot().truth != other.vehicle.snapshot().truth:
        raise BenchmarkError("two flights alike are not the same")
    other.write(GAIN, 1.5 * one.vehicle.parameters[GAIN])
    before, after = one.trace(50), other.trace(50)
    differs = np.any(before[:, _COMMAND] != after[:, _COMMAND], axis=1)
    if not differs.any() or not np.array_equal(before[0, _STATE], after[0, _STATE]):
        raise BenchmarkError("the gain changes nothing")
    return int(np.argmax(differs)) + 1


def _response(value: float) -> tuple[float, float, float]:
    """Rise time from 10 to 90 %, overshoot in metres, and when it stays within 2 %, of a bare position step."""
    craft = _hovering()
    vehicle = craft.vehicle
    craft.write(GAIN, value)
    _stream(craft, 0.0, 2.0)
    rows = _stream(craft, STEP_M, RESPONSE_S)
    t, north = rows[:, 0] - rows[0, 0], rows[:, TRACE_COLUMNS.index("north_m")]
    if vehicle.commander.mode is not Mode.OFFBOARD:
        raise BenchmarkError("the step was not flown")
    rise_s = t[np.argmax(north >= 0.9 * STEP_M)] - t[np.argmax(north >= 0.1 * STEP_M)]
    outside = np.abs(north - STEP_M) > 0.02 * STEP_M
    settled_s = t[np.flatnonzero(outside)[-1]]
    return float(rise_s), float(max(0.0, north.max() - STEP_M)), float(settled_s)


def _stream(craft: Craft, north_m: float, seconds: float) -> NDArray[np.float64]:
    """Targets of position alone, 50 a second."""
    vehicle = craft.vehicle
    rows = []
    for _ in range(round(seconds * 1e6) // TURN_US):
        vehicle.offboard.submit(OffboardTarget(None, position_N=(north_m, 0.0, -HEIGHT_M)), vehicle.now_us)
        if vehicle.commander.mode is not Mode.OFFBOARD and not vehicle.offboard.lost(vehicle.now_us):
            vehicle.commander.set_mode(Mode.OFFBOARD)
        rows.append(craft.trace(TURN_US // vehicle.step_us))
    return np.concatenate(rows)
