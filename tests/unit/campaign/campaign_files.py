"""Campaigns made up for tests."""

from pathlib import Path

from sitl.campaign import file
from sitl.campaign.cases import Case, Equipment, cases, equip
from sitl.campaign.file import Campaign

ROOT = Path(__file__).parents[3]


def campaign(text: str) -> Campaign:
    head = "name: test\n" + ("" if "mission:" in text else "mission: missions/hover.yaml\n")
    return file.loads(head + text, "test.yaml")


def equipped(text: str) -> tuple[Equipment, list[Case]]:
    made = campaign(text)
    equipment = equip(made, ROOT)
    return equipment, cases(made, equipment, ROOT)


def flights(text: str) -> list[Case]:
    return equipped(text)[1]
