"""`python -m conformance`: write the made part of docs/link.md afresh."""

from conformance import clients
from conformance.document import PAGE, page

if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(), clients.load()))
