"""What the paper prints in its section V: the two tables, and the ranges in its text."""

from typing import NamedTuple

from gcs_tools.table import AXES, PAPER, ROWS

__all__ = ["AXES", "KEY_ERRORS", "OVERALL", "RANGES", "ROWS", "Range"]

OVERALL = PAPER  # per table and metric: x, y, z

# Errors at the tables' key times: t [s], then x, y, z [m].
KEY_ERRORS = {
    "rectangle": (
        (20.0, (0.0052, 0.0251, -0.0013)),
        (30.0, (0.0828, -0.0159, 0.0056)),
        (40.0, (0.0005, -0.0007, -0.0002)),
        (50.0, (-0.0863, -0.0020, 0.0060)),
        (60.0, (-0.0016, -0.0014, 0.0001)),
        (65.0, (-0.0129, -0.0045, -0.0112)),
    ),
    "circle": (
        (5.0, (0.0057, 0.0000, 0.0012)),
        (15.0, (-0.0127, 0.0177, -0.0090)),
        (25.0, (0.0055, -0.0336, 0.0094)),
        (35.0, (0.0090, -0.0014, -0.0008)),
        (45.0, (-0.0007, 0.0111, 0.0030)),
        (55.0, (-0.0037, 0.0056, 0.0009)),
    ),
}


class Range(NamedTuple):
    """A quantity's least and greatest value as the text gives it; None where it gives none."""

    quantity: str
    key: str  # in a flight's ranges
    unit: str
    rectangle: str | None
    circle: str | None


RANGES = (
    Range("pitch θ", "pitch_deg", "°", "about 93 in hover", "87.2 … 101.3"),
    Range("yaw ψ", "yaw_deg", "°", "peak −1.60", "peak 5.7"),
    Range("roll φ", "roll_deg", "°", None, "±0.001"),
    Range("total thrust", "thrust_N", "N", "10.835 … 14.815", "12.526 … 13.452"),
    Range("flaps", "flap_deg", "°", None, "within ±21.1"),
)
