"""Logs read and measured, whole and broken, and the report that comes of them."""

import itertools
import json
import math
import random
import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from gcs_tools.__main__ import main
from gcs_tools.report.link_quality import gaps, is_shared
from gcs_tools.report.log import Log, read
from gcs_tools.report.measure import measure, timeline
from gcs_tools.report.tables import changed
from sitl.mavlink.codec import Encoder, mav, message
from sitl.strict_yaml import ConfigError

START_S = 1.7e9
ARMED = mav.MAV_MODE_FLAG_SAFETY_ARMED
HOLD, OFFBOARD = 4 << 16 | 3 << 24, 6 << 16


def tlog(path: Path, entries: Iterable[tuple[float, Encoder, Any]]) -> Path:
    """A log of messages, each with its wall time from the start and its sender."""
    stamped = [
        struct.pack(">Q", int((START_S + t) * 1e6)) + sender.encode(m) for t, sender, m in sorted(entries, key=by_time)
    ]
    path.write_bytes(b"".join(stamped))
    return path


def by_time(entry: tuple[float, Encoder, Any]) -> float:
    return entry[0]


def heartbeat(armed: bool, custom_mode: int = OFFBOARD) -> Any:
    return message(
        "HEARTBEAT",
        type=19,
        autopilot=mav.MAV_AUTOPILOT_PX4,
        base_mode=ARMED if armed else 0,
        custom_mode=custom_mode,
        system_status=mav.MAV_STATE_ACTIVE,
        mavlink_version=3,
    )


def flight(
    seconds: float, *, armed: tuple[float, float], off_m: float = 0.1, boot_s: float = 10.0, at_s: float = 0.0
) -> list[tuple[float, Any]]:
    """A vehicle's messages: it goes north at 1 m/s and stands off_m east of its reference while armed."""
    told: list[tuple[float, Any]] = []
    for k in range(round(seconds * 10)):
        t = k / 10
        ms = round((boot_s + t) * 1000)
        z = -3.0 if armed[0] < t < armed[1] else 0.0
        told.append((at_s + t, message("LOCAL_POSITION_NED", time_boot_ms=ms, x=t, y=off_m, z=z, vx=1.0)))
        told.append((at_s + t, message("POSITION_TARGET_LOCAL_NED", time_boot_ms=ms, x=t, y=0.0, z=z, vx=1.0)))
        if k % 10 == 0 or t in armed:
            told.append((at_s + t, heartbeat(armed[0] <= t < armed[1])))
    return told


def sent(by: int, messages: list[tuple[float, Any]]) -> list[tuple[float, Encoder, Any]]:
    encoder = Encoder(by, 1)
    return [(t, encoder, m) for t, m in sorted(messages, key=lambda entry: entry[0])]


@pytest.fixture
def simple(tmp_path: Path) -> Path:
    return tlog(tmp_path / "simple.tlog", sent(3, flight(20.0, armed=(2.0, 18.0))))


def report(path: Path, *arguments: str) -> dict[str, Any]:
    assert main(["report", str(path), "--out", str(path.parent), *arguments]) == 0
    data: dict[str, Any] = json.loads(path.with_name(f"{path.name}.json").read_text(encoding="utf-8"))
    return data


def test_a_flight_is_measured_from_arming_to_disarming_against_its_recorded_reference(simple: Path) -> None:
    m = measure(read(simple, None), None, None)
    assert m.spans == [(12.0, 28.0)]
    assert m.duration_s == pytest.approx(16.0)
    assert m.reported is not None
    assert m.true is None
    assert m.reported.mae == pytest.approx((0.0, 0.1, 0.0), abs=1e-6)
    assert m.distance_m == pytest.approx(16.0, abs=0.2)
    assert m.height_m == pytest.approx(3.0)


def test_of_several_flights_the_longest_is_taken_unless_another_is_asked_for(tmp_path: Path) -> None:
    first, second = flight(10.0, armed=(2.0, 8.0)), flight(20.0, armed=(2.0, 18.0), boot_s=20.0, at_s=10.0, off_m=0.3)
    path = tlog(tmp_path / "two.tlog", sent(1, first + second))
    log = read(path, None)
    assert [end - begin for begin, end in log.armed_spans()] == pytest.approx([6.0, 16.0])
    longest, asked_for = measure(log, None, None), measure(log, 1, None)
    assert (longest.number, asked_for.number) == (2, 1)
    assert longest.reported is not None
    assert asked_for.reported is not None
    assert longest.reported.mae[1] == pytest.approx(0.3, abs=1e-6)
    assert asked_for.reported.mae[1] == pytest.approx(0.1, abs=1e-6)
    with pytest.raises(ConfigError, match="no flight 3 in it; allowed: 1 to 2"):
        measure(log, 3, None)


def test_after_a_restart_the_time_goes_on(tmp_path: Path) -> None:
    before, after = flight(10.0, armed=(2.0, 8.0)), flight(10.0, armed=(2.0, 8.0), boot_s=0.0, at_s=15.0)
    log = read(tlog(tmp_path / "again.tlog", sent(1, before + after)), None)
    assert [kind for _, kind, _ in timeline(log)].count("restart") == 1
    first, second = log.armed_spans()
    assert second[0] - first[0] == pytest.approx(15.0, abs=0.1)  # as on the wall
    positions = log.reported.track(0.0, None).t_s
    assert len(positions) == 200
    assert all(b > a for a, b in itertools.pairwise(positions))


def test_of_several_vehicles_the_first_one_is_told_unless_another_is_asked_for(tmp_path: Path) -> None:
    mine, other = flight(10.0, armed=(2.0, 8.0)), flight(10.0, armed=(3.0, 6.0), at_s=0.05)
    path = tlog(tmp_path / "swarm.tlog", sent(4, mine) + sent(9, other))
    assert read(path, None).facts == {"system": "4", "other vehicles": "system 9 (--system ID reports another)"}
    assert read(path, 9).armed_spans() == [(13.0, 16.0)]
    with pytest.raises(ConfigError, match="no system 7 in it; allowed: 4, 9"):
        read(path, 7)


def test_texts_in_pieces_are_joined_and_what_they_say_can_do_the_page_no_harm(tmp_path: Path) -> None:
    evil = "<script>alert('&')</script> " * 3
    pieces = [evil[k : k + 50] for k in range(0, len(evil) + 1, 50)]
    texts = [
        (5.0 + k / 100, message("STATUSTEXT", severity=4, text=piece, id=7, chunk_seq=k))
        for k, piece in enumerate(pieces)
    ]
    path = tlog(tmp_path / "texts.tlog", sent(1, flight(10.0, armed=(2.0, 8.0)) + texts))
    told = report(path)
    assert [entry["text"] for entry in told["timeline"] if entry["kind"] == "warning"] == [evil]
    page = path.with_name("texts.tlog.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_what_was_set_in_flight_and_what_differs_from_the_default_is_told(tmp_path: Path) -> None:
    def value(name: str, number: float) -> Any:
        return message("PARAM_VALUE", param_id=name, param_value=number, param_type=mav.MAV_PARAM_TYPE_REAL32)

    named = message("STATUSTEXT", severity=6, text="YawSitter SITL 0.1.0: simulated 'yawsitter'")
    told = [(0.5, named), (1.0, value("POS_X_P", 2.5)), (1.1, value("POS_X_P", 2.5)), (5.0, value("POS_X_P", 3.5))]
    log = read(tlog(tmp_path / "set.tlog", sent(1, flight(10.0, armed=(2.0, 8.0)) + told)), None)
    assert [(t, text) for t, kind, text in timeline(log) if kind == "parameter"] == [(15.0, "POS_X_P = 3.5")]
    assert changed(log) == {"POS_X_P": (3.5, log.defaults["POS_X_P"])}
    assert log.defaults["POS_X_P"] not in (2.5, 3.5)


def test_bouncing_at_touch_down_is_not_told(tmp_path: Path) -> None:
    landed = [(1.0, 1), (3.0, 2), (8.0, 1), (8.1, 2), (8.2, 1), (8.3, 2), (8.4, 1)]
    states = [(t, message("EXTENDED_SYS_STATE", landed_state=state)) for t, state in landed]
    log = read(tlog(tmp_path / "bounce.tlog", sent(1, flight(10.0, armed=(2.0, 9.0)) + states)), None)
    assert [text for _, kind, text in timeline(log) if kind == "landed"] == [
        "on the ground", "in the air", "on the ground",
    ]  # fmt: skip


def test_what_is_broken_in_a_log_is_left_out_and_named(simple: Path) -> None:
    whole = read(simple, None)
    data = simple.read_bytes()
    middle = len(data) // 2
    simple.write_bytes(data[:middle] + bytes(range(256)) + data[middle + 100 :])
    log = read(simple, None)
    (damage,) = log.damage
    assert "are no frames: left out" in damage
    assert middle - 60 < int(damage.split("from byte ")[1].split()[0]) <= middle
    assert len(whole.reported.positions) - 8 < len(log.reported.positions) < len(whole.reported.positions)
    assert log.armed_spans() == whole.armed_spans()


def test_a_log_that_is_cut_off_is_read_to_there(simple: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = simple.read_bytes()
    simple.write_bytes(data[: len(data) // 2 + 5])
    told = report(simple)
    assert told["flight"]["duration_s"] == pytest.approx(8.0, abs=0.2)
    assert told["reported"]["mae"][1] == pytest.approx(0.1, abs=1e-6)
    assert "no whole frame: cut off" in told["damage"][0]
    assert capsys.readouterr().err == f"warning: {simple}: {told['damage'][0]}\n"


def test_a_flight_that_never_ends_and_one_that_never_was_are_told_too(tmp_path: Path) -> None:
    endless = read(tlog(tmp_path / "endless.tlog", sent(1, flight(10.0, armed=(2.0, math.inf)))), None)
    assert endless.armed_spans() == [(12.0, pytest.approx(19.9))]
    never = report(tlog(tmp_path / "never.tlog", sent(1, flight(5.0, armed=(9.0, 9.5)))))
    assert never["facts"]["armed"] == "never"
    mute = report(tlog(tmp_path / "mute.tlog", sent(1, [(0.0, heartbeat(False, HOLD)), (1.0, heartbeat(True))])))
    assert "reported" not in mute


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "is empty"),
        (b'{"fileType": "Plan"}', "is not a log: no MAVLink frames in it; allowed: .tlog, .mcap"),
        (random.Random(1).randbytes(300_000), "is not a log: no MAVLink frames in it; allowed: .tlog, .mcap"),
        (b"\x89MCAP0\r\n", "no record of a vehicle is in it (keys yawsitter/<instance>/…)"),
        (b"\x89MCAP0\r\n" + random.Random(2).randbytes(5000), "no record of a vehicle is in it"),
    ],
)
def test_an_empty_or_foreign_file_is_one_line_and_status_2(
    content: bytes, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "some.tlog"
    path.write_bytes(content)
    assert main(["report", str(path)]) == 2
    told = capsys.readouterr()
    assert told.err.startswith(f"gcs report: {path}: {complaint}")
    assert told.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == [path]


def test_a_record_without_a_vehicle_is_no_flight(tmp_path: Path) -> None:
    gcs = message("HEARTBEAT", type=mav.MAV_TYPE_GCS, autopilot=mav.MAV_AUTOPILOT_INVALID)
    with pytest.raises(ConfigError, match="no vehicle is heard in it"):
        read(tlog(tmp_path / "gcs.tlog", sent(255, [(0.0, gcs), (1.0, gcs)])), None)


def test_a_file_that_is_not_there_and_a_folder_that_cannot_be_written_are_named(
    simple: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = simple.with_name("missing.tlog")
    assert main(["report", str(missing)]) == 2
    assert capsys.readouterr().err == f"gcs report: {missing}: can't be read: No such file or directory\n"
    assert main(["report", str(simple), "--out", str(simple / "sub")]) == 2
    assert "can't be made a folder" in capsys.readouterr().err


def test_lost_late_and_foreign_numbers_are_told_apart() -> None:
    numbers = [n & 0xFF for n in range(3000)]
    chosen = random.Random(3)
    thinned = [n for n in numbers if chosen.random() > 0.1]
    shuffled = [n for _, n in sorted((k + chosen.random() * 20, n) for k, n in enumerate(thinned))]
    assert gaps(numbers) == (0, 0)
    assert gaps(thinned) == (3000 - len(thinned), 0)
    lost, late = gaps(shuffled)
    assert lost == pytest.approx(3000 - len(thinned), abs=3)
    assert late > 1000
    assert not any(map(is_shared, (numbers, thinned, shuffled)))
    with_replies = list(numbers)
    for k in range(100, 2900, 100):  # another link's numbers in between
        with_replies.insert(k, (77 + k) & 0xFF)
    assert is_shared(with_replies)


def test_losses_and_doubles_on_the_way_are_counted(tmp_path: Path) -> None:
    entries = sent(1, flight(20.0, armed=(2.0, 18.0)))
    encoder = Encoder(1, 1)
    encoded = [struct.pack(">Q", int((START_S + t) * 1e6)) + encoder.encode(m) for t, _, m in entries]
    kept = [entry for k, entry in enumerate(encoded) if k % 10 != 5]
    kept[100:100] = kept[99:100]
    path = tmp_path / "lossy.tlog"
    path.write_bytes(b"".join(kept))
    link = read(path, None).link
    assert link is not None
    (source,) = link.sources
    assert (source.lost, source.doubled, source.late) == (len(encoded) // 10, 1, 0)
    assert source.loss == pytest.approx(0.1, abs=0.001)
    rates = {rate.name: rate for rate in link.rates}
    assert rates["LOCAL_POSITION_NED"].mean_Hz == pytest.approx(9.0, abs=0.5)


def test_a_log_with_messages_from_before_any_time_is_read(tmp_path: Path) -> None:
    early = [(0.0, heartbeat(False)), *flight(5.0, armed=(1.0, 4.0), at_s=2.0)]
    log: Log = read(tlog(tmp_path / "early.tlog", sent(1, early)), None)
    assert log.status[0].t_s == pytest.approx(10.0)
