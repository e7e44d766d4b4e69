"""Beyond the paper: flights where its evaluation doesn't look, each flown in lockstep.

Pure functions of craft and seed that return plain numbers, of the true position; the smaller the better, and inf where
the flight was lost.
"""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sitl.closed_loop import NOISE_COLUMNS, TRACE_COLUMNS, Controller, Plant, knowing, run, start
from sitl.control.guidance import Effort, Guidance
from sitl.control.reference import rest_at
from sitl.frames import quaternion_to_yxz, standing
from sitl.model.rigid_body import State
from sitl.model.sensors import TURN_ON, switched_on
from sitl.model.wind import Wind
from sitl.onboard.modes import Mode
from sitl.onboard.offboard import OffboardTarget
from sitl.quaternion import Vec3, multiply
from sitl.records import packed
from sitl.reproduce.cases import MISSIONS, Case, Craft, Values
from sitl.reproduce.fly import FlightError, fly
from sitl.reproduce.printed import OVERALL
from sitl.vehicle import Vehicle, load_vehicle, with_airframe
from sitl.vehicle_spec import VehicleSpec

Array = NDArray[np.float64]
AXES = ("x", "y", "z")
ANGLES_DEG = (30, 60, 90, 120, 150, 170, -30, -60, -90, -120, -150, -170)
WIND_N, GUST_M_S = (2.0, 0.0, 0.0), 1.0
STEP_M, STEP_LASTS_S = 3.0, 10.0
STILL: Vec3 = (0.0, 0.0, 0.0)
BODY_AXES: tuple[Vec3, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
# between the body axes, and 3° beside the pitch axis: where a turn that starts nearly straight can go astray
OBLIQUE_AXES: tuple[Vec3, ...] = (
    (1.0, 1.0, 0.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.0), (0.0, 1.0, -1.0), (1.0, 1.0, 1.0), (0.0, 1.0, 0.0524),
)  # fmt: skip
DRIFTS: tuple[Vec3, ...] = ((5.0, 0.0, 0.0), (-5.0, 0.0, 0.0), (0.0, 5.0, 0.0))
_HEIGHT_M, _RECOVERY_HEIGHT_M, _RECOVERY_S = 5.0, 20.0, 10.0
_CLIMB_S, _HOVER_S, _QUARTER_TURN_S = 15.0, 60.0, 6.0
_STREAM_US, _READY_S = 20_000, 2.0
_WAYS = (1.0, 1.0, -1.0)
_ATTITUDE = slice(TRACE_COLUMNS.index("qw"), TRACE_COLUMNS.index("qz") + 1)
_LOST = math.inf


def _mission_errors(case: Case, figure: str) -> Vec3:
    """A figure of a flight per axis; inf where it was lost."""
    try:
        x, y, z = fly(case).true[figure]
    except FlightError:
        return _LOST, _LOST, _LOST
    return x, y, z


def model_error(plant: Values, craft: Craft, seed: int) -> tuple[float, ...]:
    """The greatest MAE of each mission as a share of print, in a plant that the controller doesn't know."""
    shares = []
    for mission in MISSIONS:
        mae = _mission_errors(Case("model-error", mission, craft.vehicle, seed, craft.overrides, plant), "mae")
        shares.append(max(m / p for m, p in zip(mae, OVERALL[mission]["mae"], strict=True)))
    return tuple(shares)


def windy_rectangle(craft: Craft, seed: int) -> tuple[float, ...]:
    """The greatest RMS error [m] of an axis."""
    case = Case("wind", "rectangle", craft.vehicle, seed, craft.overrides, wind_N=WIND_N, gust_m_s=GUST_M_S)
    return (max(_mission_errors(case, "rmse")),)


def hovering(
    craft: Craft,
    seed: int,
    *,
    wind_N: Vec3 = STILL,
    gust_m_s: float = 0.0,
    plant: Values = (),
    believed: Values = (),
) -> Vehicle:
    """A vehicle that has climbed to 5 m above its origin and holds there. Raises FlightError where it doesn't."""
    spec, belief = with_airframe(load_vehicle(craft.vehicle), dict(plant), dict(believed))
    v = Vehicle(
        spec,
        seed=seed,
        wind_N=wind_N,
        gust_m_s=gust_m_s,
        overrides=dict(craft.overrides),
        believed_airframe=belief,
    )
    v.advance(100_000)
    v.commander.takeoff(v.commander.origin.alt_amsl_m + _HEIGHT_M)
    v.commander.arm()
    v.advance(v.now_us + round(_CLIMB_S * 1e6))
    if v.commander.mode is not Mode.HOLD:
        raise FlightError(f"{craft.vehicle}: does not hover after {_CLIMB_S:g} s")
    return v


def _flown(vehicle: Vehicle, seconds: float) -> Array:
    """A row of TRACE_COLUMNS for every control step of a flight that goes on."""
    steps = round(seconds * 1e6) // vehicle.step_us
    trace = np.zeros((steps, len(TRACE_COLUMNS)))
    vehicle.advance(vehicle.now_us + steps * vehicle.step_us, trace)
    return trace


def _away(trace: Array) -> Array:
    """(n, 3) true position from the hover point [m]."""
    away: Array = trace[:, 1:4] - (0.0, 0.0, -_HEIGHT_M)
    return away


def windy_hover(craft: Craft, seed: int) -> tuple[float, ...]:
    """The greatest RMS error [m] of an axis over a minute."""
    try:
        away = _away(_flown(hovering(craft, seed, wind_N=WIND_N, gust_m_s=GUST_M_S), _HOVER_S))
    except FlightError:
        return (_LOST,)
    return (float(np.sqrt(np.mean(away**2, axis=0)).max()),)


def full_turn(craft: Craft, seed: int) -> tuple[float, ...]:
    """The greatest distance [m] from the hover point during four quarter turns of the heading."""
    try:
        v = hovering(craft, seed)
    except FlightError:
        return (_LOST,)
    worst = 0.0
    for quarter in range(1, 5):
        v.commander.guided.reposition((math.nan, math.nan, math.nan), 0.5 * math.pi * quarter)
        worst = max(worst, float(np.linalg.norm(_away(_flown(v, _QUARTER_TURN_S)), axis=1).max()))
    return (worst,)


def _stepped(v: Vehicle, axis: int) -> Array:
    """The trace from a 3 m step of bare position targets on, 50 a second: north, east or up. Raises FlightError."""
    traces = []
    for k in range(-round(_READY_S * 1e6) // _STREAM_US, round(STEP_LASTS_S * 1e6) // _STREAM_US):
        target = [0.0, 0.0, -_HEIGHT_M]
        if k >= 0:
            target[axis] += _WAYS[axis] * STEP_M
        v.offboard.submit(OffboardTarget(None, position_N=(target[0], target[1], target[2])), v.now_us)
        if v.commander.mode is not Mode.OFFBOARD and not v.offboard.lost(v.now_us):
            v.commander.set_mode(Mode.OFFBOARD)
        trace = _flown(v, _STREAM_US * 1e-6)
        if k >= 0:
            traces.append(trace)
    if v.commander.mode is not Mode.OFFBOARD:
        raise FlightError("the step was not flown")
    return np.concatenate(traces)


def step_response(craft: Craft, axis: int, seed: int) -> Array:
    """(n, 2) time since a 3 m step, and how much of it is done (0 … 1 and beyond). Raises FlightError."""
    trace = _stepped(hovering(craft, seed), axis)
    return np.column_stack((trace[:, 0] - trace[0, 0], _away(trace)[:, axis] / (_WAYS[axis] * STEP_M)))


def heading_kick(craft: Craft, plant: Values, believed: Values, seed: int = 1) -> float:
    """How far [°] the heading turns at most in a 3 m step east, which takes the greatest differences of thrust."""
    try:
        trace = _stepped(hovering(craft, seed, plant=plant, believed=believed), 1)
    except FlightError:
        return _LOST
    return math.degrees(max(abs(quaternion_to_yxz(*q)[0]) for q in trace[:, _ATTITUDE].tolist()))


def step(axis: int, craft: Craft, seed: int) -> tuple[float, ...]:
    """(overshoot [%], time [s] after which it stays within 2 %) of a 3 m step."""
    try:
        t, done = step_response(craft, axis, seed).T
    except FlightError:
        return _LOST, _LOST
    outside = np.flatnonzero(np.abs(done - 1.0) > 0.02)
    settled = _LOST if outside[-1] == t.size - 1 else float(t[outside[-1]])
    return 100.0 * max(0.0, float(done.max()) - 1.0), settled


@cache
def _thrown(craft: Craft) -> tuple[VehicleSpec, Plant, Controller]:
    spec = load_vehicle(craft.vehicle)
    a = spec.airframe
    plant = Plant(a.airframe, a.gear, spec.actuators, spec.sensors, Wind(0.0, 0.0, 0.0, 0.0), spec.substeps)
    return spec, plant, Vehicle(spec, overrides=dict(craft.overrides)).controller


def excursion(craft: Craft, axis_B: Vec3, degrees: float, velocity: Vec3, seed: int = 1) -> tuple[float, float]:
    """(greatest, last) distance [m] from the point to be held, over 10 s from a start turned about an axis in B.

    It begins 20 m up, at rest in the air or drifting, motors off; a filter knows the state and its sensors' biases.
    """
    spec, plant, controller = _thrown(craft)
    half, length = math.radians(degrees) / 2, math.hypot(*axis_B)
    x, y, z = (math.sin(half) * c / length for c in axis_B)
    q = multiply(standing(0.0, plant.gear.standing_pitch_rad), (math.cos(half), x, y, z))
    state = State(0.0, 0.0, -_RECOVERY_HEIGHT_M, *velocity, *q, *([0.0] * 7))
    steps = round(_RECOVERY_S * spec.control_rate_hz)
    random = np.random.Generator(np.random.PCG64(seed))
    errors = switched_on(spec.sensors, random.standard_normal(TURN_ON))
    known = knowing(state)._replace(
        gyro_bias=errors.gyro_bias, accel_bias=errors.accel_bias, baro_offset_m=errors.baro_wander
    )
    noise = random.standard_normal((steps if any(spec.sensors) else 0, NOISE_COLUMNS))
    trace = np.zeros((steps, len(TRACE_COLUMNS)))
    guidance = Guidance(int(Effort.FLY), rest_at(0.0, 0.0, -_RECOVERY_HEIGHT_M, 0.0))
    begin = start(controller, state, errors, known)
    run(packed(plant), packed(controller), guidance, begin, noise, 0, spec.step_us, steps, trace)
    away = np.linalg.norm(trace[:, 1:4] - (0.0, 0.0, -_RECOVERY_HEIGHT_M), axis=1)
    if not np.isfinite(away).all():
        return _LOST, _LOST
    return float(away.max()), float(away[-1])


def excursions(craft: Craft, seed: int = 1) -> Array:
    """(3, angles) greatest distance [m] from a start at rest, by body axis and angle."""
    return np.array([[excursion(craft, axis, d, STILL, seed)[0] for d in ANGLES_DEG] for axis in BODY_AXES])


def recovery(axes: tuple[Vec3, ...], velocities: tuple[Vec3, ...], craft: Craft, seed: int) -> tuple[float, ...]:
    """The greatest excursion [m] over all angles, axes and velocities."""
    return (max(excursion(craft, axis, d, v, seed)[0] for axis in axes for d in ANGLES_DEG for v in velocities),)
