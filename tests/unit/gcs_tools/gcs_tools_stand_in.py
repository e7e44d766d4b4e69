"""A named stand-in for a vehicle: it knows the wire and nothing of flight, and does at once what it is told.

Its position is the newest target carried forward to now, so a client that streams well measures no error at all.
"""

import random
from collections.abc import Callable
from typing import Any

from gcs_tools.client import Client
from gcs_tools.vehicle_state import MODES
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

TURN_S = 0.02


class StandIn:
    def __init__(self, system: int = 1) -> None:
        self.system = system
        self.encoder = codec.Encoder(system, 1)
        self.parser = codec.Parser()
        self.now_s = 0.0
        self.mode, self.armed = "hold", False
        self.position = (0.0, 0.0, 0.0)
        self.ready = True
        self.silent = False
        self.flows = True  # its streams; they stand still with its clock
        self.intervals: dict[str, int] = {}
        self.items: list[Any] = []
        self.expected = 0
        self._incoming: list[Any] | None = None
        self._asked_s = 0.0
        self._back: dict[str, int] = {}
        self.refuse: dict[int, tuple[int, str]] = {}  # command → result, reason
        self.refuse_mission: tuple[int, str] | None = None
        self.unanswered: dict[int, int] = {}  # command → how many more to leave without an answer
        self.targets: list[tuple[float, Any]] = []  # when it came, the message
        self.behind = 0  # targets that its position lags
        self.commands: list[Any] = []
        self.parameters: dict[str, float] = {"RATE_Y_P": 0.5, "POS_X_P": 2.5, "SIM_PAUSE": 0}
        self.int_parameters = {"SIM_PAUSE"}
        self.parameter_limit = 100.0
        self.lost_parameters = 0  # how many values of the next list never leave
        self.complete_after_s: float | None = None
        self._out: list[bytes] = []
        self._beat_s = 0.0
        self._due: dict[str, float] = {}
        self._started_s = 0.0
        self._next_item_s = 0.0
        self._item = 0

    # out

    def send(self, name: str, /, **fields: Any) -> None:
        self._out.append(self.encoder.encode(codec.message(name, **fields)))

    def say(self, text: str, severity: int = mav.MAV_SEVERITY_CRITICAL) -> None:
        self.send("STATUSTEXT", severity=severity, text=text)

    def beat(self) -> None:
        self._beat_s = self.now_s + 1.0
        self.send(
            "HEARTBEAT",
            type=19,
            autopilot=mav.MAV_AUTOPILOT_PX4,
            base_mode=1 | (mav.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0),
            custom_mode=MODES[self.mode],
            system_status=mav.MAV_STATE_STANDBY,
        )

    def set(self, mode: str | None = None, armed: bool | None = None) -> None:
        self.mode = mode or self.mode
        self.armed = self.armed if armed is None else armed
        self.beat()

    def turn(self, now_s: float) -> list[bytes]:
        """Everything it has to say at vehicle time now_s."""
        self.now_s = now_s
        if now_s >= self._beat_s:
            self.beat()
        if self.mode == "offboard" and self.armed and self.targets:
            t = self.targets[-1 - self.behind][1]
            age = now_s - t.time_boot_ms * 1e-3 - self.behind * TURN_S
            p, v, a = (t.x, t.y, t.z), (t.vx, t.vy, t.vz), (t.afx, t.afy, t.afz)
            self.position = tuple(x + y * age + z * age * age / 2 for x, y, z in zip(p, v, a, strict=True))  # type: ignore[assignment]
        if self.mode == "land" and self.armed:
            self.position = (self.position[0], self.position[1], 0.0)
            self.set("hold", False)
        if self.mode == "mission" and self.armed:
            self._fly_items()
        if self._incoming is not None and now_s - self._asked_s > 0.25:
            self._ask()
        for name, interval in self.intervals.items():
            if not self.flows or interval <= 0 or now_s < self._due.get(name, 0.0) - 1e-9:
                continue
            self._due[name] = now_s + interval * 1e-6
            self.stream(name)
        out, self._out = self._out, []
        return [] if self.silent else out

    def stream(self, name: str) -> None:
        """Send what it has of one message."""
        ms = round(self.now_s * 1000)
        x, y, z = self.position
        if name in ("LOCAL_POSITION_NED", "POSITION_TARGET_LOCAL_NED"):
            self.send(name, time_boot_ms=ms, x=x, y=y, z=z)
        elif name == "SYS_STATUS":
            check = mav.MAV_SYS_STATUS_PREARM_CHECK
            health = check if self.ready else 0
            self.send(name, onboard_control_sensors_present=check, onboard_control_sensors_health=health)
        elif name == "DEBUG_VECT":
            self.send(name, time_usec=ms * 1000, x=1.0, y=95.0, z=-2.0, name="YXZ_DEG")
            self.send(name, time_usec=ms * 1000, x=5.0, y=6.0, z=11.0, name="THRUST_N")
            self.send(name, time_usec=ms * 1000, x=-3.0, y=4.0, z=0.5, name="FLAP_DEG")
        elif name == "MISSION_CURRENT":
            self._tell_mission()

    def _tell_mission(self) -> None:
        state = 5 if self._item >= len(self.items) else 3
        self.send("MISSION_CURRENT", seq=min(self._item, max(len(self.items) - 1, 0)), mission_state=state)

    def _fly_items(self) -> None:
        """An item a second; the last one ends the mission and, as a landing, disarms."""
        if self.now_s < self._next_item_s:
            return
        self._next_item_s = self.now_s + 1.0
        i = self.items[self._item]
        self.position = (i.x * 1e-4, i.y * 1e-4, i.z)
        self.send("MISSION_ITEM_REACHED", seq=self._item)
        self.send("MISSION_ITEM_REACHED", seq=self._item)
        self._item += 1
        if self._item == len(self.items):
            self._tell_mission()
            self.set("hold", False if i.command == mav.MAV_CMD_NAV_LAND else None)

    # in

    def receive(self, data: bytes) -> None:
        for frame in self.parser.feed(data):
            handler = getattr(self, f"_on_{frame.name.lower()}", None)
            if handler is not None and not self.silent:
                handler(frame.message, {"target_system": frame.system, "target_component": frame.component})

    def _on_set_position_target_local_ned(self, m: Any, _back: dict[str, int]) -> None:
        self.targets.append((self.now_s, m))

    def _on_command_long(self, m: Any, back: dict[str, int]) -> None:
        if m.target_system not in (0, self.system):
            return
        self.commands.append(m)
        left = self.unanswered.get(m.command, 0)
        if left:
            self.unanswered[m.command] = left - 1
            return
        result, reason = self.refuse.get(m.command, (mav.MAV_RESULT_ACCEPTED, ""))
        if result == mav.MAV_RESULT_ACCEPTED:
            self._obey(m)
        self.send("COMMAND_ACK", command=m.command, result=result, **back)
        if reason:
            self.say(reason)

    def _obey(self, m: Any) -> None:
        if m.command == mav.MAV_CMD_SET_MESSAGE_INTERVAL:
            name = codec.by_id(int(m.param1)).name
            self.intervals[name] = int(m.param2)
        elif m.command == mav.MAV_CMD_DO_SET_MODE:
            number = int(m.param2) << 16 | int(m.param3) << 24
            self.set(mode=next(name for name, code in MODES.items() if code == number))
        elif m.command == mav.MAV_CMD_COMPONENT_ARM_DISARM:
            self.set(armed=bool(m.param1))
        elif m.command == mav.MAV_CMD_NAV_LAND:
            self.set(mode="land")
        elif m.command == mav.MAV_CMD_NAV_TAKEOFF:
            self.set(mode="takeoff")
        elif m.command == mav.MAV_CMD_MISSION_START:
            self._item, self._next_item_s = 0, self.now_s + 1.0
            self.set(mode="mission")
        elif m.command == mav.MAV_CMD_REQUEST_MESSAGE and int(m.param1) == codec.by_name("HOME_POSITION").id:
            self.send("HOME_POSITION", latitude=556985000, longitude=373595000, altitude=190000)
        elif m.command == mav.MAV_CMD_REQUEST_MESSAGE and int(m.param1) == codec.by_name("MESSAGE_INTERVAL").id:
            interval = self.intervals.get(codec.by_id(int(m.param2)).name, -1)
            self.send("MESSAGE_INTERVAL", message_id=int(m.param2), interval_us=interval)
        elif m.command == mav.MAV_CMD_REQUEST_MESSAGE:
            self.stream(codec.by_id(int(m.param1)).name)

    def _on_timesync(self, m: Any, _back: dict[str, int]) -> None:
        self.send("TIMESYNC", tc1=round(self.now_s * 1e9), ts1=m.ts1)

    def _on_mission_count(self, m: Any, back: dict[str, int]) -> None:
        self.expected, self._incoming, self._back = m.count, [], back
        self._ask()

    def _ask(self) -> None:
        assert self._incoming is not None
        self._asked_s = self.now_s
        self.send("MISSION_REQUEST_INT", seq=len(self._incoming), **self._back)

    def _on_mission_item_int(self, m: Any, back: dict[str, int]) -> None:
        if self._incoming is None:
            if m.seq == self.expected - 1:
                self.send("MISSION_ACK", type=mav.MAV_MISSION_ACCEPTED, **back)
            return
        if m.seq != len(self._incoming):
            return
        self._incoming.append(m)
        if len(self._incoming) < self.expected:
            self._ask()
        elif self.refuse_mission is not None:
            self._incoming = None
            self.send("MISSION_ACK", type=self.refuse_mission[0], **back)
            self.say(self.refuse_mission[1])
        else:
            self.items, self._incoming = self._incoming, None
            self.send("MISSION_ACK", type=mav.MAV_MISSION_ACCEPTED, **back)

    def _value(self, name: str) -> None:
        names = sorted(self.parameters)
        is_int = name in self.int_parameters
        value = self.parameters[name]
        from sitl.mavlink.wire import float_of_int

        self.send(
            "PARAM_VALUE",
            param_id=name,
            param_value=float_of_int(int(value)) if is_int else value,
            param_type=mav.MAV_PARAM_TYPE_INT32 if is_int else mav.MAV_PARAM_TYPE_REAL32,
            param_index=names.index(name),
            param_count=len(names),
        )

    def _on_param_request_list(self, _m: Any, _back: dict[str, int]) -> None:
        for name in sorted(self.parameters):
            if self.lost_parameters:
                self.lost_parameters -= 1
            else:
                self._value(name)

    def _on_param_request_read(self, m: Any, back: dict[str, int]) -> None:
        name = sorted(self.parameters)[m.param_index] if m.param_index >= 0 else m.param_id
        if name in self.parameters:
            self._value(name)
        else:
            self.send("PARAM_ERROR", param_id=name, error=1, **back)

    def _on_param_set(self, m: Any, back: dict[str, int]) -> None:
        from sitl.mavlink.wire import int_of_float

        value = int_of_float(m.param_value) if m.param_id in self.int_parameters else m.param_value
        if not 0 <= value <= self.parameter_limit:
            self.send("PARAM_ERROR", param_id=m.param_id, error=2, **back)
            return
        self.parameters[m.param_id] = value
        self._value(m.param_id)


class Pair:
    """A client and a vehicle on a link without delay that may drop and repeat datagrams.

    speed: the vehicle's seconds per second of the client's clock.
    """

    def __init__(
        self, client: Client, vehicle: StandIn, *, speed: float = 1.0, loss: float = 0.0, seed: int = 1
    ) -> None:
        self.client, self.vehicle = client, vehicle
        self.speed, self.loss = speed, loss
        self.turns = 0
        self._paused_s = 0.0
        self._random = random.Random(seed)

    def _through(self, datagrams: list[bytes]) -> list[bytes]:
        out = []
        for data in datagrams:
            if self._random.random() >= self.loss:
                out += [data] * (2 if self._random.random() < self.loss else 1)
        return out

    @property
    def wall_s(self) -> float:
        return self.turns * TURN_S / self.speed + self._paused_s + 1000.0

    def turn(self) -> None:
        for data in self._through(self.client.poll(self.wall_s)):
            self.vehicle.receive(data)
        for data in self._through(self.vehicle.turn(self.turns * TURN_S)):
            self.client.receive(data, self.wall_s)
        self.turns += 1

    def pause(self, seconds: float) -> None:
        """The vehicle's clock stands still; it heartbeats once a second of the client's."""
        for k in range(round(seconds / TURN_S)):
            self._paused_s += TURN_S
            for data in self._through(self.client.poll(self.wall_s)):
                self.vehicle.receive(data)
            if k % 50 == 0:
                self.vehicle.beat()
                for data in self.vehicle.turn(self.vehicle.now_s):
                    self.client.receive(data, self.wall_s)

    def run(self, until: Callable[[], bool] | None = None, limit_s: float = 400.0) -> None:
        """Turns until a condition holds (the client's script has ended); `limit_s` on the client's clock."""
        end_s = self.wall_s + limit_s
        done = until or (lambda: self.client.finished)
        while not done():
            assert self.wall_s < end_s, "the script never ended"
            self.turn()
        if until is None:
            self.turn()  # what the script sent last
