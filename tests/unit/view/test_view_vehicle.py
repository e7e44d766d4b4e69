"""What the page makes of messages: whole instants only, in order, whatever is lost or late."""

import json

import pytest
from view_messages import SAMPLED, event, message

from gcs_tools.view.history import INDEX, History
from gcs_tools.view.vehicle import WAITING_MAX, Vehicle


def sample(vehicle: Vehicle, now_us: int, leave_out: str = "", **position: list[float]) -> None:
    for topic in SAMPLED:
        if topic != leave_out:
            vehicle.take(topic, message(topic, now_us, **(position if topic == "state" else {})))


def test_an_instant_is_shown_once_all_of_it_is_there() -> None:
    vehicle = Vehicle(0)
    sample(vehicle, 20_000, leave_out="loads")
    assert vehicle.instant is None
    vehicle.take("loads", message("loads", 20_000))
    assert vehicle.instant is not None
    assert vehicle.instant.now_us == 20_000
    assert vehicle.instant.loads.causes["thrust"].force_B_N == (11.0, 0.0, 0.0)


def test_parts_of_different_instants_are_never_mixed() -> None:
    vehicle = Vehicle(0)
    sample(vehicle, 20_000, leave_out="setpoint")
    vehicle.take("setpoint", message("setpoint", 40_000))
    assert vehicle.instant is None
    sample(vehicle, 40_000, leave_out="setpoint")
    assert vehicle.instant is not None
    assert {part.now_us for part in vehicle.instant} == {40_000}


def test_an_answer_that_a_newer_sample_overtook_is_passed_over() -> None:
    vehicle = Vehicle(0)
    sample(vehicle, 40_000)
    sample(vehicle, 20_000)
    assert vehicle.instant is not None
    assert vehicle.instant.now_us == 40_000
    assert len(vehicle.history.table()) == 1


def test_instants_that_never_become_whole_do_not_gather() -> None:
    vehicle = Vehicle(0)
    for k in range(10 * WAITING_MAX):
        sample(vehicle, 1000 * k, leave_out="loads")
    assert len(vehicle._waiting) <= WAITING_MAX


@pytest.mark.parametrize(
    "payload",
    [b"", b"{}", b"not json", message("state", 1, position_N_m=[None, 0.0, 0.0]), message("state", 1, position_N_m=1)],
)
def test_a_message_that_cannot_be_read_is_counted_and_harms_nothing(payload: bytes) -> None:
    vehicle = Vehicle(0)
    vehicle.take("state", payload)
    vehicle.take("weather", b"{}")
    assert vehicle.unreadable == 2
    sample(vehicle, 20_000)
    assert vehicle.instant is not None


def test_events_come_once_each_whether_heard_or_asked_for() -> None:
    vehicle = Vehicle(0)
    vehicle.take("event", event(5))
    known = json.dumps({"next_number": 6, "events": [json.loads(event(k)) for k in (3, 4, 5)]}).encode()
    vehicle.take("events", known)
    vehicle.take("event", event(6))
    vehicle.take("event", event(6))
    assert [e.number for e in vehicle.events] == [3, 4, 5, 6]


def test_a_vehicle_that_starts_again_leaves_nothing_behind() -> None:
    vehicle = Vehicle(0)
    sample(vehicle, 9_000_000)
    vehicle.take("mode", message("mode", 9_000_000))
    epoch = vehicle.epoch
    vehicle.forget()
    assert vehicle.epoch > epoch
    assert vehicle.instant is None
    assert vehicle.mode is None
    assert len(vehicle.history.table()) == 0
    sample(vehicle, 20_000)
    assert vehicle.instant is not None
    assert vehicle.now_us == 20_000


def test_the_history_keeps_the_newest_rows_in_order() -> None:
    vehicle = Vehicle(0)
    vehicle.history = History(rows=10)
    for k in range(1, 96):
        sample(vehicle, k * 20_000, position_N_m=[float(k), 0.0, 0.0])
    table = vehicle.history.table()
    assert table[:, INDEX["north_m"]].tolist() == [float(k) for k in range(86, 96)]
    assert vehicle.history.last(0.1)[:, INDEX["t_s"]] == pytest.approx([1.82, 1.84, 1.86, 1.88, 1.9])
