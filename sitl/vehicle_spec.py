"""A vehicle's specification: airframe + gains + actuators + sensors, from one short YAML file."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import msgspec

from sitl import strict_yaml
from sitl.control.gains import GAIN_NAMES
from sitl.model import airframe
from sitl.model.airframe import Airframe, LoadedAirframe
from sitl.model.derivative import Actuators
from sitl.model.sensors import Sensors
from sitl.quantities import Entry, check_names, refusal
from sitl.strict_yaml import ConfigError

_HERE = Path(__file__).parent
_LONGEST_STEP_S = 0.004  # of the plant's integration: 7e-6 m from converged in the air, 4e-5 m with landing


class GainRow(msgspec.Struct, forbid_unknown_fields=True):
    P: float
    I: float  # noqa: E741
    D: float


class GainsFile(msgspec.Struct, forbid_unknown_fields=True):
    description: str
    gains: dict[str, GainRow]


class ActuatorsFile(msgspec.Struct, forbid_unknown_fields=True):
    motor_tau_s: float
    flap_tau_s: float


class SensorsFile(msgspec.Struct, forbid_unknown_fields=True):
    description: str
    sensors: dict[str, Entry]


class VehicleFile(msgspec.Struct, forbid_unknown_fields=True):
    description: str
    airframe: str
    gains: str
    control_rate_hz: int
    actuators: ActuatorsFile
    sensors: str
    parameters: dict[str, float] = {}


class VehicleSpec(NamedTuple):
    """Everything that makes one kind of vehicle."""

    name: str
    description: str
    airframe: LoadedAirframe
    gains_name: str
    gains: dict[str, float]  # the 36 by parameter name
    actuators: Actuators
    sensors_name: str
    sensors: Sensors
    control_rate_hz: int
    step_us: int  # control period
    substeps: int  # Runge-Kutta steps in one
    parameters: dict[str, float]  # defaults that differ from the declared ones


def vehicle_names() -> list[str]:
    return sorted(path.stem for path in (_HERE / "vehicles").glob("*.yaml"))


def _resolve(kind: str, name: str, beside: Path | None) -> Path:
    """The file of a bundled name, or of a path (relative to the file that names it)."""
    if name.endswith((".yaml", ".yml")) or "/" in name:
        path = Path(name)
        return path if beside is None or path.is_absolute() else beside / path
    path = _HERE / kind / f"{name}.yaml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in (_HERE / kind).glob("*.yaml")))
        raise ConfigError(f"unknown {kind[:-1].rstrip('s')} '{name}': use one of {known}, or the path of a YAML file")
    return path


def load_gains(path: Path) -> dict[str, float]:
    """The 36 gains of a gains file by parameter name. Raises ConfigError."""
    rows = strict_yaml.load(path, GainsFile).gains
    check_names(path, "gains", list(rows), [name[:-2] for name in GAIN_NAMES])
    gains = {name: float(getattr(rows[name[:-2]], name[-1])) for name in GAIN_NAMES}
    for name, value in gains.items():
        if not (math.isfinite(value) and value >= 0.0):
            raise refusal(path, f"gains.{name[:-2]}.{name[-1]}", f"{value} must be 0 or greater")
    return gains


def gains_named(name_or_path: str) -> dict[str, float]:
    """The gains of a bundled set ('paper', 'tuned') or of a YAML file, by parameter name. Raises ConfigError."""
    return load_gains(_resolve("gains", name_or_path, None))


def with_airframe(
    spec: VehicleSpec, plant: Mapping[str, float], believed: Mapping[str, float]
) -> tuple[VehicleSpec, Airframe]:
    """The vehicle with other airframe numbers, and the airframe as its controller takes it to be, with others again.

    The controller hears nothing of what is changed in the plant alone. Raises ConfigError.
    """
    a = spec.airframe.airframe
    flown = spec.airframe._replace(airframe=airframe.changed(a, plant))
    return spec._replace(airframe=flown), airframe.changed(a, believed)


def load_sensors(path: Path) -> Sensors:
    """The sensors of a file; what it leaves out is zero: no noise, no bias, no readings. Raises ConfigError."""
    numbers = strict_yaml.load(path, SensorsFile).sensors
    check_names(path, "sensors", list(numbers), Sensors._fields, complete=False)
    for name, entry in numbers.items():
        if not (math.isfinite(entry.value) and entry.value >= 0.0):
            raise refusal(path, f"sensors.{name}", f"{entry.value} must be 0 or greater")
    return Sensors(*(numbers[name].value if name in numbers else 0.0 for name in Sensors._fields))


def load_vehicle(name_or_path: str) -> VehicleSpec:
    """The vehicle of a bundled name ('yawsitter') or of a YAML file. Raises ConfigError."""
    path = _resolve("vehicles", name_or_path, None)
    content = strict_yaml.load(path, VehicleFile)
    rate = content.control_rate_hz
    if not (10 <= rate <= 5000 and 1_000_000 % rate == 0):
        raise refusal(
            path, "control_rate_hz", f"{rate} must be in 10 … 5000 and divide 1,000,000 (whole microseconds a step)"
        )
    for field, value in msgspec.structs.asdict(content.actuators).items():
        if not (math.isfinite(value) and value >= 0.0):
            raise refusal(path, f"actuators.{field}", f"{value} must be 0 or greater")
    step_us = 1_000_000 // rate
    return VehicleSpec(
        name=path.stem,
        description=content.description,
        airframe=airframe.load(_resolve("airframes", content.airframe, path.parent)),
        gains_name=Path(content.gains).stem,
        gains=load_gains(_resolve("gains", content.gains, path.parent)),
        actuators=Actuators(**msgspec.structs.asdict(content.actuators)),
        sensors_name=Path(content.sensors).stem,
        sensors=load_sensors(_resolve("sensors", content.sensors, path.parent)),
        control_rate_hz=rate,
        step_us=step_us,
        substeps=max(1, math.ceil(step_us * 1e-6 / _LONGEST_STEP_S - 1e-9)),
        parameters=content.parameters,
    )
