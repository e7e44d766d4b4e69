"""What is said when, with a stand-in vehicle and time made up."""

import json
from types import SimpleNamespace

import pytest

from sitl.onboard.events import EventLog
from sitl.onboard.modes import EventKind, Severity
from sitl.telemetry import feed as feed_module
from sitl.telemetry import keys, schema
from sitl.telemetry.feed import BURST_S, GATHER_MAX_BYTES, GATHER_S, Feed, Sampler


class Registry(dict):
    """Parameters without declarations."""

    names = ()
    generation = 0


class StandIn:
    """A vehicle that only counts what is asked of it."""

    def __init__(self) -> None:
        self.now_us = 0
        self.parameters = Registry(SIM_TLM_RATE=50.0, SIM_SPEED=1.0, SIM_PAUSE=0)
        self.events = EventLog()
        self.status = "standing"
        self.load_requests = 0

    def snapshot(self):
        return SimpleNamespace(now_us=self.now_us, status=self.status)

    def loads(self):
        self.load_requests += 1
        return {}

    def description(self):
        return {"name": "stand-in"}


@pytest.fixture
def vehicle(monkeypatch) -> StandIn:
    for name in ("state", "attitude", "setpoint", "actuators"):
        monkeypatch.setattr(feed_module.messages, name, lambda s, name=name: {"what": name, "now_us": s.now_us})
    monkeypatch.setattr(feed_module.messages, "mode", lambda s, speed, paused: {"status": s.status, "speed": speed})
    monkeypatch.setattr(feed_module.messages, "mode_trigger", lambda s: (s.status,))
    return StandIn()


@pytest.fixture
def feed(vehicle) -> Feed:
    return Feed(vehicle, 0, lambda: schema.LoopMessage(*(0,) * len(schema.LoopMessage.__struct_fields__)))


def everything(_) -> bool:
    return True


def nothing(_) -> bool:
    return False


def names(out) -> list[str]:
    return [topic.name for topic, _ in out]


def sampled(sampler: Sampler, speed: float, seconds: float, rate_Hz: float = 50.0) -> int:
    """Samples taken in some seconds of wall time, with turns each 4 ms."""
    turns = round(seconds / 0.004)
    return sum(sampler.due(round(k * 4000 * speed), k * 0.004, rate_Hz) for k in range(turns))


def test_in_real_time_the_rate_is_that_of_the_parameter() -> None:
    assert sampled(Sampler(), 1.0, 10.0) == 500


def test_in_slow_motion_the_rate_is_that_of_simulation_time() -> None:
    assert sampled(Sampler(), 0.1, 10.0) == 50


def test_at_two_hundred_times_real_time_listeners_are_not_flooded() -> None:
    assert sampled(Sampler(), 200.0, 10.0) <= 500 + BURST_S * 50 + 1


def test_samples_are_not_lost_to_a_late_turn() -> None:
    sampler = Sampler()
    taken = sum(sampler.due(k * 20_000, k * 0.02 + (0.015 if k % 3 else 0.0), 50.0) for k in range(300))
    assert taken == 300


def test_a_paused_simulation_is_sampled_once() -> None:
    sampler = Sampler()
    assert sum(sampler.due(8000, k * 0.02, 50.0) for k in range(100)) == 1


def test_a_new_rate_holds_from_the_next_sample() -> None:
    sampler = Sampler()
    sampled(sampler, 1.0, 1.0)
    assert sum(sampler.due(1_000_000 + k * 2000, 1.0 + k * 0.002, 500.0) for k in range(500)) == pytest.approx(
        500, abs=2
    )


def test_feeds_with_different_phases_never_say_what_is_due_in_the_same_turn(vehicle) -> None:
    vehicle.parameters["SIM_TLM_RATE"] = 10.0
    feeds = [Feed(vehicle, k, lambda: {"what": "loop"}, k * 20_000) for k in range(3)]
    said: list[list[str]] = []
    for turn in range(200):
        vehicle.now_us = turn * 20_000
        for feed in feeds:
            said.append([name for name in names(feed.due(turn * 0.02, everything)) if name in ("state", "loop")])
    later = said[100 * len(feeds) :]
    for name in ("state", "loop"):
        turns = [{k // 3 for k, heard in enumerate(later) if name in heard and k % 3 == which} for which in range(3)]
        assert [len(each) for each in turns] == [20 if name == "state" else 2] * 3
        assert len(set.union(*turns)) == sum(map(len, turns))


def test_nothing_is_built_that_nobody_listens_to(feed, vehicle) -> None:
    assert list(feed.due(0.0, nothing)) == []
    assert vehicle.load_requests == 0


def test_each_wanted_topic_goes_out(feed, vehicle) -> None:
    vehicle.now_us = 20_000
    out = dict((topic.name, json.loads(data)) for topic, data in feed.due(0.02, everything))
    assert {"state", "attitude", "setpoint", "actuators", "loads", "mode", "loop"} == set(out)
    assert out["attitude"] == {"what": "attitude", "now_us": 20_000}


def test_only_the_wanted_topics_go_out(feed) -> None:
    assert names(feed.due(0.0, lambda topic: topic is keys.LOADS)) == ["loads"]


def test_a_change_of_mode_goes_out_in_the_same_turn_also_when_paused(feed, vehicle) -> None:
    list(feed.due(0.0, everything))
    assert names(feed.due(0.004, everything)) == []
    vehicle.status = "flying"
    ((topic, data),) = feed.due(0.008, everything)
    assert topic is keys.MODE
    assert json.loads(data)["status"] == "flying"
    vehicle.parameters["SIM_SPEED"] = 10.0
    assert names(feed.due(0.012, everything)) == ["mode"]


def test_mode_and_loop_are_repeated_each_second(feed) -> None:
    out = [name for k in range(501) for name in names(feed.due(k * 0.02, everything))]
    assert out.count("mode") == out.count("loop") == 11


def test_every_event_goes_out_once_and_in_order(feed, vehicle) -> None:
    list(feed.due(0.0, everything))
    for k in range(3):
        vehicle.events.add(EventKind.TEXT, Severity.INFO, f"event {k}")
    out = [json.loads(data)["text"] for topic, data in feed.due(0.004, everything) if topic is keys.EVENT]
    assert out == ["event 0", "event 1", "event 2"]
    assert list(feed.due(0.008, everything)) == []


def test_the_history_of_events_can_be_asked_for(feed, vehicle) -> None:
    vehicle.events.add(EventKind.TEXT, Severity.INFO, "before anyone listened")
    answer = json.loads(feed.latest(keys.EVENTS))
    assert [event["text"] for event in answer["events"]] == ["before anyone listened"]
    assert answer["next_number"] == 1


def test_frames_are_gathered_and_go_out_whole_and_in_order(feed) -> None:
    list(feed.due(0.0, everything))
    feed.frame(b"\xfdone", True)
    feed.frame(b"\xfdin", False)
    feed.frame(b"\xfdtwo", True)
    assert names(feed.due(GATHER_S / 2, everything)) == []
    out = {topic.name: data for topic, data in feed.due(GATHER_S, everything)}
    assert out == {"mavlink/out": b"\xfdone\xfdtwo", "mavlink/in": b"\xfdin"}


def test_frames_that_nobody_wants_are_not_kept(feed) -> None:
    list(feed.due(0.0, nothing))
    feed.frame(b"\xfdone", True)
    assert names(feed.due(1.0, everything)) == ["mode", "loop"]


def test_a_flood_of_frames_is_cut_at_a_frame_s_end(feed) -> None:
    list(feed.due(0.0, lambda topic: topic is keys.MAVLINK_OUT))
    frame = b"\xfd" + bytes(279)
    for _ in range(1000):
        feed.frame(frame, True)
    ((_, data),) = feed.due(1.0, lambda topic: topic is keys.MAVLINK_OUT)
    assert len(data) <= GATHER_MAX_BYTES
    assert len(data) % len(frame) == 0


def test_keys_carry_the_instance() -> None:
    assert keys.key(7, keys.MAVLINK_OUT) == "yawsitter/7/mavlink/out"
    assert keys.alive_key(7) == "yawsitter/7/alive"
