"""Plant and cascade together: many control steps in one crossing from Python into compiled code."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.control.cascade import Command, Memory, at_rest, cascade, standing_command
from sitl.control.gains import Gains, Settings
from sitl.control.guidance import Guidance
from sitl.control.reference import Reference, sample
from sitl.jit import kernel
from sitl.model.airframe import Airframe, Gear
from sitl.model.derivative import ActuatorCommand, Actuators, loads, total
from sitl.model.integrate import step
from sitl.model.rigid_body import State, accelerations
from sitl.model.sensors import NOISES, Sensors, SensorState, observe, step_sensors
from sitl.model.wind import GustState, Wind, step_gusts, wind_velocity
from sitl.navigation import NavState
from sitl.quaternion import Vec3

NOISE_COLUMNS = 3 + NOISES  # gusts, then sensors
_OFF, _IDLE = 0, 1  # Effort.OFF, Effort.IDLE as plain numbers


class Plant(NamedTuple):
    """All constants of the physical side."""

    airframe: Airframe
    gear: Gear
    actuators: Actuators
    sensors: Sensors
    wind: Wind
    substeps: int  # Runge-Kutta steps in a control step


class Controller(NamedTuple):
    """All constants of the onboard side; `airframe` is what the controller believes the vehicle to be."""

    airframe: Airframe
    gains: Gains
    settings: Settings


class LoopState(NamedTuple):
    """Everything that changes while flying; the state after a step depends on nothing else but noise and guidance."""

    state: State
    gusts: GustState
    sensors: SensorState
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


TRACE_COLUMNS = (
    "t_s",
    *State._fields,
    *(f"command_{name}" for name in Command._fields),
    *(f"reference_{name}" for name in Reference._fields),
)


def start(controller: Controller, state: State) -> LoopState:
    """A loop at rest in the given state."""
    zero = (0.0, 0.0, 0.0)
    return LoopState(
        state,
        GustState(0.0, 0.0, 0.0, 0.0, 0.0),
        SensorState(zero, zero, zero, zero),
        at_rest(controller.airframe, controller.airframe.thrust_min_N),
    )


@kernel
def run(
    plants: Sequence[Plant],
    controllers: Sequence[Controller],
    guidance: Guidance,
    loop: LoopState,
    noise: NDArray[np.float64],
    start_us: int,
    dt_us: int,
    steps: int,
    trace: NDArray[np.float64],
) -> tuple[LoopState, Observed]:
    """`steps` control steps of `dt_us` from simulation time `start_us`.

    plants, controllers: one element each, from records.packed.
    noise: (steps, NOISE_COLUMNS) standard normal numbers, or (0, NOISE_COLUMNS): none.
    trace: (steps, len(TRACE_COLUMNS)) is filled with a row a step, or (0, …): no trace.
    """
    plant, controller = plants[0], controllers[0]
    s, gusts, errors, memory = loop.state, loop.gusts, loop.sensors, loop.memory
    dt_s = dt_us * 1e-6
    h_s = dt_s / plant.substeps
    wind_N = wind_velocity(plant.wind, gusts, -s.down_m)
    nav = observe(plant.sensors, errors, s)
    command = standing_command(nav, 0.0)
    reference = sample(guidance.trajectory, start_us * 1e-6)
    for k in range(steps):
        t_s = (start_us + k * dt_us) * 1e-6
        if noise.shape[0] > 0:
            n = noise[k]
            rn, re, rd = s.v_north_m_s - wind_N[0], s.v_east_m_s - wind_N[1], s.v_down_m_s - wind_N[2]
            speed = math.sqrt(rn * rn + re * re + rd * rd)
            gusts = step_gusts(plant.wind, gusts, -s.down_m, speed, (n[0], n[1], n[2]), dt_s)
            errors = step_sensors(
                plant.sensors,
                errors,
                (n[3], n[4], n[5], n[6], n[7], n[8], n[9], n[10], n[11], n[12], n[13], n[14]),
                dt_s,
            )
            wind_N = wind_velocity(plant.wind, gusts, -s.down_m)
        nav = observe(plant.sensors, errors, s)
        if guidance.effort == _OFF:
            command = standing_command(nav, 0.0)
            reference = sample(guidance.trajectory, t_s)
        elif guidance.effort == _IDLE:
            command = standing_command(nav, plant.airframe.thrust_min_N)
            reference = sample(guidance.trajectory, t_s)
        else:
            command, memory, reference = cascade(
                controller.airframe, controller.gains, controller.settings, guidance, memory, nav, t_s, dt_s
            )
        actuators = ActuatorCommand(
            command.thrust_left_N, command.thrust_right_N, command.flap_left_rad, command.flap_right_rad
        )
        if trace.shape[0] > 0:
            trace[k, 0] = t_s
            for i in range(17):
                trace[k, 1 + i] = s[i]
            for i in range(15):
                trace[k, 18 + i] = command[i]
            for i in range(14):
                trace[k, 33 + i] = reference[i]
        for _ in range(plant.substeps):
            s = step(plant.airframe, plant.gear, plant.actuators, s, actuators, wind_N, h_s)
    if guidance.effort <= _IDLE and steps > 0:
        memory = at_rest(controller.airframe, controller.airframe.thrust_min_N)
    acting = loads(plant.airframe, plant.gear, s, wind_N)
    force, moment = total(acting)
    linear, _ = accelerations(plant.airframe, s, force, moment)
    m = plant.airframe.mass_kg
    observed = Observed(
        observe(plant.sensors, errors, s),
        command,
        reference,
        wind_N,
        (force[0] / m, force[1] / m, force[2] / m),
        linear,
        acting.feet_down,
    )
    return LoopState(s, gusts, errors, memory), observed
