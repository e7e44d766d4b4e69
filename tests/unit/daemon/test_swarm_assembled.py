"""A swarm as `sitl swarm` builds it, over sockets and a clock that are stand-ins: who says what, and in which turn."""

from collections import Counter, defaultdict
from itertools import pairwise

import pytest
from mcap.reader import make_reader
from test_loop import CLIENT, Clock, Wire

from sitl.daemon import assembly, recorder, swarm
from sitl.daemon.clock import SWARM_TURN_S
from sitl.daemon.config import Port, RunConfig
from sitl.mavlink.codec import Encoder, Parser, mav, message

COUNT = 25
SHARED = (0, Port.SHARED)


class Bench:
    """Heard at the shared port by one static peer and by CLIENT, which comes later."""

    def __init__(self, folder, count: int = COUNT, **settings) -> None:
        self.clock = Clock()
        self.wire = Wire(self.clock)
        config = RunConfig(state_dir=folder, zenoh=False, ground_stations=(("127.0.0.1", 14551),), **settings)
        setup = swarm.setup(config, swarm.grid(count, 3.0), 10.0)
        built = assembly.build(setup)
        self.recorders = recorder.start(setup.vehicles)
        self.loop = assembly.build_loop(setup, built.vehicles, self.wire, built.publishers, self.recorders, self.clock)
        self._encoder = Encoder(255, 190)
        self._said_s = 0.0

    def say(self, name: str, **fields) -> None:
        self.wire.script.append((self.clock(), SHARED, self._encoder.encode(message(name, **fields))))

    def run(self, seconds: float) -> list[tuple[int, tuple[str, int], str, int]]:
        """Turn, address, name and system of each frame that goes out meanwhile."""
        self.wire.outgoing.clear()
        end_s = self.clock() + seconds

        def stopping() -> bool:
            if self.clock() - self._said_s >= 1.0:
                self._said_s = self.clock()
                self.say("HEARTBEAT", type=6, mavlink_version=3)
            return self.clock() >= end_s

        self.loop.run(stopping)
        parser = Parser()
        return [
            (round(wall_s / SWARM_TURN_S), address, frame.name, frame.system)
            for wall_s, _, address, data in self.wire.outgoing
            for frame in parser.feed(data)
        ]


@pytest.fixture
def bench(tmp_path) -> Bench:
    bench = Bench(tmp_path)
    bench.run(1.5)  # whoever is met is greeted by all at once
    return bench


def test_the_turns_have_the_same_to_say_and_none_says_it_for_all(bench) -> None:
    sent = Counter(turn for turn, *_ in bench.run(2.0))
    mean = sum(sent.values()) / len(sent)
    assert max(sent.values()) < 1.8 * mean
    assert min(sent.values()) > 0.5 * mean


def test_who_comes_later_hears_every_stream_at_its_rate_and_together_with_the_others(bench) -> None:
    heard = defaultdict(list)
    for turn, address, name, system in bench.run(2.0):
        if name in ("ATTITUDE", "EXTENDED_SYS_STATE"):
            heard[address, name, system].append(turn)
    for system in range(1, COUNT + 1):
        assert len(heard[CLIENT, "ATTITUDE", system]) == pytest.approx(20, abs=1)
        assert len(heard[CLIENT, "EXTENDED_SYS_STATE", system]) in (1, 2, 3)
        for name in ("ATTITUDE", "EXTENDED_SYS_STATE"):
            assert heard[CLIENT, name, system] == heard[("127.0.0.1", 14551), name, system]


def test_heartbeats_keep_their_second_and_their_distance_though_all_are_armed_at_once(bench) -> None:
    bench.say("COMMAND_LONG", command=mav.MAV_CMD_COMPONENT_ARM_DISARM, param1=1.0)
    bench.run(1.0)
    assert all(member.vehicle.commander.armed for member in bench.loop.members)
    beats = defaultdict(list)
    for turn, address, name, system in bench.run(2.5):
        if name == "HEARTBEAT" and address == CLIENT:
            beats[system].append(turn)
    assert {turn - before for turns in beats.values() for before, turn in pairwise(turns)} <= {49, 50, 51}
    assert max(Counter(turn for turns in beats.values() for turn in turns).values()) <= 2


def test_each_flight_is_recorded_in_its_vehicles_folder_and_shown_by_that_vehicle_alone(tmp_path) -> None:
    bench = Bench(tmp_path / "state", 3, record=True, record_dir=tmp_path / "logs")
    bench.run(0.2)
    for system in (1, 3):
        bench.say("COMMAND_LONG", target_system=system, command=mav.MAV_CMD_COMPONENT_ARM_DISARM, param1=1.0)
    bench.run(0.5)
    recorder.close(bench.recorders)
    names = {path.relative_to(tmp_path / "logs").with_suffix("") for path in tmp_path.glob("logs/*/*")}
    assert sorted((str(name.parent), name.name.partition("Z_")[2]) for name in names) == [
        ("instance-0", "instance-0"),
        ("instance-2", "instance-2"),
    ]
    for name in names:
        own = int(name.name[-1])
        with (tmp_path / "logs" / f"{name}.mcap").open("rb") as file:
            topics = Counter(channel.topic for _, channel, _ in make_reader(file).iter_messages())
        assert topics[f"yawsitter/{own}/state"] in (240, 250)
        assert all(topic.startswith(f"yawsitter/{own}/") for topic in topics)
        frames = Parser().feed((tmp_path / "logs" / f"{name}.tlog").read_bytes())
        assert {frame.system for frame in frames} == {own + 1, 255}
    bench.say("LOG_REQUEST_LIST", target_system=0, end=0xFFFF)
    counts = {}
    bench.wire.outgoing.clear()
    bench.run(0.1)
    for _, _, address, data in bench.wire.outgoing:
        for frame in Parser().feed(data):
            if frame.name == "LOG_ENTRY" and address == CLIENT:
                counts[frame.system] = frame.message.num_logs
    assert counts == {1: 2, 2: 0, 3: 2}


def test_each_vehicle_has_a_viewer_of_its_own_that_gets_its_true_state_alone(tmp_path) -> None:
    bench = Bench(tmp_path, 3, hil_viewer=True)
    shown = {
        (address, name, system) for _, address, name, system in bench.run(1.5) if address[1] in range(19410, 19450)
    }
    assert shown == {
        (("127.0.0.1", 19410 + k), name, k + 1) for k in range(3) for name in ("HEARTBEAT", "HIL_STATE_QUATERNION")
    }
