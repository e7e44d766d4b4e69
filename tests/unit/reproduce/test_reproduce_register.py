"""What the package repeats from elsewhere in the project is what stands there."""

from pathlib import Path

import pytest

from sitl.reproduce import fly, register

ROOT = Path(__file__).parents[3]


def test_the_documented_register_is_the_packaged_one() -> None:
    document = (ROOT / "docs/model.md").read_text(encoding="utf-8")
    advice = "edit sitl/reproduce/register.md, then: python -m sitl.reproduce.register docs/model.md"
    assert register.text() in document, advice


def test_every_reading_names_what_is_printed_its_problem_and_how_it_is_read() -> None:
    readings = register.readings()
    assert len(readings) > 20
    assert all(r.printed and r.problem and r.reading for r in readings)


def test_an_edited_register_replaces_the_table_and_nothing_else() -> None:
    heading = register.text().splitlines()[0]
    document = f"before\n\n{heading}\n|---|---|---|---|\n| old | row | is | here |\n\nafter\n"
    assert register.put_into(document) == f"before\n\n{register.text()}\nafter\n"


def test_a_document_without_the_register_is_refused() -> None:
    with pytest.raises(ValueError, match="no table"):
        register.put_into("nothing here\n")


@pytest.mark.parametrize("name", ["rectangle", "rectangle-20x5", "circle", "circle-constant-speed"])
def test_the_packaged_missions_are_those_of_the_missions_folder(name: str) -> None:
    packaged = Path(fly.__file__).parent / "missions" / f"{name}.yaml"
    assert packaged.read_bytes() == (ROOT / "missions" / f"{name}.yaml").read_bytes()
