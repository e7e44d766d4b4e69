"""COMMAND_LONG, COMMAND_INT and SET_MODE: one way to the table of actions, and exactly one answer.

Every command gets exactly one terminal COMMAND_ACK: what is not in the table is UNSUPPORTED; infinite parameters and
reserved ones that are set are DENIED; NaN means unset, and so does INT32_MAX in COMMAND_INT's x and y. A repetition
(`confirmation` above 0) of a command that was just answered is answered again without being carried out again.

A command that takes time is first answered IN_PROGRESS, again every PROGRESS_S with how far it has come (MAVSDK gives
it up after 3 s of silence, QGroundControl after little more than one), and finally with its result: ACCEPTED, CANCELLED
after a COMMAND_CANCEL, FAILED where something else has been flown instead. Asked for again by the same sender it begins
anew, and a repetition is answered with its progress.

A refusal's reason goes to the peer that asked as STATUSTEXT.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sitl.mavlink.actions import TABLE
from sitl.mavlink.codec import Frame, mav, message
from sitl.mavlink.command import UNSUPPORTED_FRAME, Command, Entry, Reply, denied, has_place
from sitl.mavlink.identity import Identity
from sitl.mavlink.mode_commands import set_custom_mode
from sitl.mavlink.wire import INT32_UNSET, NAN
from sitl.onboard.guided import Task
from sitl.onboard.modes import EventKind

if TYPE_CHECKING:
    from sitl.mavlink.link import Link
    from sitl.mavlink.peers import Peer

ANSWERS_MAX = 16  # remembered per peer
ANSWER_VALID_S = 10.0  # wall time; a later repetition is a new command
CANCELLED = 6  # MAV_RESULT_CANCELLED
RELATIVE = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT
PROGRESS_S = 0.5  # wall time between two acknowledgements of a command under way
_ENDED = {Task.State.DONE: mav.MAV_RESULT_ACCEPTED, Task.State.INTERRUPTED: mav.MAV_RESULT_FAILED}
_LONG_REPEATED = slice(0, 32)  # COMMAND_LONG's payload without `confirmation`, its last byte


class Answers:
    """What one peer's latest commands were answered with."""

    __slots__ = ("_kept",)

    def __init__(self) -> None:
        self._kept: dict[tuple[int, int, int], tuple[bytes, Reply, float]] = {}

    def find(self, frame: Frame, wall_s: float) -> Reply | None:
        """The answer to the same command from the same sender, if it is fresh."""
        kept = self._kept.get((frame.system, frame.component, frame.message.command))
        if kept is None or kept[0] != frame.payload[_LONG_REPEATED] or wall_s - kept[2] > ANSWER_VALID_S:
            return None
        return kept[1]

    def keep(self, frame: Frame, reply: Reply, wall_s: float) -> None:
        key = (frame.system, frame.component, frame.message.command)
        self._kept.pop(key, None)
        if len(self._kept) >= ANSWERS_MAX:
            del self._kept[next(iter(self._kept))]
        self._kept[key] = (frame.payload[_LONG_REPEATED], reply, wall_s)


@dataclass
class Running:
    """A command whose result is still to come."""

    peer: "Peer"
    frame: Frame
    task: Task
    told_s: float = float("-inf")
    cancelled: bool = False


class CommandService:
    """Answers COMMAND_LONG, COMMAND_INT, COMMAND_CANCEL and SET_MODE."""

    def __init__(self, link: "Link") -> None:
        self._link = link
        self._running: dict[tuple[Peer, int, int, int], Running] = {}  # by peer, system, component and command

    def on_long(self, peer: "Peer", frame: Frame) -> None:
        m = frame.message
        entry = TABLE.get(m.command)
        if entry is not None and not entry.query and m.confirmation:
            running = self._running.get(_key(peer, frame, m.command))
            if running is not None:
                self._tell_progress(running)
                return
            answer = peer.answers.find(frame, self._link.wall_s)
            if answer is not None:
                self._acknowledge(peer, frame, answer)
                return
        params = (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7)
        reply = self._answer(peer, frame, entry, Command(m.command, params, None))
        if entry is not None and not entry.query and reply.task is None:
            peer.answers.keep(frame, reply, self._link.wall_s)

    def on_int(self, peer: "Peer", frame: Frame) -> None:
        m = frame.message
        entry = TABLE.get(m.command)
        scale = 1.0
        if entry is not None and entry.place:
            scale = 1e-4 if m.frame == mav.MAV_FRAME_LOCAL_NED else 1e-7
        x, y = (NAN if v == INT32_UNSET else v * scale for v in (m.x, m.y))
        params = (m.param1, m.param2, m.param3, m.param4, x, y, m.z)
        heeded = m.frame
        if heeded == RELATIVE and entry is not None and entry.amsl and self._link.identity is Identity.PX4:
            heeded = mav.MAV_FRAME_GLOBAL
        self._answer(peer, frame, entry, Command(m.command, params, heeded))

    def on_cancel(self, peer: "Peer", frame: Frame) -> None:
        """COMMAND_CANCEL: the command's own acknowledgement tells that it has ended; one that is over is left alone."""
        running = self._running.get(_key(peer, frame, frame.message.command))
        if running is not None:
            running.cancelled = True
            self._link.vehicle.commander.hold()
            self.advance()

    def on_set_mode(self, peer: "Peer", frame: Frame) -> None:
        """SET_MODE, which has no acknowledgement: the HEARTBEAT shows the mode, a text the refusal."""
        m = frame.message
        first = self._link.vehicle.events.next_number
        self._explain(peer, set_custom_mode(self._link, m.base_mode, m.custom_mode), first)

    def _answer(self, peer: "Peer", frame: Frame, entry: Entry | None, command: Command) -> Reply:
        first = self._link.vehicle.events.next_number
        try:
            reply = self._carry_out(peer, entry, command)
        except Exception:  # a mistake in this program still owes the sender its answer
            self._acknowledge(peer, frame, Reply(mav.MAV_RESULT_FAILED))
            raise
        key = _key(peer, frame, command.id)
        self._running.pop(key, None)
        if reply.task is not None:
            self._running[key] = Running(peer, frame, reply.task)
            self._tell_progress(self._running[key])
        else:
            self._acknowledge(peer, frame, reply)
            self._explain(peer, reply, first)
        return reply

    # --- commands that take time

    @property
    def deadline_s(self) -> float:
        """Wall time of the next progress to tell."""
        return min((r.told_s + PROGRESS_S for r in self._running.values()), default=float("inf"))

    def advance(self) -> None:
        """Tell how far the commands under way have come, and of those that have ended the result."""
        for key, running in list(self._running.items()):
            if running.peer not in self._link.peers:
                del self._running[key]
            elif running.task.state is not Task.State.RUNNING:
                del self._running[key]
                result = _ENDED[running.task.state]
                if running.cancelled and running.task.state is Task.State.INTERRUPTED:
                    result = CANCELLED
                reply = Reply(result)
                self._acknowledge(running.peer, running.frame, reply)
                running.peer.answers.keep(running.frame, reply, self._link.wall_s)
            elif self._link.wall_s - running.told_s >= PROGRESS_S:
                self._tell_progress(running)

    def _tell_progress(self, running: Running) -> None:
        running.told_s = self._link.wall_s
        percent = min(99, int(100.0 * running.task.progress))
        self._acknowledge(running.peer, running.frame, Reply(mav.MAV_RESULT_IN_PROGRESS), percent)

    # --- answers

    def _carry_out(self, peer: "Peer", entry: Entry | None, command: Command) -> Reply:
        if entry is None:
            return Reply(mav.MAV_RESULT_UNSUPPORTED)
        for index, value in enumerate(command.params, 1):
            if math.isinf(value):
                return denied(f"Command {command.id}: param{index} is infinite")
            if value and not math.isnan(value) and str(index) not in entry.used:
                return denied(f"Command {command.id}: param{index} is reserved and must not be set")
        if entry.place and command.frame is not None and not has_place(command.frame):
            return Reply(UNSUPPORTED_FRAME, f"Command {command.id}: frame {command.frame} is not supported")
        return entry.handle(self._link, peer, command)

    def _acknowledge(self, peer: "Peer", frame: Frame, reply: Reply, percent: int = 0) -> None:
        ack = message(
            "COMMAND_ACK",
            command=frame.message.command,
            result=reply.result,
            progress=percent,
            target_system=frame.system,
            target_component=frame.component,
        )
        self._link.send(peer, ack)

    def _explain(self, peer: "Peer", reply: Reply, first_event: int) -> None:
        """Give a refusal's reason, unless the vehicle itself has said it to everybody."""
        if reply.result != mav.MAV_RESULT_ACCEPTED and not any(
            event.kind is EventKind.TEXT and reply.reason in event.text
            for event in self._link.vehicle.events.since(first_event)
        ):
            self._link.complain(peer, reply.reason)


def _key(peer: "Peer", frame: Frame, command: int) -> tuple["Peer", int, int, int]:
    return peer, frame.system, frame.component, command
