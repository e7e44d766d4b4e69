"""Numbers that stand in YAML with their unit and source."""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from sitl import strict_yaml
from sitl.strict_yaml import ConfigError


class Entry(msgspec.Struct, forbid_unknown_fields=True):
    """One number of a file."""

    value: float
    unit: str
    source: str


def check_names(path: Path, block: str, given: Sequence[str], wanted: Sequence[str], complete: bool = True) -> None:
    """Raises ConfigError for names in a file's block that are unknown or, where it must be complete, missing."""
    unknown, missing = set(given) - set(wanted), set(wanted) - set(given) if complete else set()
    for problem, names in (("missing", missing), ("unknown", unknown)):
        if names:
            raise ConfigError(f"{path}: {block}: {problem}: {', '.join(sorted(names))}")


def refusal(path: Path, field: str, message: str) -> ConfigError:
    """The error that says in which line of the file a dotted field stands and what is wrong with it."""
    return ConfigError(f"{path}:{strict_yaml.line_of(path.read_text(encoding='utf-8'), field)}: {field}: {message}")
