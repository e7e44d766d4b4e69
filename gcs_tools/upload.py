"""Sending a mission to the vehicle: MISSION_COUNT → MISSION_REQUEST_INT → MISSION_ITEM_INT → MISSION_ACK."""

from collections.abc import Sequence
from typing import Any

from gcs_tools.client import RETRY_S, SYSTEM_ID, TRIES, Client, LinkError, Script
from gcs_tools.plan import Item
from sitl.mavlink import codec
from sitl.mavlink.codec import mav


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
