"""The vehicle: plant, cascade and onboard logic behind one face, stepped by simulation time alone.

`advance` is a pure function of state, input and seed: the same seed and the same calls at the same simulation times
give the same bits. Nothing in here reads a clock, a socket or the environment.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from sitl.calm_array import ENERGY_J, POWER_W, calm_array, put_calm
from sitl.closed_loop import NOISE_COLUMNS, TRACE_COLUMNS, Controller, LoopState, Plant, knowing, start
from sitl.control.disturbance import Bandwidth
from sitl.control.gains import GAIN_NAMES, PerAxis, Settings, from_names
from sitl.control.guidance import Guidance
from sitl.estimation.alignment import aligned
from sitl.estimation.error_state import Tuning
from sitl.frames import GRAVITY_M_S2, standing
from sitl.geodesy import GeoPoint
from sitl.loop_arrays import (
    LOOP_SIZE,
    OBSERVED_SIZE,
    accuracy_of,
    guidance_array,
    loop_of,
    nav_of,
    observed_of,
    put_guidance,
    put_loop,
    rotors_of,
    run_in_place,
    state_of,
)
from sitl.model import battery
from sitl.model.airframe import Airframe
from sitl.model.airframe import description as airframe_description
from sitl.model.derivative import Load, by_cause
from sitl.model.derivative import loads as plant_loads
from sitl.model.failures import SOUND, Failures, heard
from sitl.model.rigid_body import State
from sitl.model.sensors import NOISES, PERFECT, TURN_ON, magnetometer, step_sensors, switched_on
from sitl.model.wind import Wind
from sitl.navigation import NavState
from sitl.onboard.commander import Commander
from sitl.onboard.declarations import declarations
from sitl.onboard.events import EventLog
from sitl.onboard.offboard import Offboard
from sitl.onboard.parameters import ParameterRefusal, Parameters
from sitl.onboard.plans import Plans
from sitl.onboard.store import MemoryStore, Store
from sitl.quaternion import Vec3, rotate_back
from sitl.records import packed
from sitl.snapshot import Battery, Snapshot
from sitl.strict_yaml import ConfigError
from sitl.tally import NOTHING, TICK_US, tally
from sitl.vehicle_spec import VehicleSpec, load_vehicle, vehicle_names, with_airframe

__all__ = ["DEFAULT_HOME", "TICK_US", "Load", "Vehicle", "load_vehicle", "vehicle_names", "with_airframe"]

DEFAULT_HOME = GeoPoint(55.6985, 37.3595, 190.0)  # Skolkovo, where the paper's vehicle was built
_NO_TRACE = np.zeros((0, len(TRACE_COLUMNS)))
Pilot = Callable[[float, NavState, Guidance], Guidance]
_NO_NOISE = np.zeros((0, NOISE_COLUMNS))
_NOISE_US = 4_000_000  # as long as noise is drawn for at once, where many steps are run at once
NOISE_STEPS = 250  # drawn at once where few are run: a call for ten costs a quarter more
_BATTERY_AHEAD_J = 1.0  # the battery is looked at so long before there is something to tell of it


class Vehicle:
    """One simulated YawSitter.

    spec: what kind (load_vehicle). home: where world N has its origin and the vehicle stands at start, belly to
    `heading_rad`. seed: of gusts and sensor noise. wind_N, gust_m_s: the air's motion [m/s]. store: where parameters
    and plan persist (None: nowhere). overrides: parameter values for this run. believed_airframe: what the
    controller takes the airframe to be (None: what it is). Raises ConfigError for an override that the parameter's
    declaration refuses.

    restless: ticks every time, even where a tick is known to change nothing: the same flight, only slower.
    tally, wanted: where a flight is summed up, see sitl.tally.
    pilot: asked before every control step, with the simulation time [s], the navigation state and what the onboard
    logic wants; what it returns is flown instead. Each step is then a crossing into compiled code of its own.
    """

    pilot: Pilot | None = None
    restless = False

    def __init__(
        self,
        spec: VehicleSpec,
        *,
        home: GeoPoint = DEFAULT_HOME,
        heading_rad: float = 0.0,
        seed: int = 1,
        wind_N: Vec3 = (0.0, 0.0, 0.0),
        gust_m_s: float = 0.0,
        store: Store | None = None,
        overrides: Mapping[str, float] | None = None,
        believed_airframe: Airframe | None = None,
    ) -> None:
        self._believed = believed_airframe or spec.airframe.airframe
        self.spec, self.seed, self.heading_rad = spec, seed, heading_rad
        self.step_us = spec.step_us
        self.now_us = 0
        self.events = EventLog()
        store = store if store is not None else MemoryStore()
        try:
            declared = declarations(spec.gains, spec.parameters)
        except KeyError as unknown:
            raise ConfigError(f"vehicle {spec.name}: parameters: {unknown.args[0]}: unknown parameter") from None
        self.parameters = Parameters(declared, store, spec.name, self.events)
        wind = {"SIM_WIND_N": wind_N[0], "SIM_WIND_E": wind_N[1], "SIM_WIND_D": wind_N[2], "SIM_GUST": gust_m_s}
        for name, value in {**wind, **(overrides or {})}.items():
            self._override(name, value)
        self.plans = Plans(self.parameters, store, self.events, home)
        self.mission = self.plans.mission
        full_N, hover_N = 2.0 * self._believed.thrust_max_N, self._believed.mass_kg * GRAVITY_M_S2
        self.offboard = Offboard(self.parameters, self.plans.geofence.objection, full_N, hover_N)
        self.commander = Commander(self.parameters, self.plans, self.offboard, self.events, heading_rad)
        self._gear = spec.airframe.gear
        self._failures = SOUND
        self.reset()

    def _override(self, name: str, value: float) -> None:
        refusal = self.parameters.preset(name, value)
        if refusal is None:
            return
        if refusal is ParameterRefusal.UNKNOWN:
            raise ConfigError(f"parameter {name}: unknown; `gcs param list` shows all {len(self.parameters.names)}")
        d = self.parameters.declaration(name)
        raise ConfigError(
            f"parameter {name}: {value:g} refused ({refusal.name.lower().replace('_', ' ')}): "
            f"allowed {d.minimum:g} … {d.maximum:g} {d.unit}".rstrip()
        )

    def reset(self) -> None:
        """Back to standing at the start point, motors off; simulation time, parameters and plan stay."""
        self._random = np.random.Generator(np.random.PCG64(self.seed))
        self.failures = SOUND
        self._controller: Controller | None = None
        self._build_constants()
        q = standing(self.heading_rad, self._gear.standing_pitch_rad)
        zero = (0.0, 0.0, 0.0)
        state = State(*zero, *zero, *q, *zero, 0.0, 0.0, 0.0, 0.0)
        self._loop_array = np.zeros(LOOP_SIZE)
        self._observed_array = np.zeros(OBSERVED_SIZE)
        put_loop(self._loop_array, self._standing(state))
        self._calm = calm_array(battery.IDLE_W)
        self.tally, self.wanted = tally(), NOTHING
        self._noise = _NO_NOISE  # drawn and not used yet
        self._snapshot: Snapshot | None = None
        self._snapshot_mark = -1
        self._next_tick_us = self.now_us
        self.commander.restart(self.heading_rad)
        self._guidance = self.commander.guidance
        self._flown, self._guidance_array = self._guidance, guidance_array(self._guidance)
        self._run(0, _NO_TRACE, self._guidance)

    @property
    def failures(self) -> Failures:
        """What has failed; it holds from the next control step on."""
        return self._failures

    @failures.setter
    def failures(self, failures: Failures) -> None:
        self._failures = failures
        self._generation = -1  # of the constants

    def _standing(self, state: State) -> LoopState:
        """The loop of a vehicle that stands in `state`, its sensors switched on and the filter aligned to them."""
        sensors, noise = self.spec.sensors, np.zeros(NOISES)
        if any(sensors):
            noise = self._random.standard_normal(NOISES)
        errors = switched_on(sensors, self._random.standard_normal(TURN_ON)) if any(sensors) else PERFECT
        felt = rotate_back((state.qw, state.qx, state.qy, state.qz), (0.0, 0.0, -GRAVITY_M_S2))
        errors = step_sensors(sensors, errors, (0.0, 0.0, 0.0), felt, noise, self.step_us * 1e-6)
        estimate = aligned(errors.accel_m_s2, magnetometer(sensors, errors, state, noise))
        assert self._controller is not None
        return start(self._controller, state, errors, estimate)

    def settings(self) -> Settings:
        """The cascade's settings as the parameters in force have them."""
        p, a = self.parameters, self._believed
        return Settings(
            feedforward_velocity=float(p["FF_VELOCITY"]),
            feedforward_acceleration=float(p["FF_ACCEL"]),
            feedforward_inverse=float(p["FF_INVERSE"]),
            quaternion_error=float(p["SYS_ATT_ERROR"]),
            velocity_max_m_s=p["MPC_XY_VEL_MAX"],
            acceleration_max_m_s2=p["CTL_ACC_MAX"],
            velocity_d_tau_s=p["CTL_VEL_D_TAU"],
            rate_d_tau_s=p["CTL_RATE_D_TAU"],
            motor_tau_s=self.spec.actuators.motor_tau_s,
            flap_tau_s=self.spec.actuators.flap_tau_s,
            disturbance=Bandwidth(p["CTL_DIST_F_BW"], p["CTL_DIST_M_BW"]),
            slipstream_floor_N=p["CTL_SLIP_FLOOR"] * a.mass_kg * GRAVITY_M_S2,
            thrust_floor_N=p["CTL_THR_FLOOR"],
            thrust_recover_N=p["CTL_THR_RECOVER"],
            braking_rad_s2=PerAxis(p["CTL_BRAKE_X"], p["CTL_BRAKE_Y"], p["CTL_BRAKE_Z"]),
            lean_max_rad=math.radians(p["MPC_TILTMAX_AIR"]),
        )

    def tuning(self) -> Tuning:
        """What the navigation filter believes of its sensors, as the parameters in force have it."""
        p = self.parameters
        return Tuning(
            gyro_noise_rad_s_rtHz=p["EST_GYR_NOISE"],
            accel_noise_m_s2_rtHz=p["EST_ACC_NOISE"],
            gyro_walk_rad_s2_rtHz=p["EST_GYR_WALK"],
            accel_walk_m_s3_rtHz=p["EST_ACC_WALK"],
            gnss_level_m=p["EST_GPS_P_NOISE"],
            gnss_height_m=p["EST_GPS_Z_NOISE"],
            gnss_velocity_m_s=p["EST_GPS_V_NOISE"],
            baro_m=p["EST_BARO_NOISE"],
            heading_rad=p["EST_MAG_NOISE"],
        )

    def _build_constants(self) -> None:
        """Plant and controller constants from the parameters in force; cheap to call where nothing changed."""
        p = self.parameters
        if p.generation == self._generation:
            return
        self._generation = p.generation
        self._energy_quiet_J = 0.0  # look at the battery at the next tick: its thresholds may be others
        a = self.spec.airframe.airframe
        wind = Wind(p["SIM_WIND_N"], p["SIM_WIND_E"], p["SIM_WIND_D"], p["SIM_GUST"])
        plant = Plant(a, self._gear, self.spec.actuators, self.spec.sensors, wind, self.spec.substeps, self._failures)
        gains = from_names({name: p[name] for name in GAIN_NAMES})
        estimating = float(p["EST_ENABLE"])
        if self._controller is not None and estimating > self._controller.estimating:  # switched on in flight
            self.loop = self.loop._replace(estimate=knowing(self.loop.state))
        controller = self._controller = Controller(self._believed, gains, self.settings(), estimating, self.tuning())
        self._noisy = wind.gust_m_s > 0.0 or any(self.spec.sensors)
        self._plants, self._controllers = packed(plant), packed(controller)

    @property
    def _estimating(self) -> bool:
        return self._controller is not None and self._controller.estimating > 0.0

    @property
    def controller(self) -> Controller:
        """All constants of the onboard side, from the parameters in force."""
        self._build_constants()
        assert self._controller is not None
        return self._controller

    @property
    def loop(self) -> LoopState:
        """Everything of plant and cascade that changes while flying."""
        return loop_of(self._loop_array)

    @loop.setter
    def loop(self, loop: LoopState) -> None:
        put_loop(self._loop_array, loop)

    def _run(self, steps: int, trace: np.ndarray[Any, np.dtype[np.float64]], guidance: Guidance) -> int:
        """Run so many steps, or as many as the calm in force lasts. Returns how many."""
        if guidance is not self._flown:
            if guidance.trajectory is self._flown.trajectory:
                put_guidance(self._guidance_array, guidance)
            else:
                self._guidance_array = guidance_array(guidance)
            self._flown = guidance
        noise = self._drawn(steps) if self._noisy and steps else _NO_NOISE
        run: int = run_in_place(
            self._plants, self._controllers, self._guidance_array, self._loop_array, noise, self.now_us, self.step_us,
            steps, trace, self._observed_array, self._calm, self.tally, self.wanted,
        )  # fmt: skip
        if noise is not _NO_NOISE:
            self._noise = noise[run:]
        self.now_us += run * self.step_us
        self.events.now_us = self.now_us
        self._nav, self._feet_down = nav_of(self._observed_array), int(self._observed_array[-1])
        return run

    def _drawn(self, steps: int) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Noise of so many steps at least: what is left of the last drawing, then new."""
        left = self._noise
        if len(left) >= steps:
            return left
        fresh = self._random.standard_normal((max(steps - len(left), NOISE_STEPS), NOISE_COLUMNS))
        return np.concatenate((left, fresh)) if len(left) else fresh

    def advance(self, until_us: int, trace: np.ndarray[Any, np.dtype[np.float64]] | None = None) -> None:
        """Run whole control steps up to simulation time `until_us`.

        Ticks of the onboard logic are passed over where it can tell that they change nothing, but not the last one.

        trace: (steps, len(TRACE_COLUMNS)) filled with a row for every control step of this call.
        """
        self._advance(until_us, trace, news=False)

    def advance_to_news(self, until_us: int, trace: np.ndarray[Any, np.dtype[np.float64]] | None = None) -> None:
        """As `advance`, but to the end of the first tick that tells something in `events`."""
        self._advance(until_us, trace, news=True)

    def _advance(self, until_us: int, trace: np.ndarray[Any, np.dtype[np.float64]] | None, news: bool) -> None:
        row, told = 0, self.events.next_number
        last_tick_us = (until_us - 2 * self.step_us) // TICK_US * TICK_US
        while until_us - self.now_us >= self.step_us:
            if news and self.events.next_number != told and self.now_us >= self._next_tick_us:
                break
            self._build_constants()
            due = self.now_us >= self._next_tick_us
            if due or self.commander.changed:
                self._guidance = self.commander.tick(self.now_us, self._nav, self._feet_down)
                if due:
                    self._next_tick_us = self.now_us - self.now_us % TICK_US + TICK_US
                    self._drain_battery()
            # where the control period does not divide the tick, the tick comes with the first step after it
            to_tick = -(-(self._next_tick_us - self.now_us) // self.step_us)
            steps = max(1, min((until_us - self.now_us) // self.step_us, to_tick))
            long = last_tick_us > self._next_tick_us
            if long:
                steps = self._calm_steps(steps, last_tick_us)
            guidance = self._guidance
            if self.pilot is not None:
                steps, guidance = 1, self.pilot(self.now_us * 1e-6, self._nav, guidance)
            row += self._run(steps, trace[row : row + steps] if trace is not None else _NO_TRACE, guidance)
            if long:
                put_calm(self._calm, None)
                if self.now_us >= self._next_tick_us + self.step_us:  # ticks were passed over
                    since_us = self.now_us % TICK_US
                    self._next_tick_us = self.now_us - since_us + (0 if since_us < self.step_us else TICK_US)
        self.commander.observe(self.now_us, self._nav, self._feet_down)

    def _calm_steps(self, steps: int, last_tick_us: int) -> int:
        """How many steps may be run at once instead of `steps`; lays down the calm that ends them."""
        calm = None if self.restless or self.pilot is not None else self.commander.calm()
        if calm is None or calm.until_us <= self._next_tick_us:
            return steps
        put_calm(self._calm, calm, self._feet_down, self._energy_quiet_J)
        end_us = min(last_tick_us, self._next_tick_us + _NOISE_US) if self._noisy else last_tick_us
        return max(steps, -(-(end_us - self.now_us) // self.step_us))

    def _drain_battery(self) -> None:
        left, right = rotors_of(self._loop_array)
        power_W = battery.drawn_W(self.spec.airframe.airframe.torque_coefficient, left, right)
        self._calm[POWER_W] = power_W
        energy_J = self._calm.item(ENERGY_J) + power_W * TICK_US * 1e-6
        self._calm[ENERGY_J] = energy_J
        if energy_J >= self._energy_quiet_J:
            self.commander.watch_battery(self._remaining)
            self._energy_quiet_J = self._quiet_until_J()

    def _quiet_until_J(self) -> float:
        """Before so much is drawn from the battery there is nothing to tell of it."""
        return battery.energy_J(self.commander.battery_lasts(self._remaining)) - _BATTERY_AHEAD_J

    @property
    def energy_J(self) -> float:
        """Drawn from the battery since it was switched on."""
        return self._calm.item(ENERGY_J)

    @property
    def _remaining(self) -> float:
        return battery.remaining(self.energy_J)

    def _battery(self) -> Battery:
        remaining = self._remaining
        voltage = battery.EMPTY_V + (battery.FULL_V - battery.EMPTY_V) * remaining
        return Battery(voltage, float(self._calm[POWER_W]) / voltage, remaining, battery.used_mAh(self.energy_J))

    def snapshot(self) -> Snapshot:
        """The vehicle now; built afresh only when time has moved or something has happened."""
        last = self._snapshot
        c, m, o = self.commander, self.mission, observed_of(self._observed_array)
        mark = self.events.next_number
        if last is not None and last.now_us == self.now_us and mark == self._snapshot_mark and not c.changed:
            return last
        self._snapshot_mark = mark
        self._snapshot = Snapshot(
            now_us=self.now_us,
            truth=state_of(self._loop_array),
            nav=o.nav,
            acceleration_B=o.specific_force_B,
            acceleration_N=o.acceleration_N,
            wind_N=o.wind_N,
            reference=o.reference,
            command=o.command,
            feet_down=o.feet_down,
            mode=c.mode,
            armed=c.armed,
            landed=c.landed,
            tipped_over=c.tipped_over,
            failsafe=c.failsafe,
            ready_to_arm=c.ready_to_arm().ok,
            origin=c.origin,
            home=c.home,
            home_N=c.home_N,
            home_heading_rad=c.home_heading_rad,
            mission_state=m.state,
            mission_current=m.current,
            mission_total=len(m.items),
            plan_id=m.plan_id,
            fence_id=self.plans.fence.plan_id,
            rally_id=self.plans.rally.plan_id,
            breach=c.geofence.breach,
            fenced=c.geofence.present,
            orbiting=c.guided.orbiting,
            gnss_heard=heard(self._failures.gnss, self.now_us),
            battery=self._battery(),
            nav_accuracy_m=accuracy_of(self._loop_array) if self._estimating else (0.0, 0.0),
        )
        return self._snapshot

    def loads(self) -> dict[str, Load]:
        """Forces and moments on the vehicle now, by cause."""
        wind_N = observed_of(self._observed_array).wind_N
        return by_cause(plant_loads(self.spec.airframe.airframe, self._gear, state_of(self._loop_array), wind_N))

    def description(self) -> dict[str, Any]:
        """What this vehicle is, as plain data: airframe with units and sources, gains, actuators, sensors."""
        spec = self.spec
        return {
            "name": spec.name,
            "description": spec.description,
            "airframe": airframe_description(spec.airframe),
            "gains": spec.gains_name,
            "actuators": spec.actuators._asdict(),
            "sensors": spec.sensors._asdict(),
            "control_rate_hz": spec.control_rate_hz,
            "seed": self.seed,
        }
