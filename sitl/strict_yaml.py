"""YAML read strictly into typed structures.

YAML 1.1 as PyYAML reads it has traps: `1e-3` is a string, duplicate keys win silently, `on` is True and `012` is 10.
This loader reads scalars by YAML 1.2's core rules, refuses duplicate keys, and says of every mistake in which
file, line and field it stands and what is allowed there.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import msgspec
import yaml

T = TypeVar("T")
S = TypeVar("S", bound=msgspec.Struct)


class ConfigError(ValueError):
    """A file that can't be used; the message names file, line, field and what is allowed."""


class _Loader(yaml.SafeLoader):
    pass


_Loader.yaml_implicit_resolvers = {}
for _tag, _pattern, _first in (
    ("tag:yaml.org,2002:bool", r"^(?:true|True|false|False)$", "tTfF"),
    ("tag:yaml.org,2002:int", r"^[-+]?(?:0|[1-9][0-9]*)$", "-+0123456789"),
    (
        "tag:yaml.org,2002:float",
        r"^[-+]?(?:(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|\.inf|\.nan)$",
        "-+0123456789.",
    ),
    ("tag:yaml.org,2002:null", r"^(?:~|null|)$", ["~", "n", ""]),
    ("tag:yaml.org,2002:merge", r"^(?:<<)$", "<"),
):
    _Loader.add_implicit_resolver(_tag, re.compile(_pattern), list(_first))


def _construct_mapping(loader: _Loader, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
    seen: set[Any] = set()
    for key_node, _ in node.value:
        key = loader.construct_object(key_node, deep=True)  # type: ignore[no-untyped-call]
        if not isinstance(key, str | int | float | bool | None):
            raise yaml.MarkedYAMLError(None, None, "a key must be a plain word", key_node.start_mark)
        if key in seen:
            raise yaml.MarkedYAMLError(None, None, f"'{key}' is given twice", key_node.start_mark)
        seen.add(key)
    loader.flatten_mapping(node)
    return {
        loader.construct_object(k, deep=True): loader.construct_object(v, deep=True)  # type: ignore[no-untyped-call]
        for k, v in node.value
    }


_Loader.add_constructor("tag:yaml.org,2002:map", _construct_mapping)
_Loader.add_constructor(
    "tag:yaml.org,2002:float",
    lambda _loader, node: float(node.value.replace(".inf", "inf").replace(".nan", "nan")),
)
_Loader.add_constructor("tag:yaml.org,2002:int", lambda _loader, node: int(node.value))


def load(path: str | Path, into: type[T]) -> T:
    """The file at `path` as an instance of `into` (a msgspec Struct or any type msgspec converts to).

    Raises ConfigError for a file that is missing, not YAML, or doesn't fit the type.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise ConfigError(f"{path}: can't be read: {reason}") from None
    return loads(text, into, str(path))


def loads(text: str, into: type[T], name: str = "<text>") -> T:
    """As `load`, from a string; `name` stands in for the file in messages."""
    try:
        loader = _Loader(text)
    except yaml.YAMLError as error:
        raise ConfigError(f"{name}: {' '.join(str(error).split())}") from None
    try:
        node = loader.get_single_node()
        data = loader.construct_document(node) if node is not None else {}  # type: ignore[no-untyped-call]
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        raise ConfigError(f"{name}{line}: {error.problem or error.context}") from None
    except yaml.YAMLError as error:
        raise ConfigError(f"{name}: {' '.join(str(error).split())}") from None
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{name}: {error}") from None
    finally:
        loader.dispose()  # type: ignore[no-untyped-call]
    try:
        return msgspec.convert(data, into)
    except msgspec.ValidationError as error:
        message, field = _split(str(error))
        raise ConfigError(f"{name}:{line_of(text, field)}: {field or 'top level'}: {message}") from None


def _split(message: str) -> tuple[str, str]:
    """msgspec's 'Expected `float` - at `$.a[0].b`' as (message, 'a[0].b')."""
    text, _, where = message.partition(" - at `")
    return text, where.rstrip("`").lstrip("$").lstrip(".")


def line_of(text: str, field: str) -> int:
    """The line (from 1) where `field` ('a[0].b') stands in the YAML text, or its nearest parent that is there."""
    node = yaml.compose(text, Loader=_Loader)
    for part in re.findall(r"[^.\[\]]+|\[\d+\]", field):
        child = None
        if isinstance(node, yaml.MappingNode):
            child = next((v for k, v in node.value if k.value == part), None)
            key = next((k for k, _ in node.value if k.value == part), None)
            if child is not None and key is not None and not isinstance(child, yaml.ScalarNode):
                child.start_mark = key.start_mark
        elif isinstance(node, yaml.SequenceNode) and part.startswith("["):
            index = int(part[1:-1])
            child = node.value[index] if index < len(node.value) else None
        if child is None:
            break
        node = child
    return node.start_mark.line + 1 if node is not None else 1


class Document:
    """A YAML file of several parts, whose structure depends on what stands in it: read part by part.

    text: its content; name: stands for the file in messages. Raises ConfigError.
    """

    def __init__(self, text: str, name: str) -> None:
        self.text, self.name = text, name
        self.data = loads(text, dict[str, Any], name)

    def fault(self, field: str, message: str) -> NoReturn:
        """Refuse the file because of what stands in `field` ('a[0].b')."""
        raise ConfigError(f"{self.name}:{line_of(self.text, field)}: {field or 'top level'}: {message}") from None

    def choice(self, field: str, value: Any, allowed: Mapping[str, Any] | tuple[str, ...]) -> None:
        if not isinstance(value, str) or value not in allowed:
            self.fault(field, f"{value!r} is not one of {', '.join(allowed)}")

    def convert(self, data: Any, into: type[S], prefix: str = "") -> S:
        """The part at `prefix` as a msgspec Struct; unknown fields are answered with those that there are."""
        if isinstance(data, dict):
            fields = msgspec.structs.fields(into)
            for key in data:
                if key not in {f.name for f in fields}:
                    at = f"{prefix}.{key}".lstrip(".")
                    self.fault(at, f"is not a field here; allowed: {', '.join(f.name for f in fields)}")
            for field in fields:
                if field.required and field.name not in data:
                    self.fault(prefix, f"'{field.name}' is missing")
        try:
            return msgspec.convert(data, into)
        except msgspec.ValidationError as error:
            message, _, where = str(error).partition(" - at `$")
            self.fault(f"{prefix}{where.rstrip('`')}".lstrip("."), message)
