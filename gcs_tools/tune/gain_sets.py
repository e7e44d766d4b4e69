"""Sets of gains by name: the bundled ones, gains files, and what other parameter files hold of them."""

from pathlib import Path

from gcs_tools import parameter_files
from gcs_tools.tune.experiment import GainSet
from gcs_tools.tune.loops import GAIN_NAMES
from sitl.atomic import atomically
from sitl.strict_yaml import ConfigError
from sitl.vehicle_spec import gains_named

OWN = "own"


def load(text: str) -> GainSet:
    """'own' (the vehicle's), a bundled set ('paper', 'tuned'), a gains file, or a file of parameters (.yaml, .param).

    Of a parameter file only the gains count; those that it leaves out stay the vehicle's own. Raises ConfigError.
    """
    if text == OWN:
        return GainSet(OWN, None)
    path = Path(text)
    if path.suffix.lower() not in (*parameter_files.LISTS, ".yaml", ".yml"):
        return GainSet(text, gains_named(text))
    found = {name: written.value for name, written in parameter_files.read(path).items() if name in GAIN_NAMES}
    if not found:
        raise ConfigError(f"{path}: none of the 36 gains (POS_X_P … RATE_Z_D) is in it")
    return GainSet(path.stem, found)


def write(path: Path, gains: dict[str, float], description: str) -> None:
    """A gains file as vehicles, `sitl run --gains` and `gcs param load` take it. Raises OSError."""
    lines = [f'description: "{description}"', "gains:"]
    for row in dict.fromkeys(name[:-2] for name in GAIN_NAMES):
        p, i, d = (f"{gains[f'{row}_{term}']:.5g}" for term in "PID")
        lines.append(f"  {row + ':':<8}{{P: {p}, I: {i}, D: {d}}}")
    text = "\n".join(lines) + "\n"
    atomically(path, lambda to: to.write_text(text, encoding="utf-8"))
