"""The parameter protocol: list, read, set, and every peer hears of a change.

Floats travel as REAL32, integers as INT32 whose four bytes stand in the float field (bytewise, as PX4 does). A write
is always answered: PARAM_VALUE with the value in force, or PARAM_ERROR with the reason, followed by PARAM_VALUE with
the old value where the name is known, for clients that wait for nothing else.

`_HASH_CHECK` is PX4's: a checksum over all names and values that goes out ahead of the list, so that a ground station
with a fresh copy can call the list off by writing it back. Whoever asks again while a list is under way wants the
values: the list starts anew, without the checksum. What the vehicle changes by itself has no part in it.

There are no extended parameters (PARAM_EXT_*): writing one is refused, and asking for them answered by a text.
"""

import struct
from typing import TYPE_CHECKING, Any

from sitl.mavlink.codec import Frame, by_name, mav, message
from sitl.mavlink.ftp_payload import crc32
from sitl.mavlink.limits import Allowance
from sitl.onboard.modes import Event
from sitl.onboard.parameters import ParameterRefusal

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

HASH_CHECK = "_HASH_CHECK"
LIST_BURST = 20  # values of a list that go out at once
LIST_RATE_HZ = 1000.0  # values a second of wall time beyond the burst
_HASH_PLACE = -1  # in a list: ahead of the first value
_NO_INDEX = 0xFFFF

_VALUE = by_name("PARAM_VALUE")
_INT_VALUE = struct.Struct("<iHH16sB")  # PARAM_VALUE with the bytes of an integer in place of the float
_UINT_VALUE = struct.Struct("<IHH16sB")
_INT = struct.Struct("<i")

_ERRORS = {
    ParameterRefusal.UNKNOWN: 1,  # MAV_PARAM_ERROR: does not exist
    ParameterRefusal.NOT_FINITE: 2,  # value out of range
    ParameterRefusal.OUT_OF_RANGE: 2,
    ParameterRefusal.READ_ONLY: 5,
    ParameterRefusal.WRONG_TYPE: 7,  # type mismatch
    ParameterRefusal.NOT_SAVED: 3,  # permission denied
}


class Listing:
    """Where one peer's list stands."""

    __slots__ = ("allowance", "next")

    def __init__(self) -> None:
        self.next: int | None = None
        self.allowance = Allowance(LIST_RATE_HZ, LIST_BURST)

    def start(self) -> None:
        """From the top, or from the first value if it was under way."""
        self.next = _HASH_PLACE if self.next is None else 0


class ParameterService:
    """Answers the PARAM_* messages."""

    def __init__(self, link: "Link") -> None:
        self._link = link
        self._parameters = link.vehicle.parameters
        self._listing: list[Peer] = []
        self._own: dict[int, Peer] = {}  # number of the event that a peer's write has caused: it has its answer
        self._hash = (-1, 0)  # generation, checksum

    @property
    def deadline_s(self) -> float:
        """Wall time of the next piece of a list."""
        return self._link.wall_s + 0.01 if self._listing else float("inf")

    def on_list(self, peer: "Peer", frame: Frame) -> None:
        peer.listing.start()
        if peer not in self._listing:
            self._listing.append(peer)

    def on_read(self, peer: "Peer", frame: Frame) -> None:
        m = frame.message
        names = self._parameters.names
        if m.param_index < 0 and m.param_id == HASH_CHECK:
            self._send_hash(peer)
        elif m.param_index < 0 and m.param_id in self._parameters:
            self._send_value(peer, m.param_id)
        elif 0 <= m.param_index < len(names):
            self._send_value(peer, names[m.param_index])
        else:
            self._send_error(peer, frame, m.param_id, m.param_index, ParameterRefusal.UNKNOWN)

    def on_set(self, peer: "Peer", frame: Frame) -> None:
        m = frame.message
        name = m.param_id
        if name == HASH_CHECK:  # the peer's copy is good: whatever the value, the list is called off
            peer.listing.next = None
            return
        if m.param_type == mav.MAV_PARAM_TYPE_REAL32:
            refusal = self._set(peer, name, m.param_value, is_int=False)
        elif m.param_type == mav.MAV_PARAM_TYPE_INT32:
            refusal = self._set(peer, name, _INT.unpack(frame.payload[:4])[0], is_int=True)
        else:
            refusal = ParameterRefusal.WRONG_TYPE if name in self._parameters else ParameterRefusal.UNKNOWN
        if refusal is not None:
            self._send_error(peer, frame, name, -1, refusal)
        if refusal is not ParameterRefusal.UNKNOWN:
            self._send_value(peer, name)

    def on_extended(self, peer: "Peer", frame: Frame) -> None:
        self._link.complain(peer, "There are no extended parameters: use PARAM_REQUEST_LIST")

    def on_extended_set(self, peer: "Peer", frame: Frame) -> None:
        m = frame.message
        result = mav.PARAM_ACK_VALUE_UNSUPPORTED
        self._link.send(
            peer, message("PARAM_EXT_ACK", param_id=m.param_id, param_type=m.param_type, param_result=result)
        )

    def _set(self, peer: "Peer", name: str, value: float, *, is_int: bool) -> ParameterRefusal | None:
        events = self._link.vehicle.events
        first = events.next_number
        refusal = self._parameters.set(name, value, is_int)
        for event in events.since(first):
            if event.text == name:
                self._own[event.number] = peer
        return refusal

    def on_change(self, event: Event) -> None:
        """Tell all peers of a value that has changed, whoever changed it."""
        if event.text in self._parameters:
            payload = self._value(event.text)
            self._link.broadcast_packed(_VALUE, payload, but=self._own.pop(event.number, None))

    def advance(self) -> None:
        """Send what the lists under way may send by now."""
        if self._listing:
            self._listing = [peer for peer in self._listing if self._advance(peer)]

    def _advance(self, peer: "Peer") -> bool:
        listing, names = peer.listing, self._parameters.names
        if listing.next is None or peer not in self._link.peers:
            return False
        while listing.allowance.take(self._link.wall_s):
            if listing.next == _HASH_PLACE:
                self._send_hash(peer)
            else:
                self._send_value(peer, names[listing.next])
            listing.next += 1
            if listing.next >= len(names):
                listing.next = None
                return False
        return True

    def _value(self, name: str) -> bytes:
        p = self._parameters
        place = len(p.names), p.names.index(name), name.encode()
        if p.declaration(name).is_int:
            payload = _INT_VALUE.pack(int(p[name]), *place, mav.MAV_PARAM_TYPE_INT32)
        else:
            payload = _VALUE.struct.pack(p[name], *place, mav.MAV_PARAM_TYPE_REAL32)
        return payload.rstrip(b"\0")

    def _send_value(self, peer: "Peer", name: str) -> None:
        self._link.send_packed(peer, _VALUE, self._value(name))

    def _send_hash(self, peer: "Peer") -> None:
        place = len(self._parameters.names), _NO_INDEX, HASH_CHECK.encode()
        payload = _UINT_VALUE.pack(self.checksum(), *place, mav.MAV_PARAM_TYPE_UINT32)
        self._link.send_packed(peer, _VALUE, payload.rstrip(b"\0"))

    def checksum(self) -> int:
        """PX4's: over each name and the four bytes of its value, in order of the names."""
        p = self._parameters
        if self._hash[0] != p.generation:
            crc = 0
            for name in p.names:
                d = p.declaration(name)
                if not d.volatile:
                    value = struct.pack("<i", int(p[name])) if d.is_int else struct.pack("<f", p[name])
                    crc = crc32(name.encode() + value, crc)
            self._hash = (p.generation, crc)
        return self._hash[1]

    def _send_error(self, peer: "Peer", frame: Frame, name: str, index: int, refusal: ParameterRefusal) -> None:
        error: Any = message(
            "PARAM_ERROR",
            target_system=frame.system,
            target_component=frame.component,
            param_id=name,
            param_index=index,
            error=_ERRORS[refusal],
        )
        self._link.send(peer, error)
