"""Sending a mission to the vehicle: MISSION_COUNT → MISSION_REQUEST_INT → MISSION_ITEM_INT → MISSION_ACK."""

import math
from collections.abc import Sequence
from typing import Any

from gcs_tools.client import RETRY_S, SYSTEM_ID, TRIES, Client, LinkError, Script
from gcs_tools.plan import Item, Uploaded
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

HOME_WITHIN_M = 10_000.0


class _Upload:
    """What has come of one transfer. Requests are answered at once, from within `receive`."""

    def __init__(self, client: Client, items: Sequence[Item]) -> None:
        self._client, self._items = client, items
        self.requested: int | None = None
        self.tries = 0  # since the last sign of life
        self.retry_s = client.wall_s
        self.result: int | None = None

    def request(self, m: Any) -> None:
        if m.mission_type != 0 or m.target_system not in (0, SYSTEM_ID) or m.seq >= len(self._items):
            return
        self.requested, self.tries = m.seq, 0
        self._send()

    def ack(self, m: Any) -> None:
        if m.mission_type == 0 and m.target_system in (0, SYSTEM_ID):
            self.result = m.type

    def again(self) -> None:
        """Say the last thing again: it, or the answer to it, may have been lost."""
        if self.tries == TRIES:
            where = f"stopped at item {self.requested}" if self.requested is not None else "isn't answered"
            raise LinkError(f"the upload of {len(self._items)} mission items {where}")
        self.tries += 1
        self._send()

    def _send(self) -> None:
        self.retry_s = self._client.wall_s + RETRY_S
        address = self._client.address()
        if self.requested is None:
            self._client.send(codec.message("MISSION_COUNT", count=len(self._items), **address))
            return
        fields = {**self._items[self.requested]._asdict(), **address}
        first = int(self.requested == 0)
        self._client.send(codec.message("MISSION_ITEM_INT", seq=self.requested, current=first, **fields))


def hand_over(client: Client, plan: Uploaded) -> Script[None]:
    """Replace the vehicle's mission by a plan's, unless the plan was drawn for another place. Raises LinkError."""
    if plan.home is not None:
        client.request("HOME_POSITION")
        v = client.vehicle
        yield from client.wait(lambda: v.home is not None, 5.0, "the vehicle doesn't tell its home")
        assert v.home is not None
        away = _ground_distance_m(v.home, plan.home)
        if away > HOME_WITHIN_M:
            raise LinkError(f"the plan's home is {away / 1000:.0f} km from the vehicle's: start the vehicle there")
    yield from upload(client, plan.items)


def upload(client: Client, items: Sequence[Item]) -> Script[None]:
    """Replace the vehicle's mission. Raises LinkError with the vehicle's reason if it is refused."""
    transfer, asked_s = _Upload(client, items), client.wall_s
    client.on["MISSION_REQUEST_INT"] = client.on["MISSION_REQUEST"] = transfer.request
    client.on["MISSION_ACK"] = transfer.ack
    try:
        while transfer.result is None:
            if client.wall_s >= transfer.retry_s:
                transfer.again()
            yield transfer.retry_s
        if transfer.result != mav.MAV_MISSION_ACCEPTED:
            yield from client.pause(0.1)  # for the reason, which is told apart
            _refuse(client, transfer, asked_s)
    finally:
        for name in ("MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"):
            client.on.pop(name, None)


def _refuse(client: Client, transfer: _Upload, asked_s: float) -> None:
    entry = mav.enums["MAV_MISSION_RESULT"].get(transfer.result)
    name = entry.name.removeprefix("MAV_MISSION_").lower().replace("_", " ") if entry else str(transfer.result)
    raise LinkError(f"the vehicle refuses the mission: {client.vehicle.reasons_since(asked_s) or name}")


def _ground_distance_m(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Between two (latitude, longitude) in degrees, on a sphere; good for telling towns apart."""
    lat_a, lon_a, lat_b, lon_b = (math.radians(x) for x in (*a[:2], *b[:2]))
    haversine = (
        math.sin((lat_b - lat_a) / 2) ** 2 + math.cos(lat_a) * math.cos(lat_b) * math.sin((lon_b - lon_a) / 2) ** 2
    )
    return 2 * 6_371_000.0 * math.asin(math.sqrt(min(1.0, haversine)))
