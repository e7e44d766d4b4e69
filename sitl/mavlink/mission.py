"""The plan transfer: one engine for every kind of plan, over one store each.

Upload (this side asks):   COUNT → ask item 0 → item 0 → ask item 1 → … → last item → the store takes all → ACK
Download (they ask):       REQUEST_LIST → COUNT → ask item k → item k → … → ACK

Both sides repeat: here, what was sent last goes out again after RETRY_S of wall time without an answer, and GIVE_UP_S
without progress end the transfer. An upload that ends early, for whatever reason, leaves the old plan whole: the store
sees all items at once or none.

| event            | no upload               | an upload by the same partner | an upload by another |
|------------------|-------------------------|-------------------------------|----------------------|
| COUNT            | start                   | start again                   | ACK: denied          |
| item, the wanted | the last one again: ACK | keep, ask for the next        | ignored              |
| item, another    | ignored                 | ignored                       | ignored              |
| ACK, cancelling  | ignored                 | end                           | ignored              |
| CLEAR_ALL        | clear                   | end, clear                    | ACK: denied          |

Reading locks nothing: a download goes on with the plan that it began with. A partner is a component of a system at an
address.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from sitl.mavlink.codec import Frame, mav, message
from sitl.onboard.modes import Severity
from sitl.onboard.plan import CAPACITY, Fault, MissionItem

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

RETRY_S = 0.25  # PX4's
GIVE_UP_S = 5.0  # PX4's
DOWNLOADS_MAX = 32

_FAULTS = {
    "frame": mav.MAV_MISSION_UNSUPPORTED_FRAME,
    "command": mav.MAV_MISSION_UNSUPPORTED,
    "param1": mav.MAV_MISSION_INVALID_PARAM1,
    "param2": mav.MAV_MISSION_INVALID_PARAM2,
    "param3": mav.MAV_MISSION_INVALID_PARAM3,
    "param4": mav.MAV_MISSION_INVALID_PARAM4,
    "param5": mav.MAV_MISSION_INVALID_PARAM5_X,
    "param6": mav.MAV_MISSION_INVALID_PARAM6_Y,
    "param7": mav.MAV_MISSION_INVALID_PARAM7,
    "total": mav.MAV_MISSION_ERROR,
    "place": mav.MAV_MISSION_INVALID,
}
_LOCAL_FRAME, _MISSION_FRAME = mav.MAV_FRAME_LOCAL_NED, mav.MAV_FRAME_MISSION


class Store(Protocol):
    """A plan that can be transferred."""

    @property
    def items(self) -> Sequence[MissionItem]: ...
    @property
    def plan_id(self) -> int: ...
    def replace(self, items: Sequence[MissionItem]) -> Fault | None: ...


class Partner(NamedTuple):
    peer: "Peer"
    system: int
    component: int


@dataclass
class Upload:
    partner: Partner
    kind: int  # MAV_MISSION_TYPE
    count: int
    sent_s: float
    progress_s: float
    items: list[MissionItem] = field(default_factory=list)


@dataclass
class Download:
    kind: int
    items: Sequence[MissionItem]
    plan_id: int
    sent_s: float
    progress_s: float
    last: int | None = None  # item sent last; None: only the count so far


class MissionService:
    """Answers the MISSION_* messages. `stores` by MAV_MISSION_TYPE; a type without store is empty and takes nothing."""

    def __init__(self, link: "Link", stores: Mapping[int, Store]) -> None:
        self._link = link
        self._stores = stores
        self._upload: Upload | None = None
        self._done: tuple[Partner, int, int] | None = None  # partner, kind, last index of the latest upload taken
        self._downloads: dict[tuple[Partner, int], Download] = {}

    # --- upload

    def on_count(self, peer: "Peer", frame: Frame) -> None:
        m, partner = frame.message, _partner(peer, frame)
        kind, upload = m.mission_type, self._upload
        if upload is not None and upload.partner != partner:
            self._ack(partner, kind, mav.MAV_MISSION_DENIED)
            self._link.complain(peer, "Upload denied: another one is under way")
        elif kind not in self._stores:
            self._ack(partner, kind, mav.MAV_MISSION_UNSUPPORTED)
        elif m.count > CAPACITY:
            self._ack(partner, kind, mav.MAV_MISSION_NO_SPACE)
            self._link.complain(peer, f"Upload refused: {m.count} items, there is room for {CAPACITY}")
        else:
            now_s = self._link.wall_s
            self._done = None
            self._upload = Upload(partner, kind, m.count, now_s, now_s)
            self._go_on(self._upload)

    def on_item_int(self, peer: "Peer", frame: Frame) -> None:
        m = frame.message
        params = m.param1, m.param2, m.param3, m.param4
        item = MissionItem(m.frame, m.command, m.current, m.autocontinue, *params, m.x, m.y, m.z, m.mission_type)
        self._take(_partner(peer, frame), m.seq, item)

    def on_item(self, peer: "Peer", frame: Frame) -> None:
        """The float form, from clients that answer with it."""
        m = frame.message
        scale = {_LOCAL_FRAME: 1e4, _MISSION_FRAME: 1.0}.get(m.frame, 1e7)
        x, y = (round(v * scale) if abs(v * scale) < 2**31 else 2**31 - 1 for v in (m.x, m.y))  # NaN: unset
        params = m.param1, m.param2, m.param3, m.param4
        item = MissionItem(m.frame, m.command, m.current, m.autocontinue, *params, x, y, m.z, m.mission_type)
        self._take(_partner(peer, frame), m.seq, item)

    def _take(self, partner: Partner, seq: int, item: MissionItem) -> None:
        upload = self._upload
        if upload is None:
            if self._done == (partner, item.mission_type, seq):  # the ACK was lost
                self._ack(partner, item.mission_type, mav.MAV_MISSION_ACCEPTED, self._stores[item.mission_type].plan_id)
            return
        if upload.partner != partner or upload.kind != item.mission_type or seq != len(upload.items):
            return  # a late copy, or out of turn: the wanted one is asked for again in time
        upload.items.append(item)
        upload.progress_s = self._link.wall_s
        self._go_on(upload)

    def _go_on(self, upload: Upload) -> None:
        """Ask for the next item, or close."""
        if len(upload.items) < upload.count:
            self._ask(upload)
            return
        self._upload = None
        store = self._stores[upload.kind]
        fault = store.replace(upload.items)
        if fault is None:
            self._done = (upload.partner, upload.kind, upload.count - 1)
            self._ack(upload.partner, upload.kind, mav.MAV_MISSION_ACCEPTED, store.plan_id)
        else:
            self._ack(upload.partner, upload.kind, _FAULTS[fault.field])
            place = "Plan" if fault.field == "total" else f"Item {fault.index}, {fault.field}"
            self._link.tell(upload.partner.peer, Severity.ERROR, f"{place} refused: {fault.reason}")

    def _ask(self, upload: Upload) -> None:
        upload.sent_s = self._link.wall_s
        self._send("MISSION_REQUEST_INT", upload.partner, upload.kind, seq=len(upload.items))

    # --- download

    def on_request_list(self, peer: "Peer", frame: Frame) -> None:
        partner, kind = _partner(peer, frame), frame.message.mission_type
        store = self._stores.get(kind)
        if store is None:
            self._send("MISSION_COUNT", partner, kind, count=0)
            return
        if len(self._downloads) >= DOWNLOADS_MAX:
            self._downloads.pop(next(iter(self._downloads)))
        now_s = self._link.wall_s
        download = Download(kind, store.items, store.plan_id, now_s, now_s)
        self._downloads.pop((partner, kind), None)
        if download.items:  # a count of nothing ends it: MAVProxy doesn't acknowledge one
            self._downloads[partner, kind] = download
        self._say(partner, download)

    def on_request(self, peer: "Peer", frame: Frame) -> None:
        """MISSION_REQUEST_INT, and the older MISSION_REQUEST, which is answered alike."""
        m, partner = frame.message, _partner(peer, frame)
        kind, now_s = m.mission_type, self._link.wall_s
        store = self._stores.get(kind)
        download = self._downloads.get((partner, kind))
        if download is None:  # beyond a transfer: whoever knows what it wants may have it
            if store is None or m.seq >= len(store.items):
                self._ack(partner, kind, mav.MAV_MISSION_INVALID_SEQUENCE if store else mav.MAV_MISSION_UNSUPPORTED)
                return
            download = Download(kind, store.items, store.plan_id, now_s, now_s)
        elif m.seq >= len(download.items):
            self._ack(partner, kind, mav.MAV_MISSION_INVALID_SEQUENCE)
            return
        download.progress_s, download.last = now_s, m.seq
        self._say(partner, download)

    def _say(self, partner: Partner, download: Download) -> None:
        """The count, or the item that was asked for last."""
        download.sent_s = self._link.wall_s
        if download.last is None:
            count, identity = len(download.items), download.plan_id
            self._send("MISSION_COUNT", partner, download.kind, count=count, opaque_id=identity)
            return
        i = download.items[download.last]
        self._send(
            "MISSION_ITEM_INT",
            partner,
            download.kind,
            seq=download.last,
            frame=i.frame,
            command=i.command,
            current=i.current,
            autocontinue=i.autocontinue,
            param1=i.param1,
            param2=i.param2,
            param3=i.param3,
            param4=i.param4,
            x=i.x,
            y=i.y,
            z=i.z,
        )

    # --- both

    def on_ack(self, peer: "Peer", frame: Frame) -> None:
        m, partner = frame.message, _partner(peer, frame)
        self._downloads.pop((partner, m.mission_type), None)
        upload = self._upload
        if upload and m.type != mav.MAV_MISSION_ACCEPTED and (upload.partner, upload.kind) == (partner, m.mission_type):
            self._upload = None

    def on_clear_all(self, peer: "Peer", frame: Frame) -> None:
        kind, partner = frame.message.mission_type, _partner(peer, frame)
        if self._upload is not None and self._upload.partner != partner:
            self._ack(partner, kind, mav.MAV_MISSION_DENIED)
            self._link.complain(peer, "Clearing denied: an upload is under way")
            return
        self._upload = self._done = None
        kinds = list(self._stores) if kind == mav.MAV_MISSION_TYPE_ALL else [kind]
        results = [self._clear(k) for k in kinds]
        self._ack(partner, kind, max(results, default=mav.MAV_MISSION_ACCEPTED))

    def _clear(self, kind: int) -> int:
        if kind not in self._stores:
            return int(mav.MAV_MISSION_UNSUPPORTED)
        return int(_FAULTS["total"] if self._stores[kind].replace(()) else mav.MAV_MISSION_ACCEPTED)

    def on_partial_list(self, peer: "Peer", frame: Frame) -> None:
        self._ack(_partner(peer, frame), frame.message.mission_type, mav.MAV_MISSION_UNSUPPORTED)

    # --- time

    @property
    def deadline_s(self) -> float:
        """Wall time of the next repetition or end."""
        pending: list[Upload | Download] = list(self._downloads.values())
        if self._upload is not None:
            pending.append(self._upload)
        return min((min(t.sent_s + RETRY_S, t.progress_s + GIVE_UP_S) for t in pending), default=float("inf"))

    def advance(self) -> None:
        """Repeat what got no answer, end what makes no progress."""
        now_s = self._link.wall_s
        upload = self._upload
        if upload is not None and (
            now_s - upload.progress_s >= GIVE_UP_S or upload.partner.peer not in self._link.peers
        ):
            self._upload = None
            self._ack(upload.partner, upload.kind, mav.MAV_MISSION_OPERATION_CANCELLED)
            self._link.tell(upload.partner.peer, Severity.WARNING, "Upload timed out: the old plan stays")
        elif upload is not None and now_s - upload.sent_s >= RETRY_S:
            self._ask(upload)
        for (partner, kind), download in list(self._downloads.items()):
            if now_s - download.progress_s >= GIVE_UP_S or partner.peer not in self._link.peers:
                del self._downloads[partner, kind]
            elif now_s - download.sent_s >= RETRY_S:
                self._say(partner, download)

    # --- out

    def _ack(self, partner: Partner, kind: int, result: int, plan_id: int = 0) -> None:
        self._send("MISSION_ACK", partner, kind, type=result, opaque_id=plan_id)

    def _send(self, name: str, partner: Partner, kind: int, **fields: Any) -> None:
        address = {"target_system": partner.system, "target_component": partner.component, "mission_type": kind}
        self._link.send(partner.peer, message(name, **address, **fields))


def _partner(peer: "Peer", frame: Frame) -> Partner:
    return Partner(peer, frame.system, frame.component)
