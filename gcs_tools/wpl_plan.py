"""QGC WPL 110: the text files of waypoints that Mission Planner, MAVProxy and QGroundControl read and write.

Format: MAVLink developer guide, "File formats", plain-text mission files: a heading, then a line for each item of
twelve fields divided by tabs (FIELDS). Line 0 is home where it is current, a waypoint and above sea level, as Mission
Planner and MAVProxy write it; every other line is an item.
"""

import math
from pathlib import PurePath
from typing import NoReturn

from gcs_tools.plan import Home, Item, Uploaded, item_of, written
from gcs_tools.qgc_plan import LIMIT_S
from sitl.strict_yaml import ConfigError

HEADING = "QGC WPL 110"
FIELDS = (
    "index", "current", "frame", "command", "param1", "param2", "param3", "param4", "x", "y", "z", "autocontinue",
)  # fmt: skip
_WHOLE = ("index", "current", "frame", "command", "autocontinue")
_NAMES = {f"params[{k}]": name for k, name in enumerate(FIELDS[4:11])}


def loads(text: str, name: str) -> Uploaded:
    """The flight in the text; `name` stands for the file in messages. Raises ConfigError."""
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if not lines or lines[0][1].split() != HEADING.split():
        raise ConfigError(f"{name}:1: is not a file of waypoints; allowed: {HEADING!r} in the first line")
    home, items = None, []
    for index, (number, line) in enumerate(lines[1:]):
        where = f"{name}:{number}: item {index}"
        row = _row(line, where)
        if row["index"] != index:
            raise ConfigError(f"{where}: index: {row['index']:g} is out of order; allowed: {index}")
        if index == 0 and (row["current"], row["frame"], row["command"]) == (1.0, 0.0, 16.0):
            home = Home(row["x"], row["y"], row["z"])
        items.append(_item(row, where))
    if home is not None:
        items = items[1:]
    if not items:
        raise ConfigError(f"{name}: has no items")
    return Uploaded(PurePath(name).stem, name, tuple(items), LIMIT_S, home)


def _row(line: str, where: str) -> dict[str, float]:
    words = line.split()
    if len(words) != len(FIELDS):
        raise ConfigError(f"{where}: has {len(words)} fields; allowed: {len(FIELDS)} ({', '.join(FIELDS)})")
    row = {}
    for field, word in zip(FIELDS, words, strict=True):
        try:
            row[field] = float(word)
        except ValueError:
            raise ConfigError(f"{where}: {field}: {word!r} is not a number") from None
        if field in _WHOLE and not (row[field].is_integer() and 0.0 <= row[field] <= 65535.0):
            raise ConfigError(f"{where}: {field}: {word!r} is not a whole number from 0 to 65535")
        if math.isinf(row[field]):
            raise ConfigError(f"{where}: {field}: {word!r} is not finite")
    return row


def _item(row: dict[str, float], where: str) -> Item:
    def fault(field: str, message: str) -> NoReturn:
        raise ConfigError(f"{where}: {_NAMES.get(field, field)}: {message}")

    params = [row[field] for field in FIELDS[4:11]]
    return item_of(int(row["frame"]), int(row["command"]), params, bool(row["autocontinue"]), fault)


def dumps(plan: Uploaded) -> str:
    """The text of such a file, home in line 0 where the plan has one. Raises ConfigError for what would be lost."""
    for name, lost in (("fence", plan.fence), ("rally", plan.rally)):
        if lost:
            message = f"would be lost (items: {len(lost)}), {HEADING} has a mission's only; allowed: .plan, .yaml"
            raise ConfigError(f"{plan.source}: {name}: {message}")
    rows = []
    if plan.home is not None:
        rows.append((1, 0, 16, (0.0, 0.0, 0.0, 0.0, *plan.home), 1))
    for item in plan.items:
        frame, params = written(item)
        rows.append((0, frame, item.command, params, item.autocontinue))
    return "".join(
        "\t".join(map(str, (i, current, frame, command, *map(_number, params), more))) + "\n"
        for i, (current, frame, command, params, more) in enumerate(rows)
    ).join((HEADING + "\n", ""))


def _number(value: float) -> str:
    return f"{value:.9f}".rstrip("0").rstrip(".") if math.isfinite(value) else "nan"
