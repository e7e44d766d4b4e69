"""Every parameter of the vehicle: name, unit, range, default, group and meaning, said once.

Names that PX4 has mean here what they mean there. The 36 gains are {POS,VEL,ATT,RATE}_{X,Y,Z}_{P,I,D}; they differ in
name only by loop, axis and the last letter, and never change their names again.
"""

from collections.abc import Mapping, Sequence

from sitl.onboard.parameters import Declaration

_AXES = {
    "POS": {"X": "north", "Y": "east", "Z": "down"},
    "VEL": {"X": "north", "Y": "east", "Z": "down"},
    "ATT": {
        "X": "paper's roll φ about the nose: MAVLink minus yaw in hover",
        "Y": "paper's pitch θ: MAVLink pitch in hover",
        "Z": "paper's yaw ψ, by differential thrust: MAVLink roll in hover",
    },
    "RATE": {
        "X": "roll rate P about the nose: MAVLink minus yawspeed in hover",
        "Y": "pitch rate Q: MAVLink pitchspeed in hover",
        "Z": "yaw rate R, by differential thrust: MAVLink rollspeed in hover",
    },
}
_LOOPS = {
    "POS": ("position error to velocity", {"P": "1/s", "I": "1/s^2", "D": ""}, 100.0),
    "VEL": ("velocity error to acceleration", {"P": "1/s", "I": "1/s^2", "D": ""}, 100.0),
    "ATT": ("attitude error to body rate", {"P": "1/s", "I": "1/s^2", "D": ""}, 100.0),
    "RATE": ("body rate error to moment", {"P": "N.m.s", "I": "N.m", "D": "N.m.s^2"}, 10.0),
}
_TERMS = {"P": "Proportional", "I": "Integral", "D": "Derivative"}


def _gains(defaults: Mapping[str, float]) -> list[Declaration]:
    return [
        Declaration(
            f"{loop}_{axis}_{term}", False, defaults[f"{loop}_{axis}_{term}"], 0.0, highest, units[term],
            f"Gains {loop}", f"{_TERMS[term]} gain, {what}, {axis} axis", f"Axis {axis}: {_AXES[loop][axis]}.",
        )
        for loop, (what, units, highest) in _LOOPS.items()
        for axis in "XYZ"
        for term in "PID"
    ]  # fmt: skip


def _real(
    name: str,
    default: float,
    low: float,
    high: float,
    unit: str,
    group: str,
    short: str,
    long: str = "",
    kept: bool = True,
) -> Declaration:
    return Declaration(name, False, default, low, high, unit, group, short, long, persistent=kept)


def _choice(name: str, default: int, group: str, short: str, values: tuple[tuple[int, str], ...]) -> Declaration:
    numbers = [number for number, _ in values]
    return Declaration(name, True, default, min(numbers), max(numbers), "", group, short, values=values)


def _told(name: str, is_int: bool, value: float, unit: str, short: str) -> Declaration:
    """What ground stations read under PX4's dialect before they call a vehicle set up; it can't be changed."""
    group, most = "Compatibility (read-only)", 2.0 * value
    return Declaration(name, is_int, value, 0.0, most, unit, group, short, read_only=True, persistent=False)


_OFF_ON = ((0, "off"), (1, "on"))
_LOSS_ACTIONS = ((3, "Return"), (4, "Land"), (5, "Hold"))

_TABLE = (
    # flight limits of the trajectory generator
    _real("MPC_XY_CRUISE", 3.0, 0.1, 10.0, "m/s", "Flight", "Horizontal cruise speed"),
    _real("MPC_XY_VEL_MAX", 6.0, 0.5, 20.0, "m/s", "Flight", "Largest velocity command, each axis"),
    _real("MPC_Z_V_AUTO_UP", 2.0, 0.1, 5.0, "m/s", "Flight", "Climb speed"),
    _real("MPC_Z_V_AUTO_DN", 1.0, 0.1, 4.0, "m/s", "Flight", "Descent speed"),
    _real("MPC_LAND_SPEED", 0.5, 0.1, 2.0, "m/s", "Flight", "Descent speed near the ground"),
    _real("MPC_ACC_HOR", 1.2, 0.1, 5.0, "m/s^2", "Flight", "Horizontal acceleration"),
    _real("MPC_ACC_UP_MAX", 2.0, 0.1, 5.0, "m/s^2", "Flight", "Upward acceleration"),
    _real("MPC_ACC_DOWN_MAX", 1.0, 0.1, 5.0, "m/s^2", "Flight", "Downward acceleration"),
    _real("MPC_JERK_AUTO", 4.0, 0.5, 50.0, "m/s^3", "Flight", "Jerk"),
    _real("MPC_YAWRAUTO_MAX", 45.0, 5.0, 180.0, "deg/s", "Flight", "Heading rate"),
    _real("MPC_TILTMAX_AIR", 52.0, 5.0, 60.0, "deg", "Flight", "Largest tilt of the thrust from the vertical"),
    # missions and modes
    _real("MIS_TAKEOFF_ALT", 2.5, 0.5, 120.0, "m", "Mission", "Take-off height above home where none is given"),
    _real("NAV_ACC_RAD", 0.5, 0.05, 50.0, "m", "Mission", "Acceptance radius of a waypoint that gives none"),
    _choice("RTL_TYPE", 0, "Mission", "Where Return leads: to the nearest of",
            ((0, "home and the rally points"), (1, "home, the rally points and the mission's landing"))),
    _real("RTL_RETURN_ALT", 5.0, 1.0, 150.0, "m", "Mission", "Least height above home on the way back"),
    _real("RTL_DESCEND_ALT", 3.0, 0.5, 100.0, "m", "Mission", "Height above home at which to wait before landing"),
    _real("RTL_LAND_DELAY", 0.0, -1.0, 300.0, "s", "Mission", "Wait before landing; 0: none, negative: for ever"),
    # the fence
    _choice("GF_ACTION", 2, "Fence", "Action when the vehicle leaves the fence",
            ((0, "none"), (1, "warning"), (2, "Hold"), (3, "Return"), (4, "terminate"), (5, "Land"))),
    _real("GF_MAX_HOR_DIST", 0.0, 0.0, 10000.0, "m", "Fence", "Largest distance from home; 0: no limit"),
    _real("GF_MAX_VER_DIST", 0.0, 0.0, 10000.0, "m", "Fence", "Largest height above home; 0: no limit"),
    _choice("GF_PREDICT", 0, "Fence", "Act when the vehicle could no longer halt within the fence", _OFF_ON),
    # what happens when something goes missing
    _real("COM_OF_LOSS_T", 0.5, 0.1, 60.0, "s", "Failsafe", "Age of lost offboard targets (simulation time)"),
    _choice("COM_OBL_RC_ACT", 5, "Failsafe", "Action when offboard targets are lost", _LOSS_ACTIONS),
    _real("COM_DL_LOSS_T", 10.0, 1.0, 300.0, "s", "Failsafe", "Silence of lost ground stations (wall time)"),
    _choice("NAV_DLL_ACT", 0, "Failsafe", "Action when all ground stations are lost",
            ((0, "none"), (1, "Hold"), (2, "Return"), (3, "Land"))),
    _real("COM_DISARM_LAND", 2.0, 0.0, 60.0, "s", "Failsafe", "Time on the ground until disarming after a landing"),
    _real("COM_RC_LOSS_T", 0.5, 0.1, 10.0, "s", "Failsafe", "Age of lost stick inputs (simulation time)"),
    _choice("NAV_RCL_ACT", 1, "Failsafe", "Action when stick inputs are lost",
            ((1, "Hold"), (2, "Return"), (3, "Land"))),
    _choice("COM_LOW_BAT_ACT", 0, "Failsafe", "Action when the battery is empty",
            ((0, "warning"), (2, "Land at the critical level"),
             (3, "Return at the critical level, Land at the emergency level"))),
    _real("BAT_LOW_THR", 0.15, 0.0, 1.0, "", "Failsafe", "Share of the battery below which it is low"),
    _real("BAT_CRIT_THR", 0.07, 0.0, 1.0, "", "Failsafe", "Share of the battery that is critical"),
    _real("BAT_EMERGEN_THR", 0.05, 0.0, 1.0, "", "Failsafe", "Share of the battery that is an emergency"),
    # what QGroundControl asks of a PX4 vehicle's airframe, sticks and battery (its vehicle setup reads these names)
    _told("SYS_AUTOSTART", True, 1102, "", "PX4's number for a simulated tail-sitter; nothing depends on it"),
    _told("COM_RC_IN_MODE", True, 1, "", "Sticks come as MANUAL_CONTROL, not from a radio"),
    _told("BAT1_N_CELLS", True, 3, "", "Cells of the simulated battery in series"),
    _told("BAT1_V_CHARGED", False, 4.2, "V", "Voltage of a full cell"),
    _told("BAT1_V_EMPTY", False, 3.5, "V", "Voltage of an empty cell"),
    _told("BAT1_CAPACITY", False, 2200.0, "mAh", "Charge of the simulated battery"),
    # the cascade beside its gains
    _choice("SYS_ATT_ERROR", 1, "Cascade", "Attitude error", ((0, "paper's YXZ angles"), (1, "quaternion"))),
    _choice("FF_VELOCITY", 1, "Cascade", "Feed-forward of the reference's velocity", _OFF_ON),
    _choice("FF_ACCEL", 1, "Cascade", "Feed-forward of the reference's acceleration", _OFF_ON),
    _choice("FF_INVERSE", 1, "Cascade", "Feed-forward of attitude rates from the trim's inverse model", _OFF_ON),
    _real("CTL_ACC_MAX", 8.0, 0.5, 9.0, "m/s^2", "Cascade", "Largest acceleration command"),
    _real("CTL_VEL_D_TAU", 0.05, 0.0, 1.0, "s", "Cascade", "Filter of the velocity loop's derivative; 0: none"),
    _real("CTL_RATE_D_TAU", 0.0, 0.0, 1.0, "s", "Cascade", "Filter of the rate loop's derivative; 0: no derivative",
          "The printed rate derivative diverges unless it is filtered (loop gain 3 to 20) and is off by default."),
    _real("CTL_SLIP_FLOOR", 1.0, 0.1, 2.0, "", "Cascade", "Least flap pressure believed, as a share of hover's",
          "The paper keeps the slipstream estimate from falling below hover's."),
    _real("CTL_THR_FLOOR", 5.0, 1.0, 8.0, "N", "Cascade", "Least total thrust in flight",
          "The flaps live in the slipstream."),
    _real("CTL_THR_RECOVER", 22.0, 1.0, 22.0, "N", "Cascade", "Least total thrust while the nose is far off target"),
    _real("CTL_BRAKE_X", 40.0, 1.0, 200.0, "rad/s^2", "Cascade", "Angular acceleration to brake a turn with, X axis"),
    _real("CTL_BRAKE_Y", 25.0, 1.0, 200.0, "rad/s^2", "Cascade", "Angular acceleration to brake a turn with, Y axis"),
    _real("CTL_BRAKE_Z", 45.0, 1.0, 200.0, "rad/s^2", "Cascade", "Angular acceleration to brake a turn with, Z axis"),
    _real("CTL_DIST_F_BW", 3.0, 0.0, 50.0, "rad/s", "Cascade", "Bandwidth of the observer of disturbing forces; 0: off",
          "What wind and model errors do to the acceleration is taken off the demanded force."),
    _real("CTL_DIST_M_BW", 10.0, 0.0, 100.0, "rad/s", "Cascade",
          "Bandwidth of the observer of disturbing moments; 0: off"),
    # the navigation filter
    _choice("EST_ENABLE", 0, "Estimator", "Navigation state",
            ((0, "truth, with the gyro's noise on the rates"), (1, "estimate from the sensors"))),
    _real("EST_GYR_NOISE", 1e-4, 1e-6, 0.1, "rad/s/√Hz", "Estimator", "Noise density expected of the gyro"),
    _real("EST_ACC_NOISE", 0.001, 1e-5, 1.0, "m/s^2/√Hz", "Estimator", "Noise density expected of the accelerometer"),
    _real("EST_GYR_WALK", 4e-5, 0.0, 0.1, "rad/s^2/√Hz", "Estimator", "Walk expected of the gyro's bias"),
    _real("EST_ACC_WALK", 1e-4, 0.0, 1.0, "m/s^3/√Hz", "Estimator", "Walk expected of the accelerometer's bias"),
    _real("EST_GPS_P_NOISE", 0.0085, 0.001, 10.0, "m", "Estimator", "Noise expected of the receiver's level position"),
    _real("EST_GPS_Z_NOISE", 0.0148, 0.001, 10.0, "m", "Estimator", "Noise expected of the receiver's height"),
    _real("EST_GPS_V_NOISE", 0.05, 0.001, 5.0, "m/s", "Estimator", "Noise expected of the receiver's velocity"),
    _real("EST_BARO_NOISE", 0.1, 0.01, 15.0, "m", "Estimator", "Noise expected of the barometer's height"),
    _real("EST_MAG_NOISE", 0.03, 0.001, 1.0, "rad", "Estimator", "Noise expected of the magnetic heading"),
    # the simulation
    _real("SIM_SPEED", 1.0, 0.0, 1000.0, "", "Simulation", "Simulated seconds per second; 0: fastest", kept=False),
    Declaration("SIM_PAUSE", True, 0, 0, 1, "", "Simulation", "Simulation stands still", values=_OFF_ON,
                persistent=False),
    Declaration("SIM_STEP_MS", True, 0, 0, 60000, "ms", "Simulation", "While paused: run on by so much, then reads 0",
                persistent=False, volatile=True),
    _real("SIM_WIND_N", 0.0, -30.0, 30.0, "m/s", "Simulation", "Wind: the air's motion to the north", kept=False),
    _real("SIM_WIND_E", 0.0, -30.0, 30.0, "m/s", "Simulation", "Wind: the air's motion to the east", kept=False),
    _real("SIM_WIND_D", 0.0, -30.0, 30.0, "m/s", "Simulation", "Wind: the air's motion downward", kept=False),
    _real("SIM_GUST", 0.0, 0.0, 10.0, "m/s", "Simulation", "Standard deviation of horizontal Dryden gusts", kept=False),
    _choice("SYS_FAILURE_EN", 0, "Simulation", "Whether failures may be injected (INJECT_FAILURE)", _OFF_ON),
    _real("SIM_LINK_OFF_T", 10.0, 1.0, 60.0, "s", "Simulation", "How long an injected failure of the link lasts"),
    _real("SIM_TLM_RATE", 50.0, 1.0, 500.0, "Hz", "Simulation", "Rate of the telemetry fan-out (simulation time)"),
)  # fmt: skip


def declarations(gain_defaults: Mapping[str, float], extra_defaults: Mapping[str, float]) -> list[Declaration]:
    """All declarations: the gains with a vehicle's own defaults, and the table with those of `extra_defaults` changed.

    Raises KeyError for a name in `extra_defaults` that is not declared.
    """
    table = {d.name: d for d in (*_gains(gain_defaults), *_TABLE)}
    for name, default in extra_defaults.items():
        table[name] = table[name]._replace(default=default)
    return list(table.values())


def as_markdown(declared: Sequence[Declaration]) -> str:
    """The parameters as a table for docs/parameters.md."""
    lines = ["| name | type | default | range | unit | meaning |", "|---|---|---|---|---|---|"]
    group = ""
    for d in sorted(declared, key=lambda d: d.group):
        if d.group != group:
            group = d.group
            lines.append(f"| **{group}** | | | | | |")
        kind = "int" if d.is_int else "float"
        allowed = ", ".join(f"{n} {text}" for n, text in d.values) or f"{d.minimum:g} … {d.maximum:g}"
        meaning = f"{d.short}. {d.long}".strip() if d.long else d.short
        lines.append(f"| `{d.name}` | {kind} | {d.default:g} | {allowed} | {d.unit} | {meaning} |")
    return "\n".join(lines) + "\n"
