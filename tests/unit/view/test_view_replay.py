"""A recording as a source: any moment of it, forward and back, and what is no recording."""

import json
from pathlib import Path

import pytest
from view_messages import SAMPLED, event, message

pytest.importorskip("mcap")
from mcap.writer import Writer

from gcs_tools.view.history import INDEX
from gcs_tools.view.replay import Replay
from sitl.strict_yaml import ConfigError

BEGIN_US, STEP_US, STEPS = 5_000_000, 4_000, 1000  # 4 s at 250 Hz


def write(path: Path, instance: int = 3) -> Path:
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 16)
        writer.start()
        channels = {
            topic: writer.register_channel(f"yawsitter/{instance}/{topic}", "json", 0)
            for topic in (*SAMPLED, "mode", "event", "description", "weather")
        }

        def put(topic: str, now_us: int, data: bytes) -> None:
            log_ns = 1_790_000_000_000_000_000 + 1000 * now_us
            writer.add_message(channels[topic], log_ns, data, log_ns)

        put("description", BEGIN_US, json.dumps({"instance": instance, "vehicle": {"name": "tested"}}).encode())
        put("weather", BEGIN_US, b"of no interest")
        put("mode", BEGIN_US, message("mode", BEGIN_US, mode="takeoff"))
        for k in range(STEPS):
            now_us = BEGIN_US + k * STEP_US
            for topic in SAMPLED:
                changes = {"position_N_m": [0.001 * k, 0.0, 0.0]} if topic == "state" else {}
                put(topic, now_us, message(topic, now_us, **changes))
            if k == 500:
                put("mode", now_us, message("mode", now_us, mode="hold"))
                put("event", now_us, event(7, "mode", "hold").replace(b"7000", str(now_us).encode()))
        writer.finish()
    return path


@pytest.fixture
def replay(tmp_path) -> Replay:
    return Replay.load(write(tmp_path / "flight.mcap"))


def test_a_recording_is_its_flight_from_begin_to_end_at_fifty_instants_a_second(replay: Replay) -> None:
    assert replay.duration_s == pytest.approx(4.0, abs=0.03)
    vehicle = replay.vehicles[3]
    assert vehicle.name == "tested 3"
    assert vehicle.alive
    replay.seek(99.0)
    replay.poll(0.0)
    assert len(vehicle.history.table()) == pytest.approx(200, abs=2)


def test_any_moment_can_be_gone_to_and_shows_what_was_so_then(replay: Replay) -> None:
    vehicle = replay.vehicles[3]
    for time_s, mode, events in ((3.0, "hold", 1), (1.0, "takeoff", 0), (2.5, "hold", 1), (0.0, "takeoff", 0)):
        replay.seek(time_s)
        replay.poll(0.0)
        assert vehicle.instant is not None
        assert vehicle.mode is not None
        assert vehicle.instant.now_us == pytest.approx(BEGIN_US + time_s * 1e6, abs=20_000)
        assert vehicle.instant.state.position_N_m[0] == pytest.approx(0.25 * time_s, abs=0.006)
        assert (vehicle.mode.mode, len(vehicle.events)) == (mode, events)
        assert vehicle.history.table()[-1, INDEX["t_s"]] == pytest.approx(vehicle.instant.now_us * 1e-6)


def test_it_plays_at_its_speed_stops_at_the_end_and_begins_anew(replay: Replay) -> None:
    replay.poll(100.0)
    assert replay.time_s == 0.0
    replay.toggle()
    replay.speed = 2.0
    replay.poll(101.0)
    assert replay.time_s == pytest.approx(2.0)
    replay.poll(109.0)
    assert replay.time_s == replay.duration_s
    assert not replay.playing
    replay.toggle()
    replay.poll(109.5)
    assert replay.time_s == pytest.approx(1.0)


def test_a_recording_that_was_cut_off_is_played_as_far_as_it_goes(tmp_path) -> None:
    whole = write(tmp_path / "flight.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    assert 0.5 < Replay.load(tmp_path / "cut.mcap").duration_s < 3.5


def test_what_is_no_recording_is_refused_in_one_line(tmp_path) -> None:
    (tmp_path / "text.mcap").write_text("hello " * 100)
    (tmp_path / "empty.mcap").write_bytes(b"")
    with (tmp_path / "other.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_message(writer.register_channel("imu", "json", 0), 1, b"{}", 1)
        writer.finish()
    for name, reason in (
        ("text.mcap", "no recording"), ("empty.mcap", "no recording"), ("gone.mcap", "No such file"),
        ("other.mcap", "holds no flight"),
    ):  # fmt: skip
        with pytest.raises(ConfigError, match=reason) as refused:
            Replay.load(tmp_path / name)
        assert str(refused.value).startswith(str(tmp_path / name))
        assert "\n" not in str(refused.value)
