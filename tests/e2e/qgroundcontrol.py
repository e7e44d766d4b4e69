"""QGroundControl played by a script: what it sends, in its order, with its patience.

After its sources (mavlink/qgroundcontrol, 2025/26): InitialConnectStateMachine, RequestMessage, StandardModes,
ComponentInformationManager and RequestMetaDataTypeStateMachine, ParameterManager, PlanManager, FTPManager,
GimbalController, PX4FirmwarePlugin. Timeouts are wall time.
"""

import json
import lzma
import math
import socket
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from recorded import Running

from conformance.observation import COMPONENT_INFORMATION
from sitl.mavlink.codec import Encoder, Frame, Parser, by_name, mav, message
from sitl.mavlink.ftp_payload import Error, Op, Packet

NAN = math.nan
SYSTEM, COMPONENT = 255, 190
COMMAND_TRIES, COMMAND_S = 3, 3.0  # Vehicle: _mavCommandMaxRetryCount, _mavCommandAckTimeoutMSecs
MESSAGE_S = 1.0  # between the acknowledgement of a request and the message asked for
PLAN_TRIES, PLAN_S, ITEM_S = 5, 1.5, 0.25  # PlanManager
LIST_TRIES, LIST_S, MISSING_S = 4, 5.0, 3.0  # ParameterManager: until the first value, between two
PARAM_TRIES, PARAM_S = 3, 1.0
HASH_S = 1.0  # until the first value, which has to be _HASH_CHECK
FTP_TRIES, FTP_S = 3, 1.0
MODE_TRIES, MODE_S = 3, 1.3  # PX4FirmwarePlugin: 13 looks, a tenth of a second apart
PARAMETER_METADATA = 1  # COMP_METADATA_TYPE
CHANGE_MODE = mav.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE


class QGroundControl:
    """One vehicle on a UDP link."""

    def __init__(self, running: Running) -> None:
        self._target = {"target_system": running.instance + 1, "target_component": 1}
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", running.port))
        self._encoder, self._parser = Encoder(SYSTEM, COMPONENT), Parser()
        self._heartbeat_s = -math.inf
        self._ftp_sequence = 0
        self.capabilities = 0
        self.mode = self.base_mode = 0
        self.armed = False
        self.metadata: dict[str, Any] = {}
        self.parameters: dict[str, tuple[int, float]] = {}  # name: type, value as it came

    def close(self) -> None:
        self._socket.close()

    # --- the link

    def send(self, name: str, **fields: Any) -> None:
        fields = {field: value for field, value in self._target.items() if field in _fields(name)} | fields
        self._socket.send(self._encoder.encode(message(name, **fields)))

    def frames(self, limit_s: float) -> Iterator[Frame]:
        """What arrives within a time; every second a heartbeat goes out."""
        end_s = time.monotonic() + limit_s
        while (now_s := time.monotonic()) < end_s:
            if now_s - self._heartbeat_s >= 1.0:
                self._heartbeat_s = now_s
                gcs = {"type": mav.MAV_TYPE_GCS, "autopilot": mav.MAV_AUTOPILOT_INVALID, "mavlink_version": 3}
                self.send("HEARTBEAT", **gcs, base_mode=192, system_status=mav.MAV_STATE_ACTIVE)
            self._socket.settimeout(min(0.25, end_s - now_s))
            try:
                data = self._socket.recv(65535)
            except (TimeoutError, ConnectionRefusedError):
                continue
            for frame in self._parser.feed(data):
                if frame.name == "HEARTBEAT":
                    self._on_heartbeat(frame.message)
                yield frame

    def _on_heartbeat(self, m: Any) -> None:
        self.mode, self.base_mode = m.custom_mode, m.base_mode
        self.armed = bool(m.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED)

    def first(self, fits: Callable[[Frame], bool], limit_s: float) -> Frame | None:
        return next((frame for frame in self.frames(limit_s) if fits(frame)), None)

    def wait(self, fits: Callable[[Frame], bool], what: str, limit_s: float = 60.0) -> Frame:
        found = self.first(fits, limit_s)
        assert found is not None, f"{what}: not within {limit_s:g} s"
        return found

    # --- commands

    def _long(self, command: int, attempt: int, params: Sequence[float]) -> None:
        numbers = {f"param{k}": float(value) for k, value in enumerate(params, 1)}
        self.send("COMMAND_LONG", command=command, confirmation=attempt, **numbers)

    def command(self, command: int, *params: float) -> int:
        """Vehicle::sendMavCommand; the result of COMMAND_ACK."""
        return self._acknowledged(command, lambda attempt: self._long(command, attempt, params))

    def command_int(self, command: int, frame: int, params: Sequence[float], lat: float, lon: float, z: float) -> int:
        """Vehicle::sendMavCommandInt."""
        numbers = {f"param{k}": float(value) for k, value in enumerate(params, 1)}
        place = {"x": round(lat * 1e7), "y": round(lon * 1e7), "z": z}
        return self._acknowledged(
            command, lambda _: self.send("COMMAND_INT", command=command, frame=frame, **numbers, **place)
        )

    def _acknowledged(self, command: int, send: Callable[[int], None]) -> int:
        for attempt in range(COMMAND_TRIES):
            send(attempt)
            ack = self.first(lambda f: f.name == "COMMAND_ACK" and f.message.command == command, COMMAND_S)
            if ack is not None:
                return int(ack.message.result)
        raise AssertionError(f"Vehicle did not respond to command {command}")

    def request_message(self, name: str) -> tuple[int, Any]:
        """Vehicle::requestMessage: the acknowledgement and the message, in whatever order they come."""
        wanted = COMPONENT_INFORMATION if name == "COMPONENT_INFORMATION" else by_name(name).id
        request = mav.MAV_CMD_REQUEST_MESSAGE
        for attempt in range(COMMAND_TRIES):
            self._long(request, attempt, (wanted,))
            result, got, end_s = None, None, time.monotonic() + COMMAND_S
            for frame in self.frames(COMMAND_S):
                if frame.id == wanted:
                    got = frame.message
                elif frame.name == "COMMAND_ACK" and frame.message.command == request and result is None:
                    result = int(frame.message.result)
                    end_s = time.monotonic() + MESSAGE_S
                if result is not None and (got is not None or result != mav.MAV_RESULT_ACCEPTED):
                    return result, got
                if time.monotonic() > end_s:
                    break
            assert result is None, f"{name} was promised and did not come within {MESSAGE_S:g} s"
        raise AssertionError(f"request for {name}: not acknowledged")

    # --- the initial connection

    def connect(self) -> None:
        """InitialConnectStateMachine, state by state."""
        self.wait(lambda f: f.name == "HEARTBEAT" and f.message.system_status != 1, "heartbeat")
        result, version = self.request_message("AUTOPILOT_VERSION")
        assert result == mav.MAV_RESULT_ACCEPTED
        self.capabilities = version.capabilities
        self.request_message("GIMBAL_MANAGER_INFORMATION")  # GimbalController, of every component that heartbeats
        self.modes = self._standard_modes()
        self._component_information()
        self.refresh_parameters()
        for _ in range(2):
            self.send("SYSTEM_TIME", time_unix_usec=time.time_ns() // 1000)
        self.mission = self.load(mav.MAV_MISSION_TYPE_MISSION)
        self.fence = self.load(mav.MAV_MISSION_TYPE_FENCE)
        self.rally = self.load(mav.MAV_MISSION_TYPE_RALLY)

    def _standard_modes(self) -> dict[str, int]:
        """All AVAILABLE_MODES at one request: QGroundControl has no timeout here, it waits for the last of them."""
        request, wanted, modes = mav.MAV_CMD_REQUEST_MESSAGE, by_name("AVAILABLE_MODES").id, {}
        self._long(request, 0, (wanted, 0))
        for frame in self.frames(COMMAND_S):
            if frame.id == wanted:
                modes[frame.message.mode_name] = frame.message.custom_mode
                if frame.message.mode_index >= frame.message.number_modes:
                    return modes
        raise AssertionError(f"QGroundControl would wait for ever; it has {sorted(modes)}")

    def _component_information(self) -> None:
        """COMPONENT_METADATA, or the older COMPONENT_INFORMATION; then the files, the general one first."""
        result, m = self.request_message("COMPONENT_METADATA")
        if result != mav.MAV_RESULT_ACCEPTED:
            self.request_message("COMPONENT_INFORMATION")
            return
        self.metadata["general"] = general = self.download(m.uri)
        for kind in general["metadataTypes"]:
            if kind["type"] == PARAMETER_METADATA:
                self.metadata["parameter"] = self.download(kind["uri"])

    def download(self, uri: str) -> Any:
        """FTPManager::download: open, burst reads with the gaps filled in, end of session."""
        path = uri.removeprefix("mftp://").lstrip("/").encode()
        size = struct.unpack("<I", self._ftp(Op.OPEN_FILE_RO, data=path).data)[0]
        content, have = bytearray(size), 0
        while have < size:
            reply = self._ftp(Op.BURST_READ_FILE, offset=have, size=239)
            while True:
                if reply.opcode == Op.ACK and reply.offset == have:
                    content[have : have + reply.size] = reply.data
                    have += reply.size
                if reply.opcode == Op.NAK or reply.burst_complete or have >= size:
                    break
                following = self._ftp_reply(Op.BURST_READ_FILE)
                if following is None:
                    break
                reply = following
        self._ftp(Op.TERMINATE_SESSION)
        return json.loads(lzma.decompress(content) if path.endswith(b".xz") else content)

    def _ftp(self, opcode: int, data: bytes = b"", offset: int = 0, size: int = 0) -> Packet:
        for _ in range(FTP_TRIES):
            request = Packet(self._ftp_sequence, 0, opcode, len(data) or size, 0, 0, offset, data).pack()
            self.send("FILE_TRANSFER_PROTOCOL", payload=list(request.ljust(251, b"\0")))
            reply = self._ftp_reply(opcode)
            if reply is not None:
                assert reply.opcode == Op.ACK or reply.data[:1] == bytes([Error.EOF]), reply
                return reply
        raise AssertionError(f"FTP operation {opcode}: no answer")

    def _ftp_reply(self, opcode: int) -> Packet | None:
        def fits(frame: Frame) -> bool:
            return frame.name == "FILE_TRANSFER_PROTOCOL" and frame.message.payload[5] == opcode

        frame = self.first(fits, FTP_S)
        if frame is None:
            return None
        packet = Packet.of(bytes(frame.message.payload))
        self._ftp_sequence = (packet.sequence + 1) & 0xFFFF
        return packet

    # --- parameters

    def refresh_parameters(self) -> None:
        """ParameterManager: the list, then by index what is missing of it. _HASH_CHECK has to come first of all."""
        count, values = None, {}
        for _ in range(LIST_TRIES):
            self.send("PARAM_REQUEST_LIST")
            head = self.first(lambda f: f.name == "PARAM_VALUE", HASH_S)
            if head is not None:
                break
        assert head is not None, "no parameters"
        assert head.message.param_id == "_HASH_CHECK", head
        while count is None or len(values) < count:
            frame = self.first(lambda f: f.name == "PARAM_VALUE" and f.message.param_index != 0xFFFF, MISSING_S)
            if frame is None:
                assert count is not None, "no parameters"
                for index in [k for k in range(count) if k not in values][:10]:
                    self.send("PARAM_REQUEST_READ", param_index=index)
                continue
            m = frame.message
            count = m.param_count
            values[m.param_index] = m
        self.parameters = {m.param_id: (m.param_type, m.param_value) for m in values.values()}

    def set_parameter(self, name: str, value: float) -> float:
        """The value that comes back. Whole numbers travel bytewise with a PX4."""
        kind = self.parameters[name][0]
        wire = struct.unpack("<f", struct.pack("<i", int(value)))[0] if kind == mav.MAV_PARAM_TYPE_INT32 else value
        for _ in range(PARAM_TRIES):
            self.send("PARAM_SET", param_id=name, param_value=wire, param_type=kind)
            frame = self.first(lambda f: f.name == "PARAM_VALUE" and f.message.param_id == name, PARAM_S)
            if frame is not None:
                back: float = frame.message.param_value
                return struct.unpack("<i", struct.pack("<f", back))[0] if kind == mav.MAV_PARAM_TYPE_INT32 else back
        raise AssertionError(f"{name}: write not answered")

    # --- plans

    def load(self, kind: int) -> list[Any]:
        """PlanManager::loadFromVehicle."""

        def asked(name: str, wanted: str, limit_s: float, **fields: Any) -> Any:
            for _ in range(PLAN_TRIES + 1):
                self.send(name, mission_type=kind, **fields)
                answer = self.first(lambda f: _is_plan(f, wanted, kind, **fields), limit_s)
                if answer is not None:
                    return answer.message
            raise AssertionError(f"{name} of type {kind}: no {wanted}, maximum retries exceeded")

        count = asked("MISSION_REQUEST_LIST", "MISSION_COUNT", PLAN_S).count
        items = [asked("MISSION_REQUEST_INT", "MISSION_ITEM_INT", ITEM_S, seq=seq) for seq in range(count)]
        self.send("MISSION_ACK", mission_type=kind, type=mav.MAV_MISSION_ACCEPTED)
        return items

    def write(self, kind: int, items: Sequence[dict[str, Any]]) -> int:
        """PlanManager::writeMissionItems; the type of the final MISSION_ACK."""
        answers = ("MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK")
        for _ in range(PLAN_TRIES + 1):
            self.send("MISSION_COUNT", mission_type=kind, count=len(items))
            answer = self.first(lambda f: f.name in answers and f.message.mission_type == kind, PLAN_S)
            while answer is not None and answer.name != "MISSION_ACK":
                seq = answer.message.seq
                self.send("MISSION_ITEM_INT", mission_type=kind, seq=seq, autocontinue=1, **items[seq])
                answer = self.first(lambda f: f.name in answers and f.message.mission_type == kind, PLAN_S)
            if answer is not None:
                return int(answer.message.type)
        raise AssertionError(f"plan of type {kind}: maximum retries exceeded")

    # --- buttons

    def takeoff(self, altitude_amsl_m: float) -> int:
        """PX4FirmwarePlugin::guidedModeTakeoff: the command, and arming once it is accepted."""
        result = self.command(mav.MAV_CMD_NAV_TAKEOFF, -1, 0, 0, NAN, NAN, NAN, altitude_amsl_m)
        return self.arm(True) if result == mav.MAV_RESULT_ACCEPTED and not self.armed else result

    def arm(self, armed: bool) -> int:
        return self.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, float(armed))

    def go_to(self, lat: float, lon: float, altitude_amsl_m: float) -> int:
        params = (-1, CHANGE_MODE, 0, NAN)
        return self.command_int(mav.MAV_CMD_DO_REPOSITION, mav.MAV_FRAME_GLOBAL, params, lat, lon, altitude_amsl_m)

    def pause(self) -> int:
        return self.command(mav.MAV_CMD_DO_REPOSITION, -1, CHANGE_MODE, 0, NAN, NAN, NAN, NAN)

    def change_altitude(self, altitude_amsl_m: float) -> int:
        """PX4FirmwarePlugin::guidedModeChangeAltitude: pause first."""
        result = self.pause()
        if result != mav.MAV_RESULT_ACCEPTED:
            return result
        return self.command(mav.MAV_CMD_DO_REPOSITION, -1, CHANGE_MODE, 0, NAN, NAN, NAN, altitude_amsl_m)

    def change_speed(self, speed_m_s: float) -> int:
        return self.command(mav.MAV_CMD_DO_CHANGE_SPEED, 1, speed_m_s, -1, 0, NAN, NAN, NAN)

    def orbit(self, lat: float, lon: float, radius_m: float, altitude_amsl_m: float) -> int:
        params = (radius_m, NAN, 0, NAN)
        return self.command_int(mav.MAV_CMD_DO_ORBIT, mav.MAV_FRAME_GLOBAL, params, lat, lon, altitude_amsl_m)

    def set_mode(self, name: str) -> None:
        """PX4FirmwarePlugin::_setFlightModeAndValidate: SET_MODE, and looks at the heartbeats that follow."""
        wanted = self.modes[name]
        for _ in range(MODE_TRIES):
            self.send("SET_MODE", base_mode=self.base_mode | 1, custom_mode=wanted)
            if self.first(lambda f: f.name == "HEARTBEAT" and f.message.custom_mode == wanted, MODE_S):
                return
        raise AssertionError(f"vehicle not changing to {name} flight mode")

    def start_mission(self) -> int:
        """PX4FirmwarePlugin::startMission."""
        self.set_mode("Mission")
        return mav.MAV_RESULT_ACCEPTED if self.armed else self.arm(True)


def _fields(name: str) -> set[str]:
    return {field.name for field in by_name(name).fields}


def _is_plan(frame: Frame, name: str, kind: int, **fields: Any) -> bool:
    m = frame.message
    return frame.name == name and m.mission_type == kind and all(getattr(m, k) == v for k, v in fields.items())
