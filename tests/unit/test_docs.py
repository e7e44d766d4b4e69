"""What the documentation repeats from the code is what the code says."""

import re
from pathlib import Path

from sitl.onboard.declarations import as_markdown, declarations
from sitl.vehicle_spec import load_vehicle

ROOT = Path(__file__).parents[2]


def test_the_parameter_reference_is_what_the_declarations_say() -> None:
    spec = load_vehicle("yawsitter")
    assert as_markdown(declarations(spec.gains, spec.parameters)) in (ROOT / "docs/parameters.md").read_text()


def test_every_link_between_documents_leads_somewhere() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    links = [(page, link) for page in pages for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text())]
    assert len(links) > 10
    assert [(str(page), link) for page, link in links if not (page.parent / link).exists()] == []
