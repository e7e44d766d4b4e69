"""Plant and cascade together: many control steps in one crossing from Python into compiled code."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.control.cascade import Command, Memory, at_rest, cascade, direct_command, standing_command
from sitl.control.gains import Gains, Settings, settled
from sitl.control.guidance import Guidance
from sitl.control.reference import Reference, sample
from sitl.estimation.alignment import starting
from sitl.estimation.corrections import at_rest as stood
from sitl.estimation.corrections import with_baro, with_field, with_gnss
from sitl.estimation.error_state import Estimate, Tuning, copied, nav_of, predicted, spread
from sitl.frames import GRAVITY_M_S2
from sitl.jit import kernel
from sitl.model.airframe import Airframe, Gear, loaded
from sitl.model.derivative import ActuatorCommand, Actuators, Loads, loads, total
from sitl.model.failures import SOUND, Failures, followed, heard, misplaced_m
from sitl.model.integrate import apply_ideal_actuators, step_from
from sitl.model.rigid_body import State, accelerations
from sitl.model.sensors import (
    NOISES,
    PERFECT,
    Sensors,
    SensorState,
    baro,
    due,
    fitted,
    gnss,
    magnetometer,
    observe,
    step_sensors,
)
from sitl.model.wind import CALM, GustState, Wind, step_gusts, wind_velocity
from sitl.navigation import NavState
from sitl.quaternion import Vec3, rotate_back

Array = NDArray[np.float64]
NOISE_COLUMNS = 3 + NOISES  # gusts, then sensors
_OFF, _IDLE, _FLY, _DIRECT = 0, 1, 2, 3  # of Effort, as plain numbers
_COVARIANCE_HZ = 100.0
_STILL_RAD_S, _STILL_M_S2 = 0.1, 0.5  # readings of an IMU that stands, at most this far from rest


class Plant(NamedTuple):
    """All constants of the physical side."""

    airframe: Airframe
    gear: Gear
    actuators: Actuators
    sensors: Sensors
    wind: Wind
    substeps: int  # Runge-Kutta steps in a control step
    failures: Failures = SOUND


class Controller(NamedTuple):
    """All constants of the onboard side; `airframe` is what the controller believes the vehicle to be.

    estimating: 1.0 where the navigation state is the filter's estimate, 0.0 where it is the truth.
    """

    airframe: Airframe
    gains: Gains
    settings: Settings
    estimating: float
    tuning: Tuning


class LoopState(NamedTuple):
    """Everything that changes while flying; the state after a step depends on nothing else but noise and guidance."""

    state: State
    gusts: GustState
    sensors: SensorState
    estimate: Estimate
    memory: Memory


class Observed(NamedTuple):
    """The vehicle after the last step, for those who look at it."""

    nav: NavState
    command: Command
    reference: Reference
    wind_N: Vec3
    specific_force_B: Vec3  # what an accelerometer at the CM reads [m/s²]
    acceleration_N: Vec3  # [m/s²]
    feet_down: int


class Traced(NamedTuple):
    """The vehicle at the begin of one control step, and what the controller made of it."""

    t_s: float
    state: State
    command: Command
    reference: Reference
    nav: NavState
    wind_N: Vec3
    specific_force_B: Vec3  # as in Observed
    acceleration_N: Vec3
    acting: Loads


_VECTORS = ("wind_N", "specific_force_B", "acceleration_N", *Loads._fields[:-1])
TRACE_COLUMNS = (
    "t_s",
    *State._fields,
    *(f"command_{name}" for name in Command._fields),
    *(f"reference_{name}" for name in Reference._fields),
    *(f"nav_{name}" for name in NavState._fields),
    *(f"{name}_{axis}" for name in _VECTORS for axis in "xyz"),
    "feet_down",
)


def traced(row: Sequence[float]) -> Traced:
    """What a row of TRACE_COLUMNS says."""
    v = [(row[i], row[i + 1], row[i + 2]) for i in range(60, 102, 3)]
    return Traced(
        row[0], State(*row[1:18]), Command(*row[18:33]), Reference(*row[33:47]), NavState(*row[47:60]),
        v[0], v[1], v[2], Loads._make((*v[3:], int(row[102]))),
    )  # fmt: skip


def knowing(s: State) -> Estimate:
    """The estimate of a vehicle that knows its motion in state `s`, as uncertain as after an alignment."""
    q = (s.qw, s.qx, s.qy, s.qz)
    rates = (s.p_rad_s, s.q_rad_s, s.r_rad_s)
    force = rotate_back(q, (0.0, 0.0, -GRAVITY_M_S2))
    position, velocity = (s.north_m, s.east_m, s.down_m), (s.v_north_m_s, s.v_east_m_s, s.v_down_m_s)
    return starting(position, velocity, q, rates, force)


def start(
    controller: Controller, state: State, sensors: SensorState = PERFECT, estimate: Estimate | None = None
) -> LoopState:
    """A loop at rest in the given state; without an estimate the vehicle knows where it is."""
    return LoopState(
        state,
        CALM,
        sensors._replace(gyro_rad_s=(state.p_rad_s, state.q_rad_s, state.r_rad_s)),
        estimate if estimate is not None else knowing(state),
        at_rest(controller.airframe, controller.airframe.thrust_min_N),
    )


@kernel
def _standing(e: SensorState) -> bool:
    """Whether the IMU reads what it reads at rest."""
    w, f = e.gyro_rad_s, e.accel_m_s2
    turns = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    weight = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    return turns < _STILL_RAD_S and abs(weight - GRAVITY_M_S2) < _STILL_M_S2


@kernel
def _navigated(
    e: Estimate,
    t: Tuning,
    p: Sensors,
    receiver: float,
    errors: SensorState,
    s: State,
    noise: Array,
    off: bool,
    now_us: int,
    dt_us: int,
) -> Estimate:
    """The estimate one control step later, with every reading that is due.

    receiver: its failure. off: the motors are.
    """
    dt_s = dt_us * 1e-6
    e = predicted(e, errors.gyro_rad_s, errors.accel_m_s2, dt_s)
    if due(_COVARIANCE_HZ, now_us, dt_us):
        spread(e, t, max(1.0 / _COVARIANCE_HZ, dt_s))
        if off and _standing(errors):
            e = stood(e, t, dt_s)
    if due(p.gnss_rate_Hz, now_us, dt_us) and heard(receiver, now_us):
        fix = gnss(p, errors, s, noise)
        north, east, down = fix.position_N
        e = with_gnss(e, t, (north + misplaced_m(receiver), east, down), fix.velocity_N)
    if due(p.baro_rate_Hz, now_us, dt_us):
        e = with_baro(e, t, baro(p, errors, s, noise))
    if due(p.mag_rate_Hz, now_us, dt_us):
        e = with_field(e, t, magnetometer(p, errors, s, noise))
    return e


@kernel
def _motion(a: Airframe, s: State, acting: Loads) -> tuple[Vec3, Vec3]:
    """The specific force in B and the acceleration in N that come of the loads [m/s²]."""
    force, moment = total(acting)
    linear, _ = accelerations(a, s, force, moment)
    m = a.mass_kg
    return (force[0] / m, force[1] / m, force[2] / m), linear


@kernel
def _trace(
    airframe: Airframe,
    gear: Gear,
    s: State,
    command: Command,
    reference: Reference,
    nav: NavState,
    wind_N: Vec3,
    t_s: float,
    row: Array,
) -> None:
    """Fill one row of TRACE_COLUMNS."""
    a = loads(airframe, gear, s, wind_N)
    specific_force, linear = _motion(airframe, s, a)
    row[0] = t_s
    for i in range(17):
        row[1 + i] = s[i]
    for i in range(15):
        row[18 + i] = command[i]
    for i in range(14):
        row[33 + i] = reference[i]
    for i in range(13):
        row[47 + i] = nav[i]
    vectors = (
        wind_N, specific_force, linear, a.gravity_force, a.thrust_force, a.thrust_moment, a.side_force, a.wing_force,
        a.wing_moment, a.flap_force, a.flap_moment, a.drag_force, a.ground_force, a.ground_moment,
    )  # fmt: skip
    for i in range(14):
        for j in range(3):
            row[60 + 3 * i + j] = vectors[i][j]
    row[102] = a.feet_down


@kernel
def run(
    plants: Sequence[Plant],
    controllers: Sequence[Controller],
    guidance: Guidance,
    loop: LoopState,
    noise: Array,
    start_us: int,
    dt_us: int,
    steps: int,
    trace: Array,
) -> tuple[LoopState, Observed]:
    """`steps` control steps of `dt_us` from simulation time `start_us`.

    plants, controllers: one element each, from records.packed.
    noise: (steps, NOISE_COLUMNS) standard normal numbers, or (0, NOISE_COLUMNS): none.
    loop: its covariance is left as it is; the returned one is another.
    trace: (steps, len(TRACE_COLUMNS)) is filled with a row a step, or (0, …): no trace.
    """
    own = LoopState(loop.state, loop.gusts, loop.sensors, copied(loop.estimate), loop.memory)
    return run_on(plants, controllers, guidance, own, noise, start_us, dt_us, steps, trace)


@kernel
def run_on(
    plants: Sequence[Plant],
    controllers: Sequence[Controller],
    guidance: Guidance,
    loop: LoopState,
    noise: Array,
    start_us: int,
    dt_us: int,
    steps: int,
    trace: Array,
) -> tuple[LoopState, Observed]:
    """`run`, but the covariance is `loop`'s own, changed in place."""
    plant, controller = plants[0], controllers[0]
    airframe, believed = loaded(plant.airframe), loaded(controller.airframe)
    settings, sensors = settled(controller.settings), fitted(plant.sensors)
    s, gusts, errors, memory = loop.state, loop.gusts, loop.sensors, loop.memory
    estimating, noisy = controller.estimating > 0.0, noise.shape[0] > 0
    gusty = noisy and plant.wind.gust_m_s > 0.0
    estimate, lag = loop.estimate, plant.actuators
    # what acts at a step's end acts at the next one's begin, unless the wind changes or an actuator jumps between
    known, lagging = False, lag.motor_tau_s > 0.0 and lag.flap_tau_s > 0.0
    quiet = np.zeros(NOISES)
    dt_s = dt_us * 1e-6
    h_s = dt_s / plant.substeps
    wind_N = wind_velocity(plant.wind, gusts, -s.down_m)
    nav = nav_of(estimate) if estimating else observe(sensors, errors, s)
    command = standing_command(nav, 0.0)
    reference = sample(guidance.trajectory, start_us * 1e-6)
    for k in range(steps):
        t_s = (start_us + k * dt_us) * 1e-6
        if gusty:
            n = noise[k]
            rn, re, rd = s.v_north_m_s - wind_N[0], s.v_east_m_s - wind_N[1], s.v_down_m_s - wind_N[2]
            speed = math.sqrt(rn * rn + re * re + rd * rd)
            gusts = step_gusts(plant.wind, gusts, -s.down_m, speed, (n[0], n[1], n[2]), dt_s)
            wind_N = wind_velocity(plant.wind, gusts, -s.down_m)
        nav = nav_of(estimate) if estimating else observe(sensors, errors, s)
        if guidance.effort == _OFF:
            command = standing_command(nav, 0.0)
            reference = sample(guidance.trajectory, t_s)
        elif guidance.effort == _IDLE:
            command = standing_command(nav, airframe.thrust_min_N)
            reference = sample(guidance.trajectory, t_s)
        elif guidance.effort == _DIRECT:
            command = direct_command(airframe, nav, guidance.actuation)
            reference = sample(guidance.trajectory, t_s)
        else:
            command, memory, reference = cascade(believed, controller.gains, settings, guidance, memory, nav, t_s, dt_s)
        actuators = ActuatorCommand(
            command.thrust_left_N, command.thrust_right_N, command.flap_left_rad, command.flap_right_rad
        )
        if trace.shape[0] > 0:
            _trace(airframe, plant.gear, s, command, reference, nav, wind_N, t_s, trace[k])
        for _ in range(plant.substeps):
            driven = followed(plant.failures, airframe, s, actuators)
            s = apply_ideal_actuators(airframe, lag, s, driven)
            if not known:
                acting = loads(airframe, plant.gear, s, wind_N)
            force, moment = total(acting)
            s = step_from(airframe, plant.gear, lag, s, driven, wind_N, h_s, force, moment)
            known = False
        if estimating or noisy:
            felt = (0.0, 0.0, 0.0)
            if estimating:
                acting = loads(airframe, plant.gear, s, wind_N)
                felt, _ = _motion(airframe, s, acting)
                known = lagging and not gusty
            n = noise[k, 3:] if noisy else quiet
            errors = step_sensors(sensors, errors, (s.p_rad_s, s.q_rad_s, s.r_rad_s), felt, n, dt_s)
            if estimating:
                off, receiver = guidance.effort == _OFF, plant.failures.gnss
                now_us = start_us + (k + 1) * dt_us
                estimate = _navigated(estimate, controller.tuning, sensors, receiver, errors, s, n, off, now_us, dt_us)
    if guidance.effort != _FLY and steps > 0:
        memory = at_rest(believed, believed.thrust_min_N)
    if not known:
        acting = loads(airframe, plant.gear, s, wind_N)
    specific_force, linear = _motion(airframe, s, acting)
    observed = Observed(
        nav_of(estimate) if estimating else observe(sensors, errors, s),
        command,
        reference,
        wind_N,
        specific_force,
        linear,
        acting.feet_down,
    )
    return LoopState(s, gusts, errors, estimate, memory), observed
