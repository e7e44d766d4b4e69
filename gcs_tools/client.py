"""One client's side of the link to one vehicle, without sockets: bytes and the time in, bytes out.

What a client does in order (connect, ask, wait for the answer, ask again) is written as a script: a generator that
yields the time at which it wants to go on if nothing arrives before. `poll` resumes it after everything that arrived.
"""

import math
from collections.abc import Callable, Generator
from typing import Any, NoReturn, TypeVar

from gcs_tools.vehicle_state import HANDLERS, MODES, VehicleState
from sitl.mavlink import codec
from sitl.mavlink.codec import mav
from sitl.mavlink.signing import Signer, is_signed

T = TypeVar("T")
Script = Generator[float, None, T]

SYSTEM_ID = 252  # above every vehicle's, below that of the usual ground stations
LAST_VEHICLE = 250
COMPONENT_ID = mav.MAV_COMP_ID_MISSIONPLANNER
HEARTBEAT_S = 1.0
LOST_S = 3.0  # of silence, after which the vehicle counts as lost
_DEFAULT = _UNAVAILABLE = 0  # intervals with a meaning of their own: asked for, and told
RETRY_S = 0.7  # without an answer, after which a request is sent again
TRIES = 10
SEEN_S = 8.0  # until a change shows in the heartbeats, of which some may be lost
AGAIN_S = 0.5  # between a refusal and the next try, where trying again may help

_AUTOPILOT = 1  # the component that flies the vehicle
_REFUSALS = {
    mav.MAV_RESULT_TEMPORARILY_REJECTED: "refused for now",
    mav.MAV_RESULT_DENIED: "refused",
    mav.MAV_RESULT_UNSUPPORTED: "not supported",
    mav.MAV_RESULT_FAILED: "failed",
    6: "cancelled",  # MAV_RESULT_CANCELLED
}


class LinkError(Exception):
    """What was asked for didn't come about; the message says why in one line."""


class Client:
    """Talks to the first vehicle it hears, or to the one with the system id `system`.

    With a signer it signs what it says, and hears only what is signed with the same key.
    `wall_s` is the caller's time of the call in progress. What a script came to is in `finished`, `result`, `fault`.
    `background`, if set, runs at every poll, sends what is due and returns when it wants to run again.
    """

    def __init__(self, system: int | None = None, signer: Signer | None = None) -> None:
        self.system = system
        self.unauthentic = 0  # frames heard that the key doesn't fit
        self._signer, self._signed_heard = signer, False
        self.vehicle = VehicleState()
        self.wall_s = 0.0
        self.background: Callable[[], float] | None = None
        self.finished = False
        self.result: Any = None
        self.fault: LinkError | None = None
        self._encoder = codec.Encoder(SYSTEM_ID, COMPONENT_ID, signer)
        self._parser = codec.Parser()
        self._out: list[bytes] = []
        self._script: Script[Any] | None = None
        self.heartbeats = True  # said every second
        self._next_heartbeat_s = -math.inf
        self._wake_s = math.inf
        self._acks: dict[int, Any] = {}
        self.interval_acks: list[int] = []  # results of SET_MESSAGE_INTERVAL, which are sent many at a time
        self._state_handlers = {name: handler.__get__(self.vehicle) for name, handler in HANDLERS.items()}
        self.on: dict[str, Callable[[Any], None]] = {}  # message name → who else wants it
        self.on_frame: Callable[[codec.Frame], None] | None = None  # who wants every frame of the vehicle
        self._heartbeat = codec.message(
            "HEARTBEAT",
            type=mav.MAV_TYPE_GCS,
            autopilot=mav.MAV_AUTOPILOT_INVALID,
            system_status=mav.MAV_STATE_ACTIVE,
            mavlink_version=3,
        )

    def start(self, script: Script[Any]) -> None:
        """Run a script from the next poll on, in place of the one before."""
        self._script, self.finished, self.result, self.fault = script, False, None, None
        self._wake_s = -math.inf

    def stop(self, fault: LinkError) -> None:
        """End the script where it stands; what it sends in leaving goes out with the next poll."""
        if self._script is not None:
            self._script.close()
            self._end(None, fault)

    def receive(self, data: bytes, wall_s: float) -> bool:
        """Take a datagram in; True if it came from the vehicle talked to."""
        self.wall_s = wall_s
        ours = False
        for frame in self._parser.feed(data):
            if not self._is_authentic(frame):
                self.unauthentic += 1
                continue
            if frame.system != self.system and not self._adopt(frame):
                continue
            if frame.component != _AUTOPILOT:
                continue
            ours = True
            if self.on_frame is not None:
                self.on_frame(frame)
            name = frame.name
            handler = self._state_handlers.get(name)
            if handler is not None:
                handler(frame.message, wall_s)
            elif name == "COMMAND_ACK":
                self._ack(frame.message)
            listener = self.on.get(name)
            if listener is not None:
                listener(frame.message)
        if ours:
            self.vehicle.heard_s = wall_s
        return ours

    def _is_authentic(self, frame: codec.Frame) -> bool:
        if self._signer is None:
            self._signed_heard = self._signed_heard or is_signed(frame.raw)
            return True
        self._signer.keep_time(self.wall_s)
        return self._signer.admits(frame.raw, frame.id, frame.system, frame.component)

    def _adopt(self, frame: codec.Frame) -> bool:
        """Whether the frame is from a vehicle to settle on: the first autopilot heard."""
        if self.system is not None or frame.component != _AUTOPILOT or frame.system > LAST_VEHICLE:
            return False
        if frame.name == "HEARTBEAT" and frame.message.autopilot == mav.MAV_AUTOPILOT_INVALID:
            return False
        self.system = frame.system
        return True

    def _ack(self, ack: Any) -> None:
        if ack.target_system not in (0, SYSTEM_ID):
            return
        if ack.command == mav.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.interval_acks.append(ack.result)
        else:
            self._acks[ack.command] = ack

    def poll(self, wall_s: float) -> list[bytes]:
        """Everything to send now. Call it after receiving, and at next_deadline."""
        self.wall_s = wall_s
        if self._signer is not None:
            self._signer.keep_time(wall_s)
        if wall_s >= self._next_heartbeat_s:
            self._next_heartbeat_s = wall_s + HEARTBEAT_S
            if self.heartbeats:
                self.send(self._heartbeat)
        wake_s = math.inf
        if self.background is not None:
            wake_s = self.background()
        if self._script is not None:
            self._advance(self._script)
        self._wake_s = min(self._wake_s, wake_s)
        out, self._out = self._out, []
        return out

    def _advance(self, script: Script[Any]) -> None:
        heard_s = self.vehicle.heard_s
        try:
            if heard_s is not None and self.wall_s - heard_s > LOST_S:
                self._wake_s = script.throw(LinkError(f"nothing heard from the vehicle for {LOST_S:g} s"))
            else:
                self._wake_s = next(script)
        except StopIteration as stop:
            self._end(stop.value, None)
        except LinkError as fault:
            self._end(None, fault)

    def _end(self, result: Any, fault: LinkError | None) -> None:
        self._script, self.background = None, None
        self.finished, self.result, self.fault = True, result, fault

    @property
    def next_deadline(self) -> float:
        """When poll wants to be called if nothing arrives before."""
        return min(self._next_heartbeat_s, self._wake_s)

    def send(self, message: Any) -> None:
        self._out.append(self._encoder.encode(message))

    def send_packed(self, definition: codec.Definition, payload: bytes) -> None:
        """As send, for what goes out so often that building the message would count."""
        self._out.append(self._encoder.frame(definition, payload))

    def address(self) -> dict[str, int]:
        """The target fields of a message to the vehicle."""
        return {"target_system": self.system or 0, "target_component": _AUTOPILOT}

    # Pieces that scripts are made of.

    def wait(self, condition: Callable[[], bool], patience_s: float, complaint: str) -> Script[None]:
        """Until the condition holds; a LinkError with the complaint if it doesn't in time."""
        end_s = self.wall_s + patience_s
        while not condition():
            if self.wall_s >= end_s:
                raise LinkError(complaint)
            yield end_s

    def pause(self, seconds: float) -> Script[None]:
        end_s = self.wall_s + seconds
        while self.wall_s < end_s:
            yield end_s

    def connect(self, patience_s: float = 10.0) -> Script[None]:
        """Until a vehicle is heard that has finished booting."""
        which = f"vehicle with system id {self.system}" if self.system else "vehicle"
        v = self.vehicle
        try:
            yield from self.wait(lambda: v.heard_s is not None, patience_s, f"no {which} heard in {patience_s:g} s")
        except LinkError as error:
            raise LinkError(f"{error}{'; what is heard has another key' if self.unauthentic else ''}") from None
        if self._signed_heard:
            raise LinkError("the vehicle signs its messages: give its key with --signing-key")
        if v.mode is None:
            self.request("HEARTBEAT")  # sooner than the next one
        booting = (mav.MAV_STATE_UNINIT, mav.MAV_STATE_BOOT, mav.MAV_STATE_CALIBRATING)
        yield from self.wait(
            lambda: v.mode is not None and v.status not in booting, 30.0, "the vehicle doesn't finish booting"
        )

    def ask(self, command: int, *params: float) -> Script[int]:
        """Send a command until it is answered; its MAV_RESULT."""
        for confirmation in range(TRIES):
            self._acks.pop(command, None)
            named = {f"param{k}": value for k, value in enumerate(params, start=1)}
            self.send(
                codec.message("COMMAND_LONG", command=command, confirmation=confirmation, **named, **self.address())
            )
            end_s = self.wall_s + RETRY_S
            while self.wall_s < end_s:
                yield end_s
                ack = self._acks.get(command)
                if ack is None:
                    continue
                if ack.result != mav.MAV_RESULT_IN_PROGRESS:
                    return int(ack.result)
                end_s = self.wall_s + 10.0 * RETRY_S
                del self._acks[command]
        raise LinkError(f"the vehicle doesn't answer {command_name(command)}")

    def require(self, what: str, command: int, *params: float, patience_s: float = 0.0) -> Script[None]:
        """Have a command accepted, trying again while refusals come and patience lasts; a LinkError says why not."""
        asked_s = self.wall_s
        while True:
            result = yield from self.ask(command, *params)
            if result == mav.MAV_RESULT_ACCEPTED:
                return
            final = result == mav.MAV_RESULT_UNSUPPORTED or self.wall_s - asked_s >= patience_s
            yield from self.pause(0.1 if final else AGAIN_S)
            if final:
                self.refuse(what, result, asked_s)

    def refuse(self, what: str, result: int, asked_s: float) -> NoReturn:
        """A LinkError for a refusal, with the vehicle's own reason where it has told one."""
        reason = self.vehicle.reasons_since(asked_s)
        answer = _REFUSALS.get(result, f"answered with {result}")
        raise LinkError(f"{what}: {answer} by the vehicle{': ' + reason if reason else ''}")

    def set_mode(self, mode: str, patience_s: float = 0.0) -> Script[None]:
        """Have a mode accepted and see it in force."""
        main, sub = MODES[mode] >> 16 & 0xFF, MODES[mode] >> 24
        flag = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        yield from self.require(f"mode {mode}", mav.MAV_CMD_DO_SET_MODE, flag, main, sub, patience_s=patience_s)
        v = self.vehicle
        yield from self.wait(lambda: v.mode == mode, SEEN_S, f"mode {mode} was accepted but isn't in force")

    def arm(self, patience_s: float = 0.0) -> Script[None]:
        yield from self.require("arming", mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, patience_s=patience_s)
        v = self.vehicle
        yield from self.wait(lambda: v.armed, SEEN_S, "arming was accepted but the vehicle isn't armed")

    def disarm(self, patience_s: float = 0.0) -> Script[None]:
        yield from self.require("disarming", mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, patience_s=patience_s)
        v = self.vehicle
        yield from self.wait(lambda: not v.armed, SEEN_S, "disarming was accepted but the vehicle is still armed")

    def set_intervals(self, intervals_us: dict[str, int]) -> Script[None]:
        """Set the streams' intervals, all in one go, and see every one answered (in whatever way).

        An acknowledgement doesn't tell which interval it is for, and may come twice. So the vehicle is asked for the
        intervals in force as well, and only those that are not yet as wanted are set again; acknowledgements alone
        count where it tells none.
        """
        open_us, numbers = dict(intervals_us), {codec.by_name(name).id: name for name in intervals_us}
        tells = False

        def told(m: Any) -> None:
            nonlocal tells
            tells, name = True, numbers.get(m.message_id, "")
            if name in open_us and (m.interval_us in (open_us[name], _UNAVAILABLE) or open_us[name] == _DEFAULT):
                del open_us[name]

        self.on["MESSAGE_INTERVAL"] = told
        try:
            for _ in range(TRIES):
                self.interval_acks.clear()
                self.send_intervals(open_us)
                for name in open_us:
                    self.request("MESSAGE_INTERVAL", float(codec.by_name(name).id))
                end_s = self.wall_s + RETRY_S
                while open_us and self.wall_s < end_s:
                    yield end_s
                if not open_us or (not tells and len(self.interval_acks) >= len(open_us)):
                    return
        finally:
            del self.on["MESSAGE_INTERVAL"]
        raise LinkError("the vehicle doesn't answer SET_MESSAGE_INTERVAL")

    def send_intervals(self, intervals_us: dict[str, int]) -> None:
        command = mav.MAV_CMD_SET_MESSAGE_INTERVAL
        for name, interval_us in intervals_us.items():
            number = codec.by_name(name).id
            self.send(
                codec.message(
                    "COMMAND_LONG", command=command, param1=float(number), param2=float(interval_us), **self.address()
                )
            )

    def request(self, name: str, detail: float = 0.0) -> None:
        """Ask for one message, once."""
        number = float(codec.by_name(name).id)
        command = mav.MAV_CMD_REQUEST_MESSAGE
        self.send(codec.message("COMMAND_LONG", command=command, param1=number, param2=detail, **self.address()))


def command_name(command: int) -> str:
    entry = mav.enums["MAV_CMD"].get(command)
    return entry.name.removeprefix("MAV_CMD_") if entry else f"command {command}"
