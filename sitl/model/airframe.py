"""The airframe: every number of the plant, read from a YAML file that gives each its unit and source."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from sitl import strict_yaml
from sitl.frames import GRAVITY_M_S2
from sitl.jit import kernel
from sitl.quantities import Entry, check_names, refusal
from sitl.strict_yaml import ConfigError


class Airframe(NamedTuple):
    """SI and radians, body axes forward-right-down. Symbols of the paper in brackets; units in the names."""

    mass_kg: float  # [m]
    jxx_kg_m2: float
    jyy_kg_m2: float
    jzz_kg_m2: float
    air_density_kg_m3: float  # [rho]
    wing_area_m2: float  # [S_wing]
    wing_moment_area_m2: float  # the area in M_pitch = q S c C_M
    wing_span_m: float  # [b]
    chord_m: float  # [c bar]
    ac_behind_cg_m: float  # [X_a - X_g]
    lift_slope: float  # [C_L alpha] 1/rad
    lift_at_zero: float  # [C_L0]
    drag_at_zero: float  # [C_D0]
    oswald: float  # [e]
    moment_slope: float  # [C_M alpha] 1/rad
    moment_at_zero: float  # [C_M0]
    stall_angle_rad: float  # [alpha_0] half of the lift is gone here
    stall_sharpness: float  # [M] of the blend to a flat plate
    plate_drag: float  # normal force coefficient of the plate at 90 deg
    immersed_fraction: float  # of the wing area in the slipstreams
    flap_area_m2: float  # [S_f] of one flap
    flap_lift_slope: float  # [C_L delta] 1/rad; positive: trailing edge down lifts
    flap_moment_slope: float  # [C_M delta] 1/rad
    flap_roll_arm_m: float  # lever of one flap's lift about x
    flap_max_rad: float  # [delta_max]
    prop_radius_m: float  # [R_prop]
    slipstream_radius_ratio: float  # [R_s / R]
    prop_arm_m: float  # [l_y] from x axis to one propeller
    wake_arm_m: float  # from x axis to where the wing feels one slipstream; 0: unequal slipstreams don't roll or yaw it
    thrust_coefficient: float  # [C_T] N s2
    torque_coefficient: float  # [C_mu] N m s2
    thrust_min_N: float  # of one motor when running
    thrust_max_N: float  # of one motor
    side_force_factor: float  # [K_f] side force per differential thrust
    drag_linear_1_s: float  # [K_v]
    drag_quadratic_1_m: float  # [K_t]

    @property
    def wake_area_m2(self) -> float:
        """Cross-section of one slipstream, π R_s²."""
        return math.pi * (self.slipstream_radius_ratio * self.prop_radius_m) ** 2

    @property
    def aspect_ratio(self) -> float:
        return self.wing_span_m**2 / self.wing_area_m2


@kernel
def loaded(a: Airframe) -> Airframe:
    """The airframe in numbers of a kernel's own: what follows from them alone is worked out once, not in every step.

    Of numbers in a record the compiler must expect that they change.
    """
    return Airframe(
        a.mass_kg, a.jxx_kg_m2, a.jyy_kg_m2, a.jzz_kg_m2, a.air_density_kg_m3, a.wing_area_m2, a.wing_moment_area_m2,
        a.wing_span_m, a.chord_m, a.ac_behind_cg_m, a.lift_slope, a.lift_at_zero, a.drag_at_zero, a.oswald,
        a.moment_slope, a.moment_at_zero, a.stall_angle_rad, a.stall_sharpness, a.plate_drag, a.immersed_fraction,
        a.flap_area_m2, a.flap_lift_slope, a.flap_moment_slope, a.flap_roll_arm_m, a.flap_max_rad, a.prop_radius_m,
        a.slipstream_radius_ratio, a.prop_arm_m, a.wake_arm_m, a.thrust_coefficient, a.torque_coefficient,
        a.thrust_min_N, a.thrust_max_N, a.side_force_factor, a.drag_linear_1_s, a.drag_quadratic_1_m,
    )  # fmt: skip


class Gear(NamedTuple):
    """Contact points with a flat ground, as springs with damping and friction; the first four are the feet.

    points_B: (n, 3) positions in B [m]. ground_down_m: where the ground is in N, so that the vehicle's centre of mass
    is at down = 0 when it stands. standing_pitch_rad: the paper's θ when all four feet rest on the ground.
    """

    points_B: NDArray[np.float64]
    stiffness_N_m: float  # of one point
    damping_N_s_m: float
    friction: float
    slip_m_s: float  # friction builds up over this sliding speed
    ground_down_m: float
    standing_pitch_rad: float


class GearFile(msgspec.Struct, forbid_unknown_fields=True):
    height_m: Entry
    track_m: Entry
    base_m: Entry
    standing_pitch_deg: Entry
    nose_m: Entry
    stiffness_N_m: Entry
    damping_ratio: Entry
    friction: Entry


class AirframeFile(msgspec.Struct, forbid_unknown_fields=True):
    description: str
    parameters: dict[str, Entry]
    gear: GearFile


_POSITIVE = {
    "mass_kg", "jxx_kg_m2", "jyy_kg_m2", "jzz_kg_m2", "air_density_kg_m3", "wing_area_m2", "wing_span_m", "chord_m",
    "oswald", "stall_angle_rad", "stall_sharpness", "flap_max_rad", "prop_radius_m", "slipstream_radius_ratio",
    "prop_arm_m", "thrust_coefficient", "thrust_max_N",
}  # fmt: skip
_NOT_NEGATIVE = {"torque_coefficient", "wake_arm_m", "thrust_min_N"}


class LoadedAirframe(NamedTuple):
    name: str
    file: AirframeFile
    airframe: Airframe
    gear: Gear


def load(path: Path) -> LoadedAirframe:
    """The airframe file at `path`. Raises ConfigError naming what is missing, unknown or out of range."""
    content = strict_yaml.load(path, AirframeFile)
    check_names(path, "parameters", list(content.parameters), Airframe._fields)
    airframe = Airframe(**{name: content.parameters[name].value for name in Airframe._fields})
    if (mistake := fault(airframe)) is not None:
        raise refusal(path, f"parameters.{mistake[0]}", mistake[1])
    return LoadedAirframe(path.stem, content, airframe, gear(content.gear, airframe))


def fault(a: Airframe) -> tuple[str, str] | None:
    """(number's name, what is wrong with it) of the first that no airframe can have."""
    for name, value in a._asdict().items():
        if not math.isfinite(value):
            return name, f"{value} is not finite"
        if name in _POSITIVE and value <= 0.0:
            return name, f"{value} must be greater than 0"
        if name in _NOT_NEGATIVE and value < 0.0:
            return name, f"{value} must be 0 or greater"
    if not 0.0 <= a.immersed_fraction <= 1.0:
        return "immersed_fraction", f"{a.immersed_fraction} must be in 0 … 1"
    if a.thrust_min_N >= a.thrust_max_N:
        return "thrust_min_N", f"{a.thrust_min_N} must be below thrust_max_N, {a.thrust_max_N}"
    return None


def changed(a: Airframe, values: Mapping[str, float]) -> Airframe:
    """The airframe with other numbers. Raises ConfigError for one that there isn't or that can't be."""
    if unknown := sorted(set(values) - set(Airframe._fields)):
        raise ConfigError(f"airframe: unknown: {', '.join(unknown)}; there are {', '.join(Airframe._fields)}")
    new = a._replace(**values)
    if (mistake := fault(new)) is not None:
        raise ConfigError(f"airframe: {mistake[0]}: {mistake[1]}")
    return new


def gear(file: GearFile, airframe: Airframe) -> Gear:
    """Contact points from the gear's dimensions: four feet, the nose and the two wing tips' leading edges."""
    pitch = math.radians(file.standing_pitch_deg.value)
    half_base, half_track, height = file.base_m.value / 2, file.track_m.value / 2, file.height_m.value
    feet = []
    for forward, right in ((1, -1), (1, 1), (-1, -1), (-1, 1)):
        # in the standing frame: x toward the belly's side, z down; turned into B by the standing pitch
        x, y, z = forward * half_base, right * half_track, height
        feet.append((math.cos(pitch) * x - math.sin(pitch) * z, y, math.sin(pitch) * x + math.cos(pitch) * z))
    nose = [(file.nose_m.value, 0.0, 0.0)]
    tips = [(0.25 * airframe.chord_m, side * airframe.wing_span_m / 2, 0.0) for side in (-1, 1)]
    stiffness = file.stiffness_N_m.value
    weight = airframe.mass_kg * GRAVITY_M_S2
    return Gear(
        points_B=np.array(feet + nose + tips),
        stiffness_N_m=stiffness,
        damping_N_s_m=2.0 * file.damping_ratio.value * math.sqrt(stiffness * airframe.mass_kg / 4),
        friction=file.friction.value,
        slip_m_s=0.05,
        ground_down_m=height - weight / (4 * stiffness),
        standing_pitch_rad=pitch,
    )


def description(loaded: LoadedAirframe) -> dict[str, Any]:
    """The airframe as plain data with units and sources, for those who ask the running vehicle."""
    return {
        "name": loaded.name,
        "description": loaded.file.description,
        "parameters": msgspec.to_builtins(loaded.file.parameters),
        "gear": msgspec.to_builtins(loaded.file.gear),
    }
