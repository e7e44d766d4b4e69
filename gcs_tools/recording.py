"""What is kept of a flight while it is flown, and the Track it comes to."""

from typing import Any

import numpy as np

from gcs_tools.metrics import Track
from gcs_tools.reference import Reference


class Recording:
    """Samples with the vehicle's own time stamps (s). Each method takes one message in."""

    def __init__(self) -> None:
        self.positions: list[tuple[float, float, float, float]] = []
        self.targets: list[tuple[float, float, float, float]] = []
        self.angles: list[tuple[float, float, float, float]] = []
        self.thrust: list[tuple[float, float | None]] = []
        self.flaps: list[tuple[float, float, float]] = []

    def position(self, m: Any) -> None:
        self.positions.append((m.time_boot_ms * 1e-3, m.x, m.y, m.z))

    def target(self, m: Any) -> None:
        self.targets.append((m.time_boot_ms * 1e-3, m.x, m.y, m.z))

    def debug(self, m: Any) -> None:
        t = m.time_usec * 1e-6
        if m.name == "YXZ_DEG":
            self.angles.append((t, m.x, m.y, m.z))
        elif m.name == "THRUST_N":
            self.thrust.append((t, m.z))
        elif m.name == "FLAP_DEG":
            self.flaps.append((t, m.x, m.y))

    def track(self, t0_s: float, reference: Reference | None) -> Track:
        """The flight with times from t0_s. Without a reference of our own it is the one the vehicle reported."""
        position = series(self.positions, 4, t0_s)
        t = position[:, 0]
        if reference is not None:
            wanted = np.array([reference.at(float(s)).position_m for s in t]).reshape(-1, 3)
        else:
            target = series(self.targets, 4, t0_s)
            if target.shape[0] == 0:
                target = np.full((1, 4), np.nan)
            wanted = np.column_stack([np.interp(t, target[:, 0], target[:, k]) for k in (1, 2, 3)])
        return Track(
            t_s=t,
            reference_m=wanted,
            position_m=position[:, 1:],
            angles=series(self.angles, 4, t0_s),
            thrust=series(self.thrust, 2, t0_s),
            flaps=series(self.flaps, 3, t0_s),
        )


def series(rows: list[Any], width: int, t0_s: float) -> Any:
    """Rows in the order of their times, each time once: datagrams may arrive twice or in another order."""
    table = np.array(rows, dtype=float).reshape(-1, width)
    _, first = np.unique(table[:, 0], return_index=True)
    table = table[first]
    table[:, 0] -= t0_s
    return table
