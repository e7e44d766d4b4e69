"""Fence and rally points over the transfer that missions take, and what the link tells of them."""

import math
from typing import Any

import pytest
from mavlink_pair import STEP_S, Downloader, Uploader, World
from test_link_missions import ACCEPTED, DENIED, INVALID_PARAM1, LINKS, NO_SPACE, UNSUPPORTED, plan, same, station_over

from sitl.geodesy import to_global
from sitl.mavlink.codec import mav
from sitl.onboard.plan import CAPACITY, MissionItem
from sitl.vehicle import DEFAULT_HOME

FENCE, RALLY = 1, 2
INVALID = 5
NAN = math.nan


def fence_item(command: int, param1: float, north: float, east: float) -> MissionItem:
    lat, lon = to_global(DEFAULT_HOME, north, east)
    return MissionItem(0, command, 0, 1, param1, 0.0, 0.0, 0.0, round(lat * 1e7), round(lon * 1e7), 0.0, FENCE)


def ring(corners: int, radius: float, command: int = 5001) -> list[MissionItem]:
    angles = (2.0 * math.pi * k / corners for k in range(corners))
    return [fence_item(command, float(corners), radius * math.cos(a), radius * math.sin(a)) for a in angles]


def rally(count: int) -> list[MissionItem]:
    item = MissionItem(6, 5100, 0, 1, 0.0, 0.0, 0.0, 0.0, 556985000, 373595000, 25.0, RALLY)
    return [item._replace(x=item.x + 100 * k) for k in range(count)]


PLANS = {
    "mission": (0, plan(150)),
    "fence": (FENCE, [*ring(149, 50.0), fence_item(5003, 60.0, 0.0, 0.0)]),
    "rally": (RALLY, rally(150)),
}


@pytest.mark.parametrize("link", ["perfect", "all of it"])
@pytest.mark.parametrize("name", PLANS)
def test_every_kind_of_plan_goes_up_and_comes_down_verbatim_with_its_id(world: World, name: str, link: str) -> None:
    world.speed = 0.0
    kind, items = PLANS[name]
    station = station_over(world, link)
    ack = Uploader(station, items, kind).finish(world, 600.0)
    assert (ack.type, ack.mission_type) == (ACCEPTED, kind)
    downloader = Downloader(station, kind)
    assert same(downloader.finish(world, 600.0), items)
    assert downloader.count.opaque_id == ack.opaque_id != 0


def test_three_plans_stand_side_by_side_and_their_ids_are_told(world: World) -> None:
    station, other = world.station(), world.station()
    ids = [Uploader(station, items, kind).finish(world, 60.0).opaque_id for kind, items in PLANS.values()]
    world.run(0.05)
    current = other.all("MISSION_CURRENT")[-1]
    assert [current.mission_id, current.fence_id, current.rally_points_id] == ids
    station.react = None
    station.send("MISSION_CLEAR_ALL", target_system=1, target_component=1, mission_type=FENCE)
    world.run(0.05)
    current = other.all("MISSION_CURRENT")[-1]
    assert [current.mission_id, current.fence_id, current.rally_points_id] == [ids[0], 0, ids[2]]


def test_clearing_all_types_clears_all_three(world: World) -> None:
    station = world.station()
    for kind, items in PLANS.values():
        Uploader(station, items, kind).finish(world, 60.0)
    station.react = None
    station.forget()
    station.send("MISSION_CLEAR_ALL", target_system=1, target_component=1, mission_type=255)
    world.run(0.05)
    assert [m.type for m in station.all("MISSION_ACK")] == [ACCEPTED]
    plans = world.vehicle.plans
    assert [plans.mission.items, plans.fence.items, plans.rally.items] == [(), (), ()]


@pytest.mark.parametrize(
    ("kind", "items", "result", "text"),
    [
        (FENCE, ring(3, 50.0)[:2], INVALID_PARAM1, "Item 0, param1"),
        (FENCE, [fence_item(5004, 20.0, 5.0, 0.0)], INVALID, "home"),
        (FENCE, [fence_item(16, 0.0, 0.0, 0.0)], UNSUPPORTED, "not supported in a fence"),
        (RALLY, [rally(1)[0]._replace(command=16)], UNSUPPORTED, "not supported in a list of rally points"),
        (RALLY, [rally(1)[0]._replace(z=NAN)], 12, "altitude"),
    ],
)
def test_a_plan_that_is_wrong_is_refused_with_item_and_reason_and_the_old_one_stays(
    world: World, kind: int, items: list[MissionItem], result: int, text: str
) -> None:
    station = world.station()
    old = ring(4, 30.0) if kind == FENCE else rally(2)
    assert Uploader(station, old, kind).finish(world, 5.0).type == ACCEPTED
    assert Uploader(station, items, kind).finish(world, 5.0).type == result
    world.run(0.05)
    assert any(text in told for told in station.texts())
    assert same(Downloader(station, kind).finish(world, 5.0), old)


@pytest.mark.parametrize("kind", [FENCE, RALLY])
def test_more_than_there_is_room_for_is_refused_at_the_count(world: World, kind: int) -> None:
    station = world.station()
    station.send("MISSION_COUNT", target_system=1, target_component=1, count=CAPACITY + 1, mission_type=kind)
    world.run(0.05)
    assert [(m.type, m.mission_type) for m in station.all("MISSION_ACK")] == [(NO_SPACE, kind)]


def test_one_writer_at_a_time_whatever_kind_of_plan_it_writes(world: World) -> None:
    one, two = world.station(), world.station()
    one.send("MISSION_COUNT", target_system=1, target_component=1, count=3, mission_type=0)
    world.run(0.05)
    two.send("MISSION_COUNT", target_system=1, target_component=1, count=3, mission_type=FENCE)
    world.run(0.05)
    assert [(m.type, m.mission_type) for m in two.all("MISSION_ACK")] == [(DENIED, FENCE)]


def test_a_thousand_items_go_up_and_down_at_one_turn_of_the_link_each(world: World) -> None:
    station, items = world.station(), plan(1000)
    for exchange in (lambda: Uploader(station, items), lambda: Downloader(station)):
        start_s = world.wall_s
        exchange().finish(world, 30.0)
        assert world.wall_s - start_s <= 1002 * STEP_S + 0.1  # the vehicle answers within the turn
    assert same(world.vehicle.mission.items, items)


def test_a_thousand_items_survive_the_worst_link_that_is_promised(world: World) -> None:
    """A fifth lost, one in twenty doubled, delays of up to 100 ms that reorder."""
    world.speed = 0.0
    LINKS["promised"] = {"drop": 0.2, "duplicate": 0.05, "jitter_s": 0.1}
    station, items = station_over(world, "promised"), plan(1000)
    assert Uploader(station, items).finish(world, 1200.0).type == ACCEPTED
    assert same(Downloader(station).finish(world, 1200.0), items)


# the fence on the link


def driven_out(world: World) -> Any:
    station = world.station()
    assert Uploader(station, ring(8, 6.0), FENCE).finish(world, 5.0).type == ACCEPTED
    station.react = None
    world.take_off(station)
    assert station.ask(mav.MAV_CMD_DO_SET_MODE, 1, 3) == [ACCEPTED]
    station.forget()
    world.speed = 10.0
    for _ in range(150):
        station.send("MANUAL_CONTROL", target=1, x=1000, y=0, z=500, r=0)
        world.step()
        if world.vehicle.commander.geofence.breach.outside:
            break
    return station


@pytest.mark.compiled
def test_a_breach_is_told_by_text_fence_status_and_system_status(world: World) -> None:
    station = driven_out(world)
    world.run(0.5)
    assert [text for text in station.texts() if "fence breached" in text] == [
        "fence breached: outside the polygon of fence item 0: hold"
    ]
    status = next(m for m in station.all("FENCE_STATUS") if m.breach_status)
    assert (status.breach_count, status.breach_type) == (1, mav.FENCE_BREACH_BOUNDARY)
    assert 0 < status.breach_time <= world.vehicle.now_us // 1000
    bit = mav.MAV_SYS_STATUS_GEOFENCE
    health = station.all("SYS_STATUS")[-1]
    assert health.onboard_control_sensors_present & bit
    assert not health.onboard_control_sensors_health & bit
    assert world.vehicle.commander.failsafe


def test_capabilities_claim_fence_and_rally(world: World) -> None:
    station = world.station()
    station.ask(mav.MAV_CMD_REQUEST_MESSAGE, 148)
    bits = mav.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE | mav.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    assert station.all("AUTOPILOT_VERSION")[-1].capabilities & bits == bits
