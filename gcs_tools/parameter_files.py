"""Files of parameter values: what `gcs param save` writes, gains files, and the lists of other ground stations.

NAME: VALUE                     YAML, as `gcs param save` writes it
gains: {POS_X: {P: …, …}, …}    a gains file, as vehicles name them (sitl/gains): all 36 gains
1  1  NAME  VALUE  TYPE         QGroundControl's .params
NAME  VALUE                     .param, .parm: MAVProxy's and Mission Planner's (there with a comma)
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from gcs_tools import params
from gcs_tools.client import Client, LinkError, Script
from gcs_tools.parameter import Parameter
from sitl import strict_yaml
from sitl.strict_yaml import ConfigError

LISTS = (".param", ".params", ".parm")


class Written(NamedTuple):
    """A value and the line of the file in which it stands."""

    value: float
    line: int


def write(path: Path, parameters: Mapping[str, Parameter], vehicle: str | None) -> None:
    """All parameters as NAME: VALUE. Raises OSError."""
    lines = [f"# Parameters of {vehicle or 'a vehicle'}; load with: gcs param load {path.name}"]
    lines += [f"{name}: {p.text}" for name, p in sorted(parameters.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read(path: Path) -> dict[str, Written]:
    """The values of a file of any of these kinds, by name. Raises ConfigError."""
    if path.suffix.lower() in LISTS:
        return _read_list(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: can't be read: {getattr(error, 'strerror', None) or 'not UTF-8 text'}") from None
    if re.search(r"^gains\s*:", text, re.MULTILINE):
        from sitl.vehicle_spec import load_gains  # with the vehicle's model, which no other file needs

        return {
            name: Written(value, strict_yaml.line_of(text, f"gains.{name[:-2]}"))
            for name, value in load_gains(path).items()
        }
    values = strict_yaml.loads(text, dict[str, int | float], str(path))
    return {name: Written(value, strict_yaml.line_of(text, name)) for name, value in values.items()}


def apply(client: Client, path: Path, wanted: Mapping[str, Written]) -> Script[list[tuple[Parameter, Parameter]]]:
    """Write what differs, all of it or, where a name or a kind is wrong, nothing; (old, new) of each.

    What the vehicle refuses is told with the line of the file in which it stands.
    """
    try:
        return (yield from params.apply(client, {name: written.value for name, written in wanted.items()}))
    except LinkError as fault:
        written = wanted.get(str(fault).partition(":")[0])
        raise LinkError(f"{path}{f':{written.line}' if written else ''}: {fault}") from None


def _read_list(path: Path) -> dict[str, Written]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: can't be read: {getattr(error, 'strerror', None) or 'not UTF-8 text'}") from None
    found: dict[str, Written] = {}
    for number, line in enumerate(lines, start=1):
        words = re.split(r"[\s,]+", line.partition("#")[0].strip())
        if words == [""]:
            continue
        name, text = words[2:4] if len(words) == 5 else words if len(words) == 2 else ("", "")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not name or not math.isfinite(value):
            raise ConfigError(f"{path}:{number}: '{line.strip()}' is not NAME VALUE, nor QGroundControl's columns")
        if name in found:
            raise ConfigError(f"{path}:{number}: '{name}' is given twice")
        found[name] = Written(value, number)
    return found
