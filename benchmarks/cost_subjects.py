"""What `costs` measures: each thing a call without arguments, on real parts: codec, sockets, vehicle, session."""

import itertools
import socket
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.processes import free_instance, listener, zenoh_endpoint
from sitl.closed_loop import NOISE_COLUMNS, TRACE_COLUMNS
from sitl.daemon.config import Port
from sitl.daemon.flight_pipe import FlightPipe
from sitl.daemon.flight_writer import FlightFiles
from sitl.daemon.loop import Loop
from sitl.daemon.member import Member
from sitl.daemon.recorder import Flight, Recorder
from sitl.daemon.udp import Sockets
from sitl.jit import kernel
from sitl.loop_arrays import nav_of, run_in_place
from sitl.mavlink.codec import Encoder, Parser, by_name, open_frame
from sitl.mavlink.endpoint import Endpoint
from sitl.mavlink.peers import PortKind
from sitl.mavlink.streams import STREAMS
from sitl.mavlink.tlog import stamped
from sitl.mavlink.view import Craft as Scale
from sitl.mavlink.view import View
from sitl.onboard.modes import Mode
from sitl.onboard.offboard import OffboardTarget
from sitl.telemetry import keys, messages
from sitl.telemetry.publisher import Publisher, Session
from sitl.vehicle import Vehicle, load_vehicle

VEHICLE = "yawsitter"
TURN_S = 0.004
PUTS = 20
_CLIENT = ("127.0.0.1", 40_000)
_POSITION = next(stream for stream in STREAMS if stream.definition.name == "LOCAL_POSITION_NED")


def nothing() -> None:
    pass


@kernel
def _compiled(x: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    return x[0]


_ONE = np.zeros(1)


def compiled_nothing() -> float:
    return float(_compiled(_ONE))


def hovering() -> Vehicle:
    """A vehicle in the air, in Hold."""
    vehicle = Vehicle(load_vehicle(VEHICLE))
    vehicle.advance(100_000)
    vehicle.commander.takeoff()
    vehicle.commander.arm()
    vehicle.advance(10_000_000)
    assert vehicle.commander.mode is Mode.HOLD, vehicle.commander.mode
    return vehicle


class Craft:
    """A hovering vehicle, the messages that show it, and its endpoint."""

    def __init__(self) -> None:
        vehicle = self._vehicle = hovering()
        self._flown = hovering()  # in Offboard once a target is there
        self._encoder, self._parser = Encoder(1, 1), Parser()
        self._scale = Scale.of(vehicle.spec.airframe.airframe)
        self._view = View(vehicle.snapshot(), self._scale)
        self.frame = self.pack()
        self._endpoint = Endpoint(vehicle)
        definition = by_name("SET_POSITION_TARGET_LOCAL_NED")
        self._target = Encoder(252, 190).frame(
            definition, definition.pack(0, 0.0, 0.0, -5.0, *(0.0,) * 7, 0.0, 0x800, 1, 1, 1)
        )
        self._seen = vehicle._observed_array.copy()

    def pack(self) -> bytes:
        return self._encoder.frame(_POSITION.definition, _POSITION.payload(self._view))

    def pack_streams(self) -> Callable[[], bytes]:
        """One of a ground station's default streams after the other, as often as they flow in ten seconds."""
        each = ([stream] * round(10.0 * stream.rates_Hz.get(PortKind.GCS, 0.0)) for stream in STREAMS)
        streams = itertools.cycle(itertools.chain.from_iterable(each))
        view, encoder = self._view, self._encoder

        def pack() -> bytes:
            stream = next(streams)
            return encoder.frame(stream.definition, stream.payload(view))

        return pack

    def open(self) -> object:
        return self._parser.feed(self.frame)

    def take_target(self) -> None:
        self._endpoint.receive(self._target, _CLIENT, PortKind.ONBOARD, 0.0)

    def look(self) -> None:
        self._vehicle._snapshot = None
        View(self._vehicle.snapshot(), self._scale)

    def encode(self) -> bytes:
        return messages.encode(messages.state(self._view.s))

    def tick(self) -> None:
        vehicle = self._vehicle
        vehicle.commander.tick(vehicle.now_us, nav_of(self._seen), 0)

    def tick_target(self) -> None:
        vehicle = self._flown
        commander, now_us = vehicle.commander, vehicle.now_us
        target = OffboardTarget(now_us, (0.0, 0.0, -5.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
        vehicle.offboard.submit(target, now_us)
        if commander.mode is not Mode.OFFBOARD:
            commander.set_mode(Mode.OFFBOARD)
        commander.tick(now_us, nav_of(self._seen), 0)

    def cross(self, steps: int) -> Callable[[], int]:
        """Into compiled code and back, with so many control steps; the vehicle flies on."""
        v = hovering()
        noise, trace = np.zeros((0, NOISE_COLUMNS)), np.zeros((0, len(TRACE_COLUMNS)))

        def run() -> int:
            return int(
                run_in_place(
                    v._plants, v._controllers, v._guidance_array, v._loop_array, noise, 2000, v.step_us, steps, trace,
                    v._observed_array, v._calm, v.tally, v.wanted,
                )
            )  # fmt: skip

        return run


class Wire:
    """Two sockets on the loopback interface: the daemon's, and a plain one."""

    def __enter__(self) -> "Wire":
        self._plain = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._plain.bind(("127.0.0.1", 0))
        self._address = self._plain.getsockname()
        self._sockets = Sockets({Port.GCS: ("127.0.0.1", 0)}, 0)
        self._datagram = bytes(40)
        return self

    def __exit__(self, *_: object) -> None:
        self._sockets.close()
        self._plain.close()

    def exchange(self) -> None:
        self._plain.sendto(self._datagram, self._address)
        self._plain.recv(2048)

    def carry(self, craft: Craft) -> None:
        self._sockets.send(Port.GCS, self._address, craft.pack())
        open_frame(self._plain.recv(2048))


class Zenoh:
    """Two sessions of the daemon's kind, of which one has a subscriber in another process."""

    def __enter__(self) -> "Zenoh":
        self._stack, self._publishers = ExitStack(), []
        self._payload = Craft().encode()
        for heard in (False, True):
            instance = free_instance()
            session = Session(zenoh_endpoint(instance), [instance])
            self._stack.callback(session.close)
            publisher = Publisher(session, instance)
            self._publishers.append(publisher)
            if heard:
                self._stack.enter_context(listener(zenoh_endpoint(instance), "read"))
                while not publisher._wanted(keys.STATE):
                    time.sleep(0.01)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def ask(self) -> bool:
        return self._publishers[0]._wanted(keys.STATE)

    def put_unheard(self) -> None:
        self._publishers[0]._publishers[keys.STATE].put(self._payload)

    def put_heard(self) -> None:
        """PUTS of them, and time for them to arrive: more at once would find the queue full, and be dropped."""
        put = self._publishers[1]._publishers[keys.STATE].put
        for _ in range(PUTS):
            put(self._payload)
        time.sleep(0.005)


class Records:
    """A flight being recorded: the loop's side of it, and the writer's, in this process, on files of its own."""

    def __enter__(self) -> "Records":
        self._stack = ExitStack()
        folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="yawsitter-benchmark-")))
        pipe = self._pipe = FlightPipe()
        self._stack.callback(pipe.close)
        self._recorder = Recorder(pipe, folder, 0)
        origin = (55.7, 37.4, 190.0)
        self._recorder.begin(0.0, 0, origin)
        self._stack.callback(self._recorder.end)
        self._files = FlightFiles(Flight("costs", 0, 0.0, 0, origin, str(folder)))
        self._stack.callback(self._files.close)
        vehicle = hovering()
        self._trace = np.zeros((1, len(TRACE_COLUMNS)))
        vehicle.advance(vehicle.now_us + vehicle.step_us, self._trace)
        self._frame, self._row = bytes(40), self._trace.tobytes()
        self._entry = stamped(self._frame, 0.0)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def frame(self) -> None:
        self._recorder.frame(self._frame, 0.0)
        self._pipe.backlog.clear()

    def step(self) -> None:
        self._recorder.steps(self._trace)
        self._pipe.backlog.clear()

    def write_frame(self) -> None:
        self._files.frame(self._entry)

    def write_step(self) -> None:
        self._files.steps(self._row)


class Turns:
    """The daemon's loop around a hovering vehicle, turned by hand. served: one peer at each port, both unheard."""

    def __init__(self, served: bool) -> None:
        places = {PortKind.GCS: Port.GCS, PortKind.ONBOARD: Port.ONBOARD}
        vehicle = hovering()
        static = [(kind, _free_address()) for kind in places] if served else []
        self._sockets = Sockets(dict.fromkeys(places.values(), ("127.0.0.1", 0)), 0)
        member = Member(vehicle, Endpoint(vehicle, static_peers=static), places)
        self._wall_s = 1000.0
        self._loop = Loop([member], self._sockets, lambda: self._wall_s)

    def turn(self) -> None:
        self._wall_s += TURN_S
        self._loop.turn(self._wall_s)

    def wait(self) -> None:
        self._sockets.wait(TURN_S)

    def wait_and_turn(self) -> None:
        """As the daemon does it: what a turn needs has gone cold meanwhile."""
        self._sockets.wait(TURN_S)
        self.turn()

    def close(self) -> None:
        self._sockets.close()


def _free_address() -> tuple[str, int]:
    """Where nobody listens."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        host, port = sock.getsockname()
        return host, port
