"""What the documentation repeats from the code is what the code says."""

import re
from pathlib import Path

from conformance import clients, document
from sitl.onboard.declarations import as_markdown, declarations
from sitl.vehicle_spec import load_vehicle

ROOT = Path(__file__).parents[2]


def test_the_parameter_reference_is_what_the_declarations_say() -> None:
    spec = load_vehicle("yawsitter")
    assert as_markdown(declarations(spec.gains, spec.parameters)) in (ROOT / "docs/parameters.md").read_text()


def test_the_tables_of_clients_are_what_the_code_declares_and_the_clients_did() -> None:
    written = document.PAGE.read_text()
    assert document.page(written, clients.load()) == written, "`python -m conformance` writes them"


def test_every_client_has_been_watched() -> None:
    assert set(clients.load()) == set(clients.CLIENTS)


def test_every_link_between_documents_leads_somewhere() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    links = [(page, link) for page in pages for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text())]
    assert len(links) > 10
    assert [(str(page), link) for page, link in links if not (page.parent / link).exists()] == []
