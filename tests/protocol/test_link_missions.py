"""Plan transfer in both directions, over good and bad links, and what may not go wrong with the old plan."""

import math
import random
from typing import Any

import pytest
from mavlink_pair import Downloader, Station, Uploader, Wire, World, item_of, send_item

from sitl.mavlink.codec import mav
from sitl.mavlink.mission import GIVE_UP_S
from sitl.onboard.plan import CAPACITY, MissionItem

ACCEPTED, ERROR, UNSUPPORTED_FRAME, UNSUPPORTED, NO_SPACE = range(5)
INVALID_PARAM1, INVALID_SEQUENCE, DENIED, CANCELLED = 6, 13, 14, 15
NAN = math.nan
WAYPOINT = MissionItem(6, 16, 0, 1, 0.0, 0.5, 0.0, NAN, 556985000, 373595000, 5.0)


def plan(count: int, seed: int = 1) -> list[MissionItem]:
    """Waypoints whose every field differs, exact in single precision."""
    r = random.Random(seed)

    def real(low: float, high: float) -> float:
        return round(r.uniform(low, high) * 1024) / 1024

    return [
        MissionItem(
            frame=r.choice((0, 3, 5, 6, 1)),
            command=16,
            current=int(k == 0),
            autocontinue=r.choice((0, 1)),
            param1=real(0, 100),
            param2=real(0, 10),
            param3=0.0,
            param4=r.choice((NAN, real(0, 360))),
            x=r.randint(-80_000_000, 80_000_000),
            y=r.randint(-80_000_000, 80_000_000),
            z=real(-50, 50),
        )
        for k in range(count)
    ]


def same(a: Any, b: Any) -> bool:
    """Field for field, not-a-number counting as equal to itself."""
    return len(a) == len(b) and all(repr(x) == repr(y) for x, y in zip(a, b, strict=True))


LINKS = {
    "perfect": {},
    "losing a fifth": {"drop": 0.2},
    "reordering and doubling": {"duplicate": 0.3, "jitter_s": 0.08},
    "all of it": {"drop": 0.2, "duplicate": 0.2, "jitter_s": 0.08},
}


def station_over(world: World, link: str) -> Station:
    station = world.station(up=Wire(seed=11, **LINKS[link]), down=Wire(seed=12, **LINKS[link]), greeting=False)
    world.run(0.1)
    return station


@pytest.mark.parametrize("link", LINKS)
def test_five_hundred_items_go_up_and_come_down_verbatim(world: World, link: str) -> None:
    world.speed = 0.0
    station, items = station_over(world, link), plan(500)
    ack = Uploader(station, items).finish(world, 600.0)
    assert ack.type == ACCEPTED
    assert same(world.vehicle.mission.items, items)
    downloader = Downloader(station)
    assert same(downloader.finish(world, 600.0), items)
    assert downloader.count.opaque_id == world.vehicle.mission.plan_id == ack.opaque_id != 0


def test_five_hundred_items_take_one_round_trip_each(world: World) -> None:
    """At 10 ms a turn: what the endpoint waits for is only the other side."""
    station = world.station()
    start_s = world.wall_s
    Uploader(station, plan(500)).finish(world, 20.0)
    assert world.wall_s - start_s <= 502 * 0.01
    start_s = world.wall_s
    Downloader(station).finish(world, 20.0)
    assert world.wall_s - start_s <= 503 * 0.01


def test_items_are_asked_for_in_their_integer_form_one_after_the_other(world: World) -> None:
    station = world.station()
    uploader = Uploader(station, plan(5))
    uploader.finish(world, 1.0)
    assert uploader.asked == [0, 1, 2, 3, 4]
    assert station.all("MISSION_REQUEST") == []


def test_an_unanswered_request_is_repeated_and_given_up_after_a_while(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace([WAYPOINT])
    station.send("MISSION_COUNT", target_system=1, target_component=1, count=3)
    world.run(1.02)
    assert [m.seq for m in station.all("MISSION_REQUEST_INT")] == [0, 0, 0, 0, 0]
    assert station.all("MISSION_ACK") == []
    world.run(GIVE_UP_S)
    assert [m.type for m in station.all("MISSION_ACK")] == [CANCELLED]
    assert any("timed out" in text for text in station.texts())
    assert same(world.vehicle.mission.items, [WAYPOINT])
    station.forget()
    world.run(2.0)
    assert station.all("MISSION_REQUEST_INT") == []


def test_repetitions_keep_to_wall_time_while_the_simulation_stands(world: World) -> None:
    station = world.station()
    world.speed = 0.0
    station.send("MISSION_COUNT", target_system=1, target_component=1, count=3)
    world.run(1.02)
    assert len(station.all("MISSION_REQUEST_INT")) == 5


def test_the_old_plan_stands_until_the_last_item_has_come(world: World) -> None:
    station, old, new = world.station(), plan(3, seed=1), plan(4, seed=2)
    Uploader(station, old).finish(world, 1.0)
    station.react = None
    station.send("MISSION_COUNT", target_system=1, target_component=1, count=4)
    for seq in range(3):
        world.run(0.05)
        send_item(station, seq, new[seq])
    world.run(0.05)
    assert same(world.vehicle.mission.items, old)
    send_item(station, 3, new[3])
    world.run(0.05)
    assert same(world.vehicle.mission.items, new)


def test_a_cancelled_upload_leaves_the_old_plan_whole(world: World) -> None:
    station, old, new = world.station(), plan(3, seed=1), plan(4, seed=2)
    Uploader(station, old).finish(world, 1.0)
    station.react = None
    station.send("MISSION_COUNT", target_system=1, target_component=1, count=4)
    world.run(0.05)
    send_item(station, 0, new[0])
    world.run(0.05)
    station.send("MISSION_ACK", target_system=1, target_component=1, type=CANCELLED)
    world.run(0.05)
    station.forget()
    send_item(station, 1, new[1])
    world.run(6.0)
    assert station.all("MISSION_REQUEST_INT") == station.all("MISSION_ACK") == []
    assert same(world.vehicle.mission.items, old)


BAD = {
    "frame": (WAYPOINT._replace(frame=9), UNSUPPORTED_FRAME),
    "command": (WAYPOINT._replace(command=2000), UNSUPPORTED),
    "param1": (WAYPOINT._replace(param1=-5.0), INVALID_PARAM1),
    "param2": (WAYPOINT._replace(param2=math.inf), 7),
    "param3": (WAYPOINT._replace(param3=1e6), 8),
    "param4": (WAYPOINT._replace(param4=math.inf), 9),
    "param5": (WAYPOINT._replace(x=950_000_000), 10),
    "param6": (WAYPOINT._replace(y=1_900_000_000), 11),
    "param7": (WAYPOINT._replace(z=NAN), 12),
}


@pytest.mark.parametrize("field", BAD)
def test_a_bad_item_is_refused_by_field_and_named_by_number(world: World, field: str) -> None:
    station, (item, result) = world.station(), BAD[field]
    world.vehicle.mission.replace([WAYPOINT])
    ack = Uploader(station, [WAYPOINT, WAYPOINT, item, WAYPOINT]).finish(world, 1.0)
    world.run(0.02)
    assert ack.type == result
    assert any(text.startswith(f"Item 2, {field} refused:") for text in station.texts())
    assert same(world.vehicle.mission.items, [WAYPOINT])


def test_speed_changes_without_an_altitude_are_taken_as_mavsdk_sends_them(world: World) -> None:
    speed = MissionItem(2, 178, 0, 1, 1.0, 2.0, -1.0, 0.0, 0, 0, NAN)
    ack = Uploader(world.station(), [WAYPOINT, speed]).finish(world, 1.0)
    assert ack.type == ACCEPTED
    assert same(world.vehicle.mission.items[1], speed)


def test_more_items_than_there_is_room_for_are_refused_at_once(world: World) -> None:
    station = world.station()
    station.send("MISSION_COUNT", target_system=1, target_component=1, count=CAPACITY + 1)
    world.run(0.05)
    assert [m.type for m in station.all("MISSION_ACK")] == [NO_SPACE]
    assert station.all("MISSION_REQUEST_INT") == []


def test_an_upload_of_nothing_empties_the_plan(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace([WAYPOINT])
    assert Uploader(station, []).finish(world, 1.0).type == ACCEPTED
    assert world.vehicle.mission.items == ()


def test_a_second_writer_is_denied_while_the_first_goes_on(world: World) -> None:
    first, second = world.station(), world.station()
    uploader = Uploader(first, plan(20))
    uploader.start()
    world.run(0.05)
    assert Uploader(second, plan(3, seed=9)).finish(world, 1.0).type == DENIED
    second.react = None
    second.send("MISSION_CLEAR_ALL", target_system=1, target_component=1)
    world.run(0.02)
    assert [m.type for m in second.all("MISSION_ACK")] == [DENIED, DENIED]
    world.run_until(lambda: uploader.result is not None, 2.0)
    assert uploader.result.type == ACCEPTED
    assert len(world.vehicle.mission.items) == 20


def test_a_writer_that_disappears_frees_the_place_after_a_while(world: World) -> None:
    first, second = world.station(), world.station()
    first.send("MISSION_COUNT", target_system=1, target_component=1, count=3)
    world.run(GIVE_UP_S + 0.1)
    assert Uploader(second, plan(3)).finish(world, 1.0).type == ACCEPTED


def test_another_component_at_the_same_address_is_another_writer(world: World) -> None:
    station = world.station()
    station.send("MISSION_COUNT", target_system=1, target_component=1, count=3)
    station.encoder.component = 191
    world.run(0.05)
    station.send("MISSION_COUNT", target_system=1, target_component=1, count=3)
    world.run(0.05)
    assert [(m.type, m.target_component) for m in station.all("MISSION_ACK")] == [(DENIED, 191)]


def test_a_repeated_count_starts_the_upload_over(world: World) -> None:
    station, items = world.station(), plan(5)
    uploader = Uploader(station, items)
    uploader.start()
    world.run(0.03)
    uploader.start()
    world.run_until(lambda: uploader.result is not None, 2.0)
    assert same(world.vehicle.mission.items, items)


def test_a_lost_acknowledgement_is_sent_again_for_the_last_item(world: World) -> None:
    station, items = world.station(), plan(3)
    Uploader(station, items).finish(world, 1.0)
    station.react = None
    station.forget()
    send_item(station, 2, items[2])
    world.run(0.05)
    [ack] = station.all("MISSION_ACK")
    assert (ack.type, ack.opaque_id) == (ACCEPTED, world.vehicle.mission.plan_id)


def test_stray_items_and_acknowledgements_do_nothing(world: World) -> None:
    station = world.station()
    station.forget()
    send_item(station, 0, WAYPOINT)
    station.send("MISSION_ACK", target_system=1, target_component=1)
    world.run(0.1)
    assert world.vehicle.mission.items == ()
    assert station.all("MISSION_ACK") == []


def test_items_in_the_old_float_form_are_taken_too(world: World) -> None:
    station = world.station()
    station.send("MISSION_COUNT", target_system=1, target_component=1, count=2)
    world.run(0.05)
    address = {"target_system": 1, "target_component": 1}
    station.send("MISSION_ITEM", **address, seq=0, frame=3, command=16, x=55.5, y=37.25, z=5.0)
    world.run(0.05)
    station.send("MISSION_ITEM", **address, seq=1, frame=1, command=16, x=2.5, y=-1.5, z=-5.0)
    world.run(0.05)
    assert [m.type for m in station.all("MISSION_ACK")] == [ACCEPTED]
    first, second = world.vehicle.mission.items
    assert (first.x, first.y) == (555_000_000, 372_500_000)
    assert (second.x, second.y) == (25_000, -15_000)


def test_an_empty_plan_comes_down_as_a_count_of_nothing(world: World) -> None:
    station = world.station()
    assert Downloader(station).finish(world, 1.0) == []
    assert station.all("MISSION_COUNT")[0].count == 0


def test_a_count_of_nothing_is_not_repeated_for_those_who_do_not_acknowledge_it(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace(plan(3))
    station.send("MISSION_REQUEST_LIST", target_system=1, target_component=1)
    world.step()
    world.vehicle.mission.replace(())
    station.forget()
    station.send("MISSION_REQUEST_LIST", target_system=1, target_component=1)
    world.run(2.0)
    assert [m.count for m in station.all("MISSION_COUNT")] == [0]


def test_a_download_repeats_its_last_word_until_it_is_given_up(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace(plan(3))
    station.send("MISSION_REQUEST_LIST", target_system=1, target_component=1)
    world.run(0.6)
    assert len(station.all("MISSION_COUNT")) == 3
    station.send("MISSION_REQUEST_INT", target_system=1, target_component=1, seq=0)
    world.run(0.6)
    assert [m.seq for m in station.all("MISSION_ITEM_INT")] == [0, 0, 0]
    world.run(GIVE_UP_S)
    station.forget()
    world.run(1.0)
    assert station.all("MISSION_ITEM_INT") == []


def test_a_slow_reader_is_not_given_up_while_it_keeps_asking(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace(plan(4))
    station.send("MISSION_REQUEST_LIST", target_system=1, target_component=1)
    for seq in range(4):
        world.run(2.0)
        station.forget()
        station.send("MISSION_REQUEST_INT", target_system=1, target_component=1, seq=seq)
    world.run(0.6)
    assert [m.seq for m in station.all("MISSION_ITEM_INT")] == [3, 3, 3]


def test_a_download_ends_with_its_acknowledgement(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace(plan(3))
    Downloader(station).finish(world, 1.0)
    world.run(0.05)
    station.forget()
    world.run(1.0)
    assert station.all("MISSION_ITEM_INT") == []


def test_a_download_goes_on_with_the_plan_it_began_with(world: World) -> None:
    station, old, new = world.station(), plan(3, seed=1), plan(3, seed=2)
    world.vehicle.mission.replace(old)
    address = {"target_system": 1, "target_component": 1}
    station.send("MISSION_REQUEST_LIST", **address)
    world.run(0.03)
    world.vehicle.mission.replace(new)
    for seq in range(3):
        station.send("MISSION_REQUEST_INT", **address, seq=seq)
        world.run(0.03)
    assert same([item_of(m) for m in station.all("MISSION_ITEM_INT")], old)


def test_two_stations_download_at_the_same_time(world: World) -> None:
    items = plan(20)
    world.vehicle.mission.replace(items)
    one, two = Downloader(world.station()), Downloader(world.station())
    one.ask(), two.ask()
    world.run_until(lambda: one.complete and two.complete, 2.0)
    assert same(one.items, items)
    assert same(two.items, items)


def test_the_old_request_is_answered_with_the_integer_form(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace(plan(3))
    station.send("MISSION_REQUEST_LIST", target_system=1, target_component=1)
    world.run(0.03)
    station.send("MISSION_REQUEST", target_system=1, target_component=1, seq=1)
    world.run(0.03)
    assert [m.seq for m in station.all("MISSION_ITEM_INT")] == [1]


def test_an_item_beyond_the_plan_is_an_invalid_sequence(world: World) -> None:
    station = world.station()
    world.vehicle.mission.replace(plan(3))
    for opened in (False, True):
        if opened:
            station.send("MISSION_REQUEST_LIST", target_system=1, target_component=1)
        station.send("MISSION_REQUEST_INT", target_system=1, target_component=1, seq=3)
        world.run(0.03)
    assert [m.type for m in station.all("MISSION_ACK")] == [INVALID_SEQUENCE] * 2


def test_clearing_empties_the_plan(world: World) -> None:
    station = world.station()
    for kind in (0, 255):
        world.vehicle.mission.replace(plan(3))
        station.forget()
        station.send("MISSION_CLEAR_ALL", target_system=1, target_component=1, mission_type=kind)
        world.run(0.03)
        assert [(m.type, m.mission_type) for m in station.all("MISSION_ACK")] == [(ACCEPTED, kind)]
        assert world.vehicle.mission.items == ()


def test_plan_types_that_are_not_defined_are_unsupported(world: World) -> None:
    station = world.station()
    for name in ("MISSION_COUNT", "MISSION_CLEAR_ALL"):
        station.send(name, target_system=1, target_component=1, mission_type=77)
    world.run(0.05)
    assert [m.type for m in station.all("MISSION_ACK")] == [UNSUPPORTED, UNSUPPORTED]


@pytest.mark.parametrize("name", ["MISSION_REQUEST_PARTIAL_LIST", "MISSION_WRITE_PARTIAL_LIST"])
def test_partial_lists_are_unsupported(world: World, name: str) -> None:
    station = world.station()
    station.send(name, target_system=1, target_component=1, start_index=0, end_index=1)
    world.run(0.05)
    assert [m.type for m in station.all("MISSION_ACK")] == [UNSUPPORTED]


def test_the_current_item_is_set_by_message_and_told_to_all(world: World) -> None:
    one, two = world.station(), world.station()
    world.vehicle.mission.replace(plan(4))
    world.run(0.02)
    one.forget(), two.forget()
    one.send("MISSION_SET_CURRENT", target_system=1, target_component=1, seq=2)
    world.run(0.05)
    for station in (one, two):
        assert next(m.seq for m in station.all("MISSION_CURRENT")) == 2
    one.send("MISSION_SET_CURRENT", target_system=1, target_component=1, seq=9)
    world.run(0.05)
    assert world.vehicle.mission.current == 2
    assert any("9" in text for text in one.texts())


def test_a_new_plan_is_told_to_every_peer_with_its_id(world: World) -> None:
    one, two = world.station(), world.station()
    ack = Uploader(one, plan(3)).finish(world, 1.0)
    world.run(0.02)
    assert two.all("MISSION_CURRENT")[-1].mission_id == ack.opaque_id
    assert two.all("MISSION_CURRENT")[-1].total == 3


@pytest.mark.compiled
def test_a_flown_mission_reports_each_item_once(world: World) -> None:
    station = world.station()
    takeoff = MissionItem(1, 22, 1, 1, 0.0, 0.0, 0.0, NAN, 0, 0, -2.0)
    points = [WAYPOINT._replace(frame=1, x=20_000 * k, y=0, z=-2.0) for k in (1, 2)]
    land = MissionItem(1, 21, 0, 1, 0.0, 0.0, 0.0, NAN, 40_000, 0, 0.0)
    assert Uploader(station, [takeoff, *points, land]).finish(world, 1.0).type == ACCEPTED
    station.react = None
    assert station.ask(mav.MAV_CMD_MISSION_START) == [0]
    assert station.ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [0]
    world.speed = 10.0
    world.run_until(lambda: not world.vehicle.commander.armed, 20.0)
    reached = [m.seq for m in station.all("MISSION_ITEM_REACHED")]
    assert reached == sorted(set(reached))
    assert {0, 1, 2} <= set(reached)
    current = [m.seq for m in station.all("MISSION_CURRENT")]
    assert current == sorted(current)
