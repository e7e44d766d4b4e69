"""Sending plans to the vehicle: MISSION_COUNT → MISSION_REQUEST_INT → MISSION_ITEM_INT → MISSION_ACK."""

import math
from collections.abc import Sequence
from typing import Any

from gcs_tools.client import RETRY_S, SYSTEM_ID, TRIES, Client, LinkError, Script
from gcs_tools.download import download, kind_name, result_name
from gcs_tools.plan import Home, Item, Plan, Uploaded
from sitl.mavlink import codec
from sitl.mavlink.codec import mav
from sitl.mavlink.wire import float32

HOME_WITHIN_M = 10_000.0
MISSION, FENCE, RALLY = mav.MAV_MISSION_TYPE_MISSION, mav.MAV_MISSION_TYPE_FENCE, mav.MAV_MISSION_TYPE_RALLY


class _Upload:
    """What has come of one transfer. Requests are answered at once, from within `receive`."""

    def __init__(self, client: Client, items: Sequence[Item], kind: int) -> None:
        self._client, self._items, self._kind = client, items, kind
        self.requested: int | None = None
        self.tries = 0  # since the last sign of life
        self.retry_s = client.wall_s
        self.result: int | None = None

    def request(self, m: Any) -> None:
        if m.mission_type != self._kind or m.target_system not in (0, SYSTEM_ID) or m.seq >= len(self._items):
            return
        self.requested, self.tries = m.seq, 0
        self._send()

    def ack(self, m: Any) -> None:
        if m.mission_type == self._kind and m.target_system in (0, SYSTEM_ID):
            self.result = m.type

    def again(self) -> None:
        """Say the last thing again: it, or the answer to it, may have been lost."""
        if self.tries == TRIES:
            where = f"stopped at item {self.requested}" if self.requested is not None else "isn't answered"
            raise LinkError(f"the upload of {_counted(self._items, self._kind)} {where}")
        self.tries += 1
        self._send()

    def _send(self) -> None:
        self.retry_s = self._client.wall_s + RETRY_S
        address = {**self._client.address(), "mission_type": self._kind}
        if self.requested is None:
            self._client.send(codec.message("MISSION_COUNT", count=len(self._items), **address))
            return
        fields = {**self._items[self.requested]._asdict(), **address}
        first = int(self.requested == 0 and self._kind == MISSION)
        self._client.send(codec.message("MISSION_ITEM_INT", seq=self.requested, current=first, **fields))


def hand_over(client: Client, plan: Plan) -> Script[list[str]]:
    """Replace the vehicle's plans by those of a file, unless it was drawn for another place; what was sent, in words.

    Fence and rally points come first, where the file has any word on them and the vehicle has others, the mission last:
    where one of them is refused, those before it are put back as they were. Raises LinkError with the vehicle's reason.
    """
    if isinstance(plan, Uploaded) and plan.home is not None:
        yield from _is_near(client, plan.home)
    replaced: list[tuple[int, tuple[Item, ...]]] = []
    told = []
    try:
        for kind, items in ((FENCE, plan.fence), (RALLY, plan.rally)):
            if items is None:
                continue
            old = yield from download(client, kind)
            if old == tuple(map(as_carried, items)):
                continue
            yield from upload(client, items, kind)
            replaced.append((kind, old))
            told.append(f"{_counted(items, kind)} uploaded" if items else f"{kind_name(kind)} cleared")
        if isinstance(plan, Uploaded):
            yield from upload(client, plan.items)
            told.append(f"{_counted(plan.items, MISSION)} uploaded")
    except LinkError as fault:
        yield from _put_back(client, replaced, fault)
        raise
    return told


def _put_back(client: Client, replaced: list[tuple[int, tuple[Item, ...]]], fault: LinkError) -> Script[None]:
    for kind, items in reversed(replaced):
        try:
            yield from upload(client, items, kind)
        except LinkError:
            raise LinkError(f"{fault}; the old {kind_name(kind)} couldn't be put back") from None


def _is_near(client: Client, home: Home) -> Script[None]:
    client.request("HOME_POSITION")
    v = client.vehicle
    yield from client.wait(lambda: v.home is not None, 5.0, "the vehicle doesn't tell its home")
    assert v.home is not None
    away = _ground_distance_m(v.home, home)
    if away > HOME_WITHIN_M:
        raise LinkError(f"the plan's home is {away / 1000:.0f} km from the vehicle's: start the vehicle there")


def upload(client: Client, items: Sequence[Item], kind: int = MISSION) -> Script[None]:
    """Replace the vehicle's plan of a MAV_MISSION_TYPE. Raises LinkError with the vehicle's reason if it is refused."""
    transfer, asked_s = _Upload(client, items, kind), client.wall_s
    client.on["MISSION_REQUEST_INT"] = client.on["MISSION_REQUEST"] = transfer.request
    client.on["MISSION_ACK"] = transfer.ack
    try:
        while transfer.result is None:
            if client.wall_s >= transfer.retry_s:
                transfer.again()
            yield transfer.retry_s
        if transfer.result != mav.MAV_MISSION_ACCEPTED:
            yield from client.pause(0.1)  # for the reason, which is told apart
            reason = client.vehicle.reasons_since(asked_s) or result_name(transfer.result)
            raise LinkError(f"the vehicle refuses the {kind_name(kind)}: {reason}")
    finally:
        for name in ("MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"):
            client.on.pop(name, None)


def _counted(items: Sequence[Item], kind: int) -> str:
    name = "rally point" if kind == RALLY else f"{kind_name(kind)} item"
    return f"{len(items)} {name}{'' if len(items) == 1 else 's'}"


def as_carried(item: Item) -> Item:
    """With the precision of the link: its floats have 32 bits."""
    p1, p2, p3, p4, z = map(float32, (item.param1, item.param2, item.param3, item.param4, item.z))
    return item._replace(param1=p1, param2=p2, param3=p3, param4=p4, z=z)


def _ground_distance_m(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Between two (latitude, longitude) in degrees, on a sphere; good for telling towns apart."""
    lat_a, lon_a, lat_b, lon_b = (math.radians(x) for x in (*a[:2], *b[:2]))
    haversine = (
        math.sin((lat_b - lat_a) / 2) ** 2 + math.cos(lat_a) * math.cos(lat_b) * math.sin((lon_b - lon_a) / 2) ** 2
    )
    return 2 * 6_371_000.0 * math.asin(math.sqrt(min(1.0, haversine)))
