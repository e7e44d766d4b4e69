"""What is kept of a flight: the columns of the summary and of the trace, each said once."""

from typing import Any, NamedTuple

OUTCOMES = ("completed", "crashed", "tipped over", "timeout", "failed", "error")
OUTCOME_MEANS = {
    "completed": "flown to its end, standing with its motors off",
    "crashed": "touched the ground where the reference was in the air",
    "tipped over": "lay on the ground in the end",
    "timeout": "not done within the mission's time",
    "failed": "given up for another reason, which stands beside it",
    "error": "could not be flown at all, or took its process down",
}


class Column(NamedTuple):
    """name: with its unit. kind: of Arrow's types. frame: N north-east-down, B body, or none."""

    name: str
    kind: str
    unit: str
    frame: str
    text: str


def _axes(prefix: str, text: str) -> list[Column]:
    axes = [Column(f"{prefix}_{a}_m", "float64", "m", "N", f"{text}, {a}") for a in ("north", "east", "down")]
    return [*axes, Column(f"{prefix}_3d_m", "float64", "m", "", f"{text}, distance in space")]


FIGURES = (
    *_axes("mae", "mean absolute error of the true position"),
    *_axes("rms", "root mean square error of the true position"),
    *_axes("max", "greatest error of the true position"),
    Column("max_tilt_deg", "float64", "deg", "", "largest angle of the nose from straight up"),
    Column("energy_J", "float64", "J", "", "energy drawn from the battery, from switching on to the last stop"),
    Column("duration_s", "float64", "s", "", "duration of the measured flight"),
)
LIMITED = tuple(c.name for c in FIGURES)  # what a campaign's `success` may limit
HEAD = (
    Column("index", "int64", "", "", "of the flight in its campaign, from 0"),
    Column("draw", "int64", "", "", "of the settings drawn: flights of one draw differ in the grid's alone"),
    Column("outcome", "string", "", "", "; ".join(f"{o}: {m}" for o, m in OUTCOME_MEANS.items())),
    Column("reason", "string", "", "", "why it was not completed"),
    Column("success", "bool", "", "", "completed, and within the campaign's limits"),
    Column("split", "string", "", "", "train, validation or test"),
    Column("mission", "string", "", "", "a file of the campaign's folder, or random:SEED"),
    Column("vehicle", "string", "", "", "a bundled name or a file"),
    Column("seed", "int64", "", "", "of gusts and sensor noise"),
)
TAIL = (
    Column("simulated_s", "float64", "s", "", "simulation time from switching on to the last stop"),
    Column("command", "string", "", "", "flies this flight again, from the campaign's folder"),
)


def setting_column(name: str, is_word: bool) -> Column:
    """Of a setting that differs between flights."""
    unit = next((u for end, u in _UNITS if name.endswith(end)), "")
    return Column(name, "string" if is_word else "float64", unit, "", "a setting of the flight")


_UNITS = (
    ("_kg_m2", "kg m2"), ("_kg_m3", "kg/m3"), ("_m_s", "m/s"), ("_N_s2", "N s2"), ("_1_s", "1/s"), ("_1_m", "1/m"),
    ("_m2", "m2"), ("_kg", "kg"), ("_rad", "rad"), ("_deg", "deg"), ("_N", "N"), ("_m", "m"), ("_s", "s"),
)  # fmt: skip


def _vector(name: str, unit: str, axes: str, frame: str, text: str) -> list[Column]:
    return [Column(f"{name}_{a}", "float32", unit, frame, f"{text}, {a}") for a in axes.split()]


def _named(name: str, suffix: str, unit: str, axes: str, frame: str, text: str) -> list[Column]:
    return [Column(f"{name}_{a}_{suffix}", "float32", unit, frame, f"{text}, {a}") for a in axes.split()]


def _motion(prefix: str, text: str) -> list[Column]:
    ned = "north east down"
    return [
        *_named(f"{prefix}position", "m", "m", ned, "N", f"{text} position"),
        *_named(f"{prefix}velocity", "m_s", "m/s", ned, "N", f"{text} velocity"),
        *_vector(f"{prefix}q_NB", "", "w x y z", "N from B", f"{text} attitude, quaternion"),
        *(
            Column(f"{prefix}rate_{a}_rad_s", "float32", "rad/s", "B", f"{text} body rate {a} ({axis})")
            for a, axis in (("p", "about the nose"), ("q", "about the right wing"), ("r", "about the belly"))
        ),
    ]


_SIDES = "left right"
# each column, and where it stands in a row of the vehicle's trace (sitl.closed_loop.TRACE_COLUMNS)
_TRACED: tuple[tuple[list[Column], list[str]], ...] = (
    (
        _motion("true_", "true"),
        ["north_m", "east_m", "down_m", "v_north_m_s", "v_east_m_s", "v_down_m_s", "qw", "qx", "qy", "qz",
         "p_rad_s", "q_rad_s", "r_rad_s"],
    ),
    (
        [*_named("rotor", "rad_s", "rad/s", _SIDES, "", "true rotor speed"),
         *_named("flap", "rad", "rad", _SIDES, "", "true flap deflection, trailing edge down positive")],
        ["rotor_left_rad_s", "rotor_right_rad_s", "flap_left_rad", "flap_right_rad"],
    ),
    (
        _motion("nav_", "what the vehicle believes:"),
        ["nav_north_m", "nav_east_m", "nav_down_m", "nav_v_north_m_s", "nav_v_east_m_s", "nav_v_down_m_s", "nav_qw",
         "nav_qx", "nav_qy", "nav_qz", "nav_p_rad_s", "nav_q_rad_s", "nav_r_rad_s"],
    ),
    (
        [*_named("reference_position", "m", "m", "north east down", "N", "reference position"),
         *_named("reference_velocity", "m_s", "m/s", "north east down", "N", "reference velocity"),
         *_named("reference_acceleration", "m_s2", "m/s2", "north east down", "N", "reference acceleration"),
         Column("reference_heading_rad", "float32", "rad", "N", "reference heading of the belly, from north to east")],
        ["reference_north_m", "reference_east_m", "reference_down_m", "reference_v_north_m_s", "reference_v_east_m_s",
         "reference_v_down_m_s", "reference_a_north_m_s2", "reference_a_east_m_s2", "reference_a_down_m_s2",
         "reference_heading_rad"],
    ),
    (
        [*_named("action_thrust", "N", "N", _SIDES, "B", "commanded thrust along the nose"),
         *_named("action_flap", "rad", "rad", _SIDES, "", "commanded flap deflection, trailing edge down positive")],
        ["command_thrust_left_N", "command_thrust_right_N", "command_flap_left_rad", "command_flap_right_rad"],
    ),
    (
        _named("wind", "m_s", "m/s", "north east down", "N", "where the air moves, gusts included"),
        ["wind_N_x", "wind_N_y", "wind_N_z"],
    ),
    (
        _vector("specific_force_m_s2", "m/s2", "x y z", "B", "what an accelerometer at the centre of mass reads"),
        ["specific_force_B_x", "specific_force_B_y", "specific_force_B_z"],
    ),
)  # fmt: skip
TRACE = (
    Column("index", "int64", "", "", "of the flight (the episode) in the table of flights"),
    Column("t_s", "float64", "s", "", "from the start of the flight"),
    *(column for columns, _ in _TRACED for column in columns),
)
TRACE_SOURCES = tuple(name for _, names in _TRACED for name in names)


def schema(columns: list[Column], about: dict[str, str]) -> Any:
    """Arrow's schema with units and frames as metadata of the fields, and `about` as the file's."""
    import pyarrow as pa

    kinds = {"bool": pa.bool_(), "string": pa.string()} | {k: getattr(pa, k)() for k in ("int64", "float32", "float64")}
    fields = [
        pa.field(c.name, kinds[c.kind], metadata={"unit": c.unit, "frame": c.frame, "description": c.text})
        for c in columns
    ]
    return pa.schema(fields, metadata=about)
