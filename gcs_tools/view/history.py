"""Where a vehicle has been and what it did there: a window of rows, one for each instant, for trail and plots."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from gcs_tools.view.vehicle import Instant

COLUMNS = (
    "t_s",
    "north_m",
    "east_m",
    "down_m",
    "reference_north_m",
    "reference_east_m",
    "reference_down_m",
    "phi_deg",
    "theta_deg",
    "psi_deg",
    "phi_command_deg",
    "theta_command_deg",
    "psi_command_deg",
    "thrust_left_command_N",
    "thrust_right_command_N",
    "rotor_left_krpm",
    "rotor_right_krpm",
    "flap_left_deg",
    "flap_right_deg",
    "flap_left_command_deg",
    "flap_right_command_deg",
)
INDEX = {name: k for k, name in enumerate(COLUMNS)}
ROWS = 12_000  # four minutes at the usual 50 samples a second
WIDTH = len(COLUMNS)


def row(instant: "Instant") -> tuple[float, ...]:
    """One instant as numbers, in the order of COLUMNS."""
    s, a, r, u = instant.state, instant.attitude, instant.setpoint, instant.actuators
    return (
        s.now_us * 1e-6,
        *s.position_N_m,
        *r.position_N_m,
        a.phi_deg,
        a.theta_deg,
        a.psi_deg,
        r.phi_command_deg,
        r.theta_command_deg,
        r.psi_command_deg,
        u.thrust_left_command_N,
        u.thrust_right_command_N,
        u.rotor_left_rpm * 1e-3,
        u.rotor_right_rpm * 1e-3,
        u.flap_left_deg,
        u.flap_right_deg,
        u.flap_left_command_deg,
        u.flap_right_command_deg,
    )


class History:
    """The newest ROWS instants, in order of time."""

    def __init__(self, rows: int = ROWS) -> None:
        self._table = np.empty((2 * rows, WIDTH))  # written from the front; the newer half moves there when it is full
        self._rows = rows
        self._end = 0
        self.added = 0  # rows ever taken since the last `clear`

    def add(self, instant: "Instant") -> None:
        if self._end == len(self._table):
            self._table[: self._rows] = self._table[self._rows :]
            self._end = self._rows
        self._table[self._end] = row(instant)
        self._end += 1
        self.added += 1

    def clear(self) -> None:
        self._end = self.added = 0

    def table(self) -> NDArray[np.float64]:
        """(n, WIDTH), n ≤ ROWS: a view that the next `add` may change."""
        return self._table[max(0, self._end - self._rows) : self._end]

    def last(self, seconds: float) -> NDArray[np.float64]:
        """The rows of the newest so many seconds."""
        table = self.table()
        if not len(table):
            return table
        return table[np.searchsorted(table[:, 0], table[-1, 0] - seconds, side="right") :]


class Recorded(History):
    """All rows of a recording, (n, WIDTH), shown up to one of them."""

    def __init__(self, table: NDArray[np.float64]) -> None:
        super().__init__(rows=0)
        self._table = table

    def show(self, rows: int) -> None:
        self._end = self.added = rows

    def table(self) -> NDArray[np.float64]:
        return self._table[: self._end]
