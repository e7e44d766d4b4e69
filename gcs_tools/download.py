"""Reading one of the vehicle's plans: MISSION_REQUEST_LIST → MISSION_COUNT → MISSION_REQUEST_INT → MISSION_ITEM_INT."""

from typing import Any

from gcs_tools.client import RETRY_S, SYSTEM_ID, TRIES, Client, LinkError, Script
from gcs_tools.plan import Item
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

_NAMES = ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK")


class _Download:
    """What has come of one transfer. The next item is asked for at once, from within `receive`."""

    def __init__(self, client: Client, kind: int) -> None:
        self._client, self._kind = client, kind
        self.count: int | None = None
        self.items: list[Item] = []
        self.tries = 0  # since the last sign of life
        self.retry_s = client.wall_s
        self.refused: int | None = None

    @property
    def done(self) -> bool:
        return self.refused is not None or len(self.items) == self.count

    def _is_mine(self, m: Any) -> bool:
        return m.mission_type == self._kind and m.target_system in (0, SYSTEM_ID)

    def counted(self, m: Any) -> None:
        if self._is_mine(m) and self.count is None:
            self.count = m.count
            self._go_on()

    def item(self, m: Any) -> None:
        if self._is_mine(m) and self.count is not None and m.seq == len(self.items) < self.count:
            self.items.append(Item(*(getattr(m, name) for name in Item._fields)))
            self._go_on()

    def ack(self, m: Any) -> None:
        if self._is_mine(m) and m.type != mav.MAV_MISSION_ACCEPTED:
            self.refused = m.type

    def again(self) -> None:
        """Ask again: the question, or the answer to it, may have been lost."""
        if self.tries == TRIES:
            where = "isn't answered" if self.count is None else f"stopped at item {len(self.items)}"
            raise LinkError(f"the download of the {kind_name(self._kind)} {where}")
        self.tries += 1
        self._ask()

    def _go_on(self) -> None:
        self.tries = 0
        if not self.done:
            self._ask()
        elif self.items:
            address = self._client.address()
            self._client.send(codec.message("MISSION_ACK", type=0, mission_type=self._kind, **address))

    def _ask(self) -> None:
        self.retry_s = self._client.wall_s + RETRY_S
        address = {**self._client.address(), "mission_type": self._kind}
        if self.count is None:
            self._client.send(codec.message("MISSION_REQUEST_LIST", **address))
        else:
            self._client.send(codec.message("MISSION_REQUEST_INT", seq=len(self.items), **address))


def download(client: Client, kind: int) -> Script[tuple[Item, ...]]:
    """The items of the vehicle's plan of a MAV_MISSION_TYPE. Raises LinkError."""
    transfer = _Download(client, kind)
    client.on |= dict(zip(_NAMES, (transfer.counted, transfer.item, transfer.ack), strict=True))
    try:
        while not transfer.done:
            if client.wall_s >= transfer.retry_s:
                transfer.again()
            yield transfer.retry_s
    finally:
        for name in _NAMES:
            client.on.pop(name, None)
    if transfer.refused is not None:
        raise LinkError(f"the vehicle doesn't tell its {kind_name(kind)}: {result_name(transfer.refused)}")
    return tuple(transfer.items)


def kind_name(kind: int) -> str:
    """A MAV_MISSION_TYPE in words."""
    return {mav.MAV_MISSION_TYPE_FENCE: "fence", mav.MAV_MISSION_TYPE_RALLY: "rally points"}.get(kind, "mission")


def result_name(result: int) -> str:
    """A MAV_MISSION_RESULT in words."""
    entry = mav.enums["MAV_MISSION_RESULT"].get(result)
    return entry.name.removeprefix("MAV_MISSION_").lower().replace("_", " ") if entry else str(result)
