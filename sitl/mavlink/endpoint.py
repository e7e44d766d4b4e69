"""The vehicle's end of the MAVLink link, without sockets and clocks: datagrams and the wall time in, datagrams out.

Streams run on simulation time (the vehicle's), heartbeats, repetitions and the silence of peers on wall time.
"""

import logging
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from sitl.mavlink import metadata
from sitl.mavlink.codec import Frame, Parser, by_id, by_name, mav, message
from sitl.mavlink.commands import CommandService
from sitl.mavlink.files import Area, Files, MemoryArea, Mount
from sitl.mavlink.ftp import FtpService
from sitl.mavlink.identity import COMPONENT_ID, SIMULATOR, Identity, version
from sitl.mavlink.limits import UNLIMITED, Allowance, Limits, cost
from sitl.mavlink.link import Datagram, Link
from sitl.mavlink.logs import LogService
from sitl.mavlink.mission import MissionService
from sitl.mavlink.news import News
from sitl.mavlink.offboard import OffboardService
from sitl.mavlink.parameters import ParameterService
from sitl.mavlink.peers import Address, Peer, PortKind
from sitl.mavlink.requests import on_request_data_stream, vehicle_heartbeat
from sitl.mavlink.routing import Router, target_places
from sitl.mavlink.signing import Signer, is_signed
from sitl.mavlink.streams import FULL, NEVER, STREAMS, Profile
from sitl.onboard.modes import Severity
from sitl.onboard.plan import Plan
from sitl.onboard.plans import Plans

if TYPE_CHECKING:
    from sitl.vehicle import Vehicle

__all__ = ["Address", "Datagram", "Endpoint", "Identity", "PortKind"]

log = logging.getLogger(__name__)

HEARTBEAT_S = 1.0
REFUSALS_TOLD_S = 10.0  # wall time between two lines in the log about refused datagrams
_SETUP_SIGNING = by_name("SETUP_SIGNING").id
_STREAMED = ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET", "MANUAL_CONTROL")
Handler = Callable[[Peer, Frame], None]


class Endpoint:
    """One vehicle on the link.

    system_id: MAVLink system (instance + 1); the component is the autopilot's. static_peers: served without being
    heard. logs, scratch: the recorded flights, and what clients may write (None: in memory). on_frame: sees the bytes
    of every frame, in and out (what goes to all peers alike: once). limits: what peers may send. signer: signs what
    goes out, and what comes in must be signed. forward: pass messages on between peers. profile: of the streams.
    """

    def __init__(
        self,
        vehicle: "Vehicle",
        *,
        identity: Identity = Identity.PX4,
        system_id: int = 1,
        static_peers: Iterable[tuple[PortKind, Address]] = (),
        logs: Area | None = None,
        scratch: Area | None = None,
        limits: Limits = UNLIMITED,
        signer: Signer | None = None,
        forward: bool = False,
        profile: Profile = FULL,
    ) -> None:
        link = self._link = Link(vehicle, identity, system_id, static_peers, limits, signer, profile)
        self._vehicle = vehicle
        self._parameters = ParameterService(link)
        self._missions = MissionService(link, _stores(vehicle.plans))
        self._offboard = OffboardService(link)
        self._commands = CommandService(link)
        logs = logs or MemoryArea()
        mounts = {
            metadata.FOLDER: Mount(link.metadata.area, False),
            "logs": Mount(logs, False),
            "scratch": Mount(scratch or MemoryArea(), True),
        }
        self._ftp = FtpService(link, Files(mounts))
        self._logs = LogService(link, logs)
        self._handlers = self._table()
        self._news = News(link, self._parameters)
        self._heartbeat_due_s = float("-inf")
        self._second_beat_s = HEARTBEAT_S - (profile.phase_us or 0) * 1e-6 % HEARTBEAT_S  # after the first
        self._gcs_heard_s: float | None = None
        self._gcs_lost = False
        self._deadline_s = float("-inf")
        self._stream_due_us = 0
        self._streamed_us = 0
        self._strangers = Allowance(limits.strangers_Hz, limits.strangers_burst)
        self._router = Router(link) if forward else None
        self._refused_told = (0, float("-inf"))
        self.faults = 0  # frames whose handling failed: a mistake in this program, logged
        self.refused = 0  # datagrams beyond their sender's allowance, or of one peer too many
        self.unreadable = 0  # datagrams that held no sound frame
        self.unauthentic = 0  # frames that were not signed, not well, or not for the first time

    def _table(self) -> dict[int, tuple[Handler, int, int, bool]]:
        """Handlers by message id, with the places of target_system and target_component (−1: it has none), and
        whether they may begin something that the wall clock or the streams have to do with.
        """
        p, m, c, o = self._parameters, self._missions, self._commands, self._offboard
        handlers: dict[str, Handler] = {
            "HEARTBEAT": self._on_heartbeat,
            "PING": self._on_ping,
            "TIMESYNC": self._on_timesync,
            "COMMAND_LONG": c.on_long,
            "COMMAND_INT": c.on_int,
            "COMMAND_CANCEL": c.on_cancel,
            "SET_MODE": c.on_set_mode,
            "SETUP_SIGNING": self._on_setup_signing,
            "REQUEST_DATA_STREAM": lambda peer, frame: on_request_data_stream(self._link, peer, frame),
            "PARAM_REQUEST_LIST": p.on_list,
            "PARAM_REQUEST_READ": p.on_read,
            "PARAM_SET": p.on_set,
            "PARAM_EXT_REQUEST_LIST": p.on_extended,
            "PARAM_EXT_REQUEST_READ": p.on_extended,
            "PARAM_EXT_SET": p.on_extended_set,
            "FILE_TRANSFER_PROTOCOL": self._ftp.on_request,
            "LOG_REQUEST_LIST": self._logs.on_list,
            "LOG_REQUEST_DATA": self._logs.on_data,
            "LOG_REQUEST_END": self._logs.on_end,
            "LOG_ERASE": self._logs.on_erase,
            "MISSION_COUNT": m.on_count,
            "MISSION_ITEM_INT": m.on_item_int,
            "MISSION_ITEM": m.on_item,
            "MISSION_REQUEST_LIST": m.on_request_list,
            "MISSION_REQUEST_INT": m.on_request,
            "MISSION_REQUEST": m.on_request,
            "MISSION_REQUEST_PARTIAL_LIST": m.on_partial_list,
            "MISSION_WRITE_PARTIAL_LIST": m.on_partial_list,
            "MISSION_ACK": m.on_ack,
            "MISSION_CLEAR_ALL": m.on_clear_all,
            "MISSION_SET_CURRENT": self._on_mission_set_current,
            "SET_POSITION_TARGET_LOCAL_NED": o.on_local,
            "SET_POSITION_TARGET_GLOBAL_INT": o.on_global,
            "SET_ATTITUDE_TARGET": o.on_attitude_target,
            "MANUAL_CONTROL": o.on_manual_control,
        }
        table = {}
        for name, handler in handlers.items():
            definition = by_name(name)
            table[definition.id] = (handler, *target_places(definition.id), name not in _STREAMED)
        return table

    # --- in

    def receive(self, data: bytes, address: Address, kind: PortKind, wall_s: float) -> bool:
        """Take a datagram. Never raises, whatever the bytes. False: it was more than its sender may send."""
        link = self._link
        link.wall_s = wall_s
        if link.silent:
            return True
        peer = link.peers.find(kind, address)
        allowance = peer.allowance if peer is not None else self._strangers
        if not allowance.take(wall_s):
            self.refused += 1
            return False
        parser = peer.parser if peer is not None else Parser()
        frames = parser.feed(data)
        allowance.charge(cost(data, len(frames)) - 1)
        if not frames:
            self.unreadable += 1
        for frame in frames:
            if frame.system == link.system_id and frame.component == COMPONENT_ID:
                continue  # our own, come back over some loop
            if link.signer is not None and not self._is_authentic(link.signer, frame):
                self.unauthentic += 1
                continue
            if peer is None:
                peer = self._learn(address, kind)
                if peer is None:
                    return False
                peer.parser = parser
            self._take(peer, frame)
        return True

    def meet(self, address: Address, kind: PortKind, version: int, wall_s: float) -> "Peer | None":
        """Somebody speaks at a port that this vehicle shares: serve them. None where there are too many already."""
        self._link.wall_s = wall_s
        peer = self._link.peers.find(kind, address) or self._learn(address, kind)
        if peer is not None:
            self._hear(peer, version)
        return peer

    def take(self, frame: Frame, address: Address, kind: PortKind, wall_s: float, forwards: bool = True) -> None:
        """A frame that came to a port that this vehicle shares, paid for and found authentic there. Never raises.

        forwards: this vehicle is the one that passes it on to the others there.
        """
        self._link.wall_s = wall_s
        if self._link.silent:
            return
        peer = self._link.peers.find(kind, address) or self._learn(address, kind)
        if peer is not None:
            self._take(peer, frame, forwards)

    def _learn(self, address: Address, kind: PortKind) -> "Peer | None":
        peer = self._link.peers.learn(kind, address, self._link.wall_s, self._vehicle.now_us)
        if peer is None:
            self.refused += 1
        return peer

    def _hear(self, peer: Peer, version: int) -> None:
        if peer.hear(version, self._link.wall_s):
            self._stream_due_us = 0
            self._greet(peer)

    def _take(self, peer: Peer, frame: Frame, to_shared: bool = True) -> None:
        link = self._link
        self._hear(peer, frame.version)
        if link.on_frame is not None and frame.id != _SETUP_SIGNING:
            link.on_frame(frame.raw, False)
        if self._router is not None:
            self._router.take(peer, frame, to_shared)
        try:
            self._dispatch(peer, frame)
        except Exception:
            self.faults += 1
            log.exception("handling %s failed", frame.name)

    def _is_authentic(self, signer: Signer, frame: Frame) -> bool:
        signer.keep_time(self._link.wall_s)
        return signer.admits(frame.raw, frame.id, frame.system, frame.component)

    def _dispatch(self, peer: Peer, frame: Frame) -> None:
        entry = self._handlers.get(frame.id)
        if entry is None:
            return
        handler, system_place, component_place, begins = entry
        values = frame.message
        if system_place >= 0 and values[system_place] not in (0, self._link.system_id):
            return
        if component_place >= 0 and values[component_place] not in (0, COMPONENT_ID):
            return
        handler(peer, frame)
        if begins:
            self._deadline_s = float("-inf")  # a transfer may have begun, a rate changed: look again at the next poll
            self._stream_due_us = 0

    def _greet(self, peer: Peer) -> None:
        self._link.send(peer, vehicle_heartbeat(self._link))
        text = f"{SIMULATOR} {'.'.join(map(str, version()))}: simulated '{self._vehicle.spec.name}'"
        self._link.tell(peer, Severity.INFO, text)

    def _on_heartbeat(self, _peer: Peer, frame: Frame) -> None:
        """A ground station that has no key doesn't hold off the failsafe."""
        trusted = self._link.signer is None or is_signed(frame.raw)
        if frame.message.type == mav.MAV_TYPE_GCS and trusted:
            self._gcs_heard_s = self._link.wall_s
            if self._gcs_lost:
                self._gcs_lost = False
                self._vehicle.commander.link_lost(False)

    def _on_setup_signing(self, peer: Peer, _frame: Frame) -> None:
        """The guide has a key sent only over a link that nobody else can hear, which a UDP port is not."""
        self._link.complain(peer, "Signing keys are set with --signing-key FILE, not over the link")

    def _on_ping(self, peer: Peer, frame: Frame) -> None:
        m = frame.message
        if not m.target_system and not m.target_component:
            back = {"target_system": frame.system, "target_component": frame.component}
            self._link.send(peer, message("PING", time_usec=m.time_usec, seq=m.seq, **back))

    def _on_timesync(self, peer: Peer, frame: Frame) -> None:
        """Answered with the vehicle's clock, which is the one that targets are stamped with."""
        m = frame.message
        if m.tc1 == 0:
            back = {"target_system": frame.system, "target_component": frame.component}
            self._link.send(peer, message("TIMESYNC", tc1=self._vehicle.now_us * 1000, ts1=m.ts1, **back))

    def _on_mission_set_current(self, peer: Peer, frame: Frame) -> None:
        outcome = self._vehicle.mission.set_current(frame.message.seq)
        if not outcome.ok:
            self._link.complain(peer, outcome.reason)

    # --- out

    def poll(self, wall_s: float) -> list[Datagram]:
        """All that is due now. Call it after `receive` and whenever simulation time has moved."""
        link, vehicle = self._link, self._vehicle
        link.wall_s = wall_s
        if link.signer is not None:
            link.signer.keep_time(wall_s)
        if self._news.waiting and self._news.tell():
            self._beat()
            self._deadline_s = float("-inf")
        if wall_s >= self._deadline_s:
            self._keep_time()
        now_us = vehicle.now_us
        if now_us >= self._stream_due_us or now_us < self._streamed_us:
            self._stream(now_us)
        out = link.outbox
        if out:
            link.outbox = []
        return [] if link.silent else out

    def next_deadline(self) -> float:
        """Wall time of the next heartbeat, repetition or timeout: poll by then even if nothing else happens."""
        return self._deadline_s

    def _stream(self, now_us: int) -> None:
        link = self._link
        if now_us < self._streamed_us:  # the simulation was set back
            for peer in link.peers:
                peer.schedule.rewind(now_us)
        self._streamed_us = now_us
        next_us = NEVER
        for peer in link.peers:
            if not peer.streams:
                continue
            schedule = peer.schedule
            if schedule.next_us <= now_us:
                self._send_streams(peer, schedule.take(now_us))
            next_us = min(next_us, schedule.next_us)
        self._stream_due_us = next_us

    def _send_streams(self, peer: Peer, due: list[int]) -> None:
        link = self._link
        view = link.view()
        payloads = view.payloads
        for k in due:
            payload = payloads.get(k)
            if payload is None:
                payload = payloads[k] = STREAMS[k].payload(view)
            if payload:
                link.post(peer, STREAMS[k].definition, payload)

    def _keep_time(self) -> None:
        """Wall-clock duties."""
        link, now_s = self._link, self._link.wall_s
        if now_s >= self._heartbeat_due_s:
            link.peers.forget_silent(now_s, self._vehicle.now_us)
            self._stream_due_us = 0
            self._tell_refusals(now_s)
            self._beat()
            late_s = now_s - self._heartbeat_due_s
            self._heartbeat_due_s = now_s + (HEARTBEAT_S - late_s if late_s < HEARTBEAT_S else self._second_beat_s)
        deadline_s = self._watch_ground_stations(now_s)
        self._missions.advance()
        self._commands.advance()
        self._parameters.advance()
        self._ftp.advance()
        self._logs.advance()
        services = (self._missions, self._parameters, self._commands, self._ftp, self._logs)
        self._deadline_s = min(self._heartbeat_due_s, deadline_s, *(service.deadline_s for service in services))

    def _beat(self) -> None:
        self._link.broadcast(vehicle_heartbeat(self._link))

    def _tell_refusals(self, now_s: float) -> None:
        told, told_s = self._refused_told
        if self.refused > told and now_s - told_s >= REFUSALS_TOLD_S:
            log.warning("%d datagrams refused: more than their senders may send", self.refused - told)
            self._refused_told = (self.refused, now_s)

    def _watch_ground_stations(self, now_s: float) -> float:
        """Tell the commander when the last ground station has gone quiet. Returns when that would be."""
        if self._gcs_heard_s is None or self._gcs_lost:
            return float("inf")
        lost_s = self._gcs_heard_s + self._vehicle.parameters["COM_DL_LOSS_T"]
        if now_s < lost_s:
            return lost_s
        self._gcs_lost = True
        self._vehicle.commander.link_lost(True)
        return float("inf")

    # --- what the caller may ask and set

    @property
    def on_frame(self) -> Callable[[bytes, bool], None] | None:
        """Called with the bytes of every frame; the flag says that it goes out."""
        return self._link.on_frame

    @on_frame.setter
    def on_frame(self, tap: Callable[[bytes, bool], None] | None) -> None:
        self._link.on_frame = tap

    @property
    def takes(self) -> tuple[str, ...]:
        """Names of the messages that it acts on."""
        return tuple(by_id(identity).name for identity in self._handlers)

    @property
    def system_id(self) -> int:
        return self._link.system_id

    @property
    def shutdown_requested(self) -> bool:
        return self._link.shutdown_requested

    @property
    def reboot_requested(self) -> bool:
        return self._link.reboot_requested

    @property
    def forwarded(self) -> int:
        """Frames passed on from one peer to another."""
        return self._router.forwarded if self._router is not None else 0

    @property
    def peers(self) -> tuple[Peer, ...]:
        """Who is being served."""
        return tuple(self._link.peers)


def _stores(plans: Plans) -> dict[int, Plan]:
    return {
        mav.MAV_MISSION_TYPE_MISSION: plans.mission,
        mav.MAV_MISSION_TYPE_FENCE: plans.fence,
        mav.MAV_MISSION_TYPE_RALLY: plans.rally,
    }
