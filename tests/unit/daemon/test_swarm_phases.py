"""A swarm as `sitl swarm` builds it, over sockets and a clock that are stand-ins: who speaks in which turn."""

from collections import Counter, defaultdict
from itertools import pairwise

import pytest
from test_loop import CLIENT, Clock, Wire

from sitl.daemon import assembly, swarm
from sitl.daemon.clock import SWARM_TURN_S
from sitl.daemon.config import Port, RunConfig
from sitl.mavlink.codec import Encoder, Parser, mav, message

COUNT = 25
SHARED = (0, Port.SHARED)


class Bench:
    """Heard at the shared port by one static peer and by CLIENT, which comes later."""

    def __init__(self, folder) -> None:
        self.clock = Clock()
        self.wire = Wire(self.clock)
        config = RunConfig(state_dir=folder, zenoh=False, ground_stations=(("127.0.0.1", 14551),))
        setup = swarm.setup(config, swarm.grid(COUNT, 3.0), 10.0)
        built = assembly.build(setup)
        self.loop = assembly.build_loop(setup, built.vehicles, self.wire, built.publishers, None, self.clock)
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
