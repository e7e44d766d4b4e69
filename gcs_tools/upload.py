"""Sending a mission to the vehicle: MISSION_COUNT → MISSION_REQUEST_INT → MISSION_ITEM_INT → MISSION_ACK."""

from collections.abc import Sequence
from typing import Any

from gcs_tools.client import RETRY_S, SYSTEM_ID, TRIES, Client, LinkError, Script
from gcs_tools.plan import Item
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

SILENCE_S = 5.0  # in the middle of the transfer; the vehicle asks again by itself much sooner


class _Upload:
    """What has come of one transfer. Requests are answered at once, from within `receive`."""

    def __init__(self, client: Client, items: Sequence[Item]) -> None:
        self._client, self._items = client, items
        self.requested: int | None = None
        self.touched_s = client.wall_s
        self.result: int | None = None

    def request(self, m: Any) -> None:
        if m.mission_type != 0 or m.target_system not in (0, SYSTEM_ID) or m.seq >= len(self._items):
            return
        self.requested, self.touched_s = m.seq, self._client.wall_s
        i = self._items[m.seq]
        fields = {**i._asdict(), **self._client.address()}
        self._client.send(codec.message("MISSION_ITEM_INT", seq=m.seq, current=int(m.seq == 0), **fields))

    def ack(self, m: Any) -> None:
        if m.mission_type == 0 and m.target_system in (0, SYSTEM_ID):
            self.result = m.type


def upload(client: Client, items: Sequence[Item]) -> Script[None]:
    """Replace the vehicle's mission. Raises LinkError naming the item and the vehicle's reason if it is refused."""
    transfer, asked_s, tries = _Upload(client, items), client.wall_s, 0
    client.on["MISSION_REQUEST_INT"] = client.on["MISSION_REQUEST"] = transfer.request
    client.on["MISSION_ACK"] = transfer.ack
    count = codec.message("MISSION_COUNT", count=len(items), **client.address())
    next_try_s = client.wall_s
    try:
        while transfer.result is None:
            if transfer.requested is None and client.wall_s >= next_try_s:
                if tries == TRIES:
                    raise LinkError("the vehicle doesn't answer the mission upload")
                client.send(count)
                tries, next_try_s = tries + 1, client.wall_s + RETRY_S
            if client.wall_s - transfer.touched_s > SILENCE_S and transfer.requested is not None:
                raise LinkError(f"the mission upload stopped at item {transfer.requested} of {len(items)}")
            yield next_try_s if transfer.requested is None else transfer.touched_s + SILENCE_S
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
