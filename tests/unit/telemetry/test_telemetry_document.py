"""docs/telemetry.md says what is sent, all of it and nothing else."""

import json
import re
from pathlib import Path

import msgspec
import pytest

from sitl.telemetry import keys, schema

DOCUMENT = (Path(__file__).resolve().parents[3] / "docs" / "telemetry.md").read_text(encoding="utf-8")

SECTIONS = {
    "state": schema.StateMessage,
    "attitude": schema.AttitudeMessage,
    "setpoint": schema.SetpointMessage,
    "actuators": schema.ActuatorsMessage,
    "loads": schema.LoadsMessage,
    "mode": schema.ModeMessage,
    "loop": schema.LoopMessage,
    "event, events": schema.EventMessage,
    "parameters": schema.ParameterMessage,
    "mission": schema.MissionMessage,
}


def section(title: str) -> str:
    return DOCUMENT.partition(f"\n### {title}\n")[2].partition("\n#")[0]


def test_every_topic_has_its_row_in_the_table_of_keys() -> None:
    table = DOCUMENT.partition("## Keys")[2].partition("\n## ")[0]
    for topic in keys.TOPICS:
        (row,) = [
            line for line in table.splitlines() if line.startswith("|") and f"`{topic.name}`" in line.split("|")[1]
        ]
        assert row.split("|")[3].strip() == ("yes" if topic.queryable else "no")


@pytest.mark.parametrize("title", SECTIONS)
def test_every_field_is_documented_and_every_documented_field_exists(title) -> None:
    rows = re.findall(r"^\| (`[^|]*) \|", section(title), re.MULTILINE)
    documented = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert documented == {field.name for field in msgspec.structs.fields(SECTIONS[title])}


@pytest.mark.parametrize("title", SECTIONS)
def test_every_example_is_a_message_of_its_type(title) -> None:
    (example,) = re.findall(r"```json\n(.*?)```", section(title), re.DOTALL)
    given = json.loads(example)
    assert set(given) == {field.name for field in msgspec.structs.fields(SECTIONS[title])}
    msgspec.convert(given, SECTIONS[title])
