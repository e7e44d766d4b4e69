"""Recorded flights: what is in the files, what is left when something dies, and that nobody waits for the disk."""

import contextlib
import io
import json
import logging
import os
import shutil
import signal
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader
from pymavlink import mavutil

from sitl.closed_loop import TRACE_COLUMNS, traced
from sitl.daemon import flight_writer
from sitl.daemon.config import SettingError
from sitl.daemon.flight_pipe import BACKLOG_MAX, BEGIN, FRAME, HEAD, STEPS, FlightPipe
from sitl.daemon.flight_recorder import FlightRecorder
from sitl.daemon.flight_writer import FlightFiles, json_schema, make_room, write
from sitl.daemon.recorder import BEFORE_BYTES, Flight, Recorder, close
from sitl.mavlink.codec import Encoder, message
from sitl.mavlink.tlog import STAMP
from sitl.telemetry import schema
from sitl.telemetry.feed import Feed
from sitl.vehicle import Vehicle, load_vehicle

HEARTBEAT = Encoder(1, 1).encode(message("HEARTBEAT", type=19, autopilot=12, mavlink_version=3))
FLIGHT = Flight("2026-01-02_03-04-05-678Z_instance-3", 3, 1_700_000_000.0, 1_000_000, (55.0, 37.0, 190.0), "")


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    """One that does not know exactly where it is."""
    return Vehicle(load_vehicle("yawsitter-real"))


@pytest.fixture
def recorder(tmp_path):
    made = Recorder(FlightPipe(), tmp_path, 3)
    yield made
    close([made])


def fly(vehicle: Vehicle, recorder: Recorder, seconds: float, unix_s: float = 1000.0) -> list[list[float]]:
    """Arm, take off, fly, turn off; the rows that were handed over."""
    flight = FlightRecorder(vehicle, Feed(vehicle, 3, lambda: None), recorder)
    vehicle.reset()
    vehicle.commander.takeoff()
    flight.frame(HEARTBEAT, unix_s)
    assert vehicle.commander.arm().ok
    rows = []
    for k in range(round(seconds / 0.02)):
        trace = flight.trace(vehicle.now_us + 20_000, unix_s)
        vehicle.advance(vehicle.now_us + 20_000, trace)
        flight.take(trace)
        flight.frame(HEARTBEAT, unix_s + 1.0 + k)
        rows += [] if trace is None else trace.tolist()
        if k == 5:
            vehicle.parameters.set("POS_X_P", 1.25)
    vehicle.commander.disarm(force=True)
    assert flight.trace(vehicle.now_us + 20_000, 1100.0) is None
    return rows


def contents(path: Path) -> dict[str, list]:
    """Decoded messages by topic."""
    found: dict[str, list] = {}
    with path.open("rb") as file:
        for _, channel, m in make_reader(file).iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append(json.loads(m.data))
    return found


def frames(path: Path) -> list:
    """What pymavlink, and so mavlogdump, reads in a .tlog."""
    log = mavutil.mavlink_connection(str(path))
    return list(iter(lambda: log.recv_match(), None))


def test_a_flight_is_kept_whole_at_the_rate_of_the_control_steps(vehicle, recorder, tmp_path) -> None:
    rows = fly(vehicle, recorder, 1.0)
    close([recorder])
    assert (recorder.steps_kept, recorder.steps_seen) == (500, 500)
    [mcap], [tlog] = tmp_path.glob("*.mcap"), tmp_path.glob("*.tlog")
    kept = contents(mcap)
    state = kept["yawsitter/3/state"]
    assert [m["now_us"] for m in state] == [round(row[0] * 1e6) for row in rows]
    assert all(b["now_us"] - a["now_us"] == vehicle.step_us for a, b in pairwise(state))
    last = traced(rows[-1])
    assert state[-1]["position_N_m"] == [last.state.north_m, last.state.east_m, last.state.down_m]
    assert state[-1]["nav_position_N_m"] == [last.nav.north_m, last.nav.east_m, last.nav.down_m]
    assert state[-1]["nav_position_N_m"] != state[-1]["position_N_m"]
    assert kept["yawsitter/3/setpoint"][-1]["position_N_m"][2] == last.reference.down_m
    assert kept["yawsitter/3/actuators"][-1]["thrust_left_command_N"] == last.command.thrust_left_N
    assert kept["yawsitter/3/attitude"][-1]["q_NB"][0] == last.state.qw
    causes = kept["yawsitter/3/loads"][-1]["causes"]
    assert set(causes) == set(vehicle.loads())
    assert causes["thrust"]["force_B_N"] == list(last.acting.thrust_force)
    first, *changes = kept["yawsitter/3/parameters"]
    assert len(first["parameters"]) == len(vehicle.parameters.names)
    assert [(m["name"], m["value"]) for c in changes for m in c["parameters"]] == [("POS_X_P", 1.25)]
    assert "armed" in [m["text"] for m in kept["yawsitter/3/event"]]
    assert kept["yawsitter/3/mode"][0]["armed"]
    assert kept["yawsitter/3/description"][0]["vehicle"]["name"] == "yawsitter-real"
    assert len(frames(tlog)) == 51  # the one before the arming too


def test_each_flight_gets_files_of_its_own_and_the_time_between_gets_none(vehicle, recorder, tmp_path) -> None:
    fly(vehicle, recorder, 0.1)
    for _ in range(3):
        recorder.frame(HEARTBEAT, 2000.0)
    fly(vehicle, recorder, 0.2, unix_s=3000.0)
    [_, last] = sorted(recorder.pipe.closing) if len(recorder.pipe.closing) == 2 else ["", *recorder.pipe.closing]
    assert recorder.writes(f"{last}.mcap")  # it may not be removed before it is whole
    close([recorder])
    assert not recorder.writes(f"{last}.mcap")
    sizes = [len(contents(path)["yawsitter/3/state"]) for path in sorted(tmp_path.glob("*.mcap"))]
    assert sizes == [50, 100]


def test_of_the_time_before_a_flight_the_last_frames_are_kept_and_no_more(recorder, tmp_path) -> None:
    for k in range(2 * BEFORE_BYTES // len(HEARTBEAT)):
        recorder.frame(HEARTBEAT, 1000.0 + k)
    recorder.begin(1e6, 0, (55.0, 37.0, 190.0))
    close([recorder])
    [tlog] = tmp_path.glob("*.tlog")
    stamped = STAMP.size + len(HEARTBEAT)
    assert BEFORE_BYTES - stamped < tlog.stat().st_size <= BEFORE_BYTES
    newest = tlog.read_bytes()[-stamped:]
    assert STAMP.unpack_from(newest)[0] == (1000 + 2 * BEFORE_BYTES // len(HEARTBEAT) - 1) * 1_000_000


def test_the_log_time_is_the_wall_time_at_arming_plus_simulation_time(tmp_path) -> None:
    files = FlightFiles(FLIGHT._replace(folder=str(tmp_path)))
    files.steps(row_at(1.5).tobytes())
    files.close()
    with next(tmp_path.glob("*.mcap")).open("rb") as file:
        assert {m.log_time for _, _, m in make_reader(file).iter_messages()} == {1_700_000_000_500_000_000}


def row_at(t_s: float) -> np.ndarray:
    row = np.zeros((1, len(TRACE_COLUMNS)))
    row[0, 0] = t_s
    row[0, TRACE_COLUMNS.index("qw")] = row[0, TRACE_COLUMNS.index("command_qw")] = 1.0
    row[0, TRACE_COLUMNS.index("nav_qw")] = 1.0
    return row


def test_when_the_writer_dies_all_up_to_the_last_flush_can_be_read(tmp_path) -> None:
    files = FlightFiles(FLIGHT._replace(folder=str(tmp_path)))
    for k in range(1000):
        files.frame(STAMP.pack(1_700_000_000_000_000 + k) + HEARTBEAT)
        files.steps(row_at(1.0 + 0.002 * k).tobytes())
    files._flush_s = 0.0
    files.flush()
    (tmp_path / "left").mkdir()
    for path in tmp_path.glob(f"{FLIGHT.name}.*"):
        shutil.copy(path, tmp_path / "left" / path.name)
    assert len(frames(tmp_path / "left" / f"{FLIGHT.name}.tlog")) == 1000
    times = []
    with (tmp_path / "left" / f"{FLIGHT.name}.mcap").open("rb") as file, contextlib.suppress(McapError):
        for _, _, m in NonSeekingReader(file).iter_messages(log_time_order=False):  # as `mcap recover` does
            times.append(m.log_time)
    assert 3500 < len(times) < 5000  # what was in the last chunk is gone
    assert times == sorted(times)
    files.close()


def test_when_the_vehicles_process_dies_the_files_are_closed_properly(tmp_path) -> None:
    sent = [
        (BEGIN, FLIGHT._replace(folder=str(tmp_path)).pack()),
        (FRAME, STAMP.pack(5) + HEARTBEAT),
        (STEPS, row_at(1.0).tobytes()),
    ]
    stream = b"".join(HEAD.pack(kind, 3, len(data)) + data for kind, data in sent)
    done: list[str] = []
    write(io.BytesIO(stream + HEAD.pack(STEPS, 3, 824) + b"half a st"), done.append)
    assert done == [FLIGHT.name]
    assert len(contents(tmp_path / f"{FLIGHT.name}.mcap")["yawsitter/3/state"]) == 1
    assert len(frames(tmp_path / f"{FLIGHT.name}.tlog")) == 1


def test_nobody_waits_for_a_writer_that_stands_still_and_steps_are_thinned_not_torn(recorder, tmp_path) -> None:
    recorder.begin(1.7e9, 0, (55.0, 37.0, 190.0))
    os.kill(recorder.pipe.process.pid, signal.SIGSTOP)
    try:
        rows = np.concatenate([row_at(0.002 * k) for k in range(200)])
        longest = 0.0
        for k in range(400):
            rows[:, 0] = 0.4 * k + 0.002 * np.arange(200)
            start_s = time.perf_counter()
            recorder.steps(rows)
            recorder.pump()
            longest = max(longest, time.perf_counter() - start_s)
        assert longest < 5.0  # it would be for ever; anything in between is the machine
        assert len(recorder.pipe.backlog) <= BACKLOG_MAX
    finally:
        os.kill(recorder.pipe.process.pid, signal.SIGCONT)
    close([recorder])
    assert recorder.steps_seen == 80_000
    assert 2000 < recorder.steps_kept < 40_000
    state = contents(next(tmp_path.glob("*.mcap")))["yawsitter/3/state"]
    assert len(state) == recorder.steps_kept
    gaps = np.diff([m["now_us"] for m in state])
    assert gaps.min() >= 2000
    assert state[-1]["now_us"] > 150e6  # thinned to the end, not cut off


def test_when_the_writer_is_gone_the_recording_ends_and_nothing_else(vehicle, recorder, caplog) -> None:
    caplog.set_level(logging.ERROR)
    recorder.pipe.process.kill()
    recorder.pipe.process.wait()
    fly(vehicle, recorder, 0.2)
    assert caplog.text.count("recording stopped") == 1


def test_the_oldest_flights_make_room_and_other_files_stay(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(flight_writer, "FLIGHTS_MAX", 3)
    monkeypatch.setattr(flight_writer, "FOLDER_BYTES", 1000)
    monkeypatch.setattr(flight_writer, "FLIGHT_BYTES", 100)
    names = [f"2026-01-0{k}_00-00-00-000Z_instance-0" for k in range(1, 6)]
    for name in names:
        (tmp_path / f"{name}.tlog").write_bytes(bytes(10))
        (tmp_path / f"{name}.mcap").write_bytes(bytes(10))
    (tmp_path / "notes.txt").write_bytes(bytes(5000))
    make_room(tmp_path)
    assert sorted({path.stem for path in tmp_path.glob("2026*")}) == names[3:]
    (tmp_path / f"{names[4]}.mcap").write_bytes(bytes(950))
    make_room(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_flight_that_outgrows_its_file_loses_its_end_not_its_begin(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(flight_writer, "FLIGHT_BYTES", 20_000)
    monkeypatch.setattr(flight_writer, "CHUNK_BYTES", 4096)
    files = FlightFiles(FLIGHT._replace(folder=str(tmp_path)))
    for k in range(3000):
        files.steps(row_at(1.0 + 0.002 * k).tobytes())
    files.close()
    state = contents(tmp_path / f"{FLIGHT.name}.mcap")["yawsitter/3/state"]
    assert state[0]["now_us"] == 1_000_000
    assert 10 < len(state) < 2500


@pytest.mark.parametrize("message", [schema.StateMessage, schema.LoadsMessage, schema.ParametersMessage])
def test_schemas_are_plain_objects(message) -> None:
    told = json_schema(message)
    assert told["type"] == "object"
    assert "prefixItems" not in json.dumps(told)


def test_a_folder_that_can_t_be_made_is_refused_in_one_line(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingError, match="--record"):
        Recorder(None, tmp_path / "file", 0)
