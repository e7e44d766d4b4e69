"""What a flight and an experiment have in common: a vehicle, a time of their own, and news for whoever shows them."""

import math
from abc import ABC, abstractmethod
from typing import Any

from gcs_tools.client import Client
from sitl.mavlink.codec import mav


class Undertaking(ABC):
    """`phase`, `t_s` and `progress` tell how far it is; `notes` what happened, to be taken out by whoever shows it."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.phase = "connecting"
        self.notes: list[str] = []
        self.t0_s: float | None = None  # when its time starts, on the vehicle's clock
        self._said = ""  # by the vehicle, most recently
        client.on["STATUSTEXT"] = self._told

    @property
    def t_s(self) -> float:
        """Vehicle time since its start; negative before it, negative infinity where that isn't known yet."""
        newest = self.client.vehicle.clock.newest_s
        return newest - self.t0_s if newest is not None and self.t0_s is not None else -math.inf

    @property
    @abstractmethod
    def progress(self) -> float:
        """From 0 to 1."""

    def _told(self, m: Any) -> None:
        """What it says again and again, as it does while it is asked again and again, is noted once."""
        texts = self.client.vehicle.texts
        if m.severity <= mav.MAV_SEVERITY_WARNING and texts and texts[-1].text != self._said:
            self._said = texts[-1].text
            self._note(f"vehicle says: {self._said}")

    def _note(self, text: str) -> None:
        t = self.t_s
        self.notes.append(f"t = {t:.1f} s: {text}" if math.isfinite(t) else text)
