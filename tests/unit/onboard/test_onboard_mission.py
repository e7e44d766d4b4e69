"""The stored mission: what is checked, and that it is replaced as a whole or not at all."""

import math

import pytest
from onboard_flights import NAN, FailingStore, item, texts

from sitl.onboard.events import EventLog
from sitl.onboard.mission import Mission, MissionState
from sitl.onboard.mission_items import ItemCommand
from sitl.onboard.modes import EventKind, Verdict
from sitl.onboard.plan import CAPACITY, Fault, Frame, MissionItem
from sitl.onboard.store import FolderStore, MemoryStore, Store

C = ItemCommand
UP = (0.0, 0.0, -5.0)
PLAN = (
    item(C.TAKEOFF, UP),
    item(C.WAYPOINT, (5.0, 0.0, -5.0), p1=1.0),
    item(C.DO_CHANGE_SPEED, p2=2.0, z=NAN),
    item(C.LAND, UP),
)


def mission(store: Store | None = None, events: EventLog | None = None) -> Mission:
    return Mission(store or MemoryStore(), events or EventLog())


@pytest.mark.parametrize(
    ("bad", "field"),
    [
        (item(C.WAYPOINT, UP, frame=9), "frame"),
        (item(C.WAYPOINT, UP, frame=300), "frame"),
        (item(C.WAYPOINT, UP, frame=Frame.MISSION), "frame"),
        (item(C.WAYPOINT, UP)._replace(command=999), "command"),
        (item(C.WAYPOINT, UP)._replace(command=-1), "command"),
        (item(C.WAYPOINT, UP, p1=-1.0), "param1"),
        (item(C.WAYPOINT, UP, p1=math.inf), "param1"),
        (item(C.WAYPOINT, UP, p1=1e39), "param1"),
        (item(C.WAYPOINT, UP, p2=-0.1), "param2"),
        (item(C.WAYPOINT, UP, p3=2000.0), "param3"),
        (item(C.WAYPOINT, UP, p4=-math.inf), "param4"),
        (item(C.WAYPOINT, UP, x=2_000_000_000), "param5"),
        (item(C.WAYPOINT, UP, x=2**31), "param5"),
        (item(C.WAYPOINT, UP, frame=Frame.GLOBAL_INT, x=900_000_001), "param5"),
        (item(C.WAYPOINT, UP, y=-200_000_000), "param6"),
        (item(C.WAYPOINT, UP, frame=Frame.GLOBAL_INT, y=1_800_000_001), "param6"),
        (item(C.WAYPOINT, UP, y=-(2**31) - 1), "param6"),
        (item(C.WAYPOINT, UP, z=NAN), "param7"),
        (item(C.WAYPOINT, UP, z=-20_000.0), "param7"),
        (item(C.TAKEOFF, (0.0, 0.0, 0.0)), "param7"),
        (item(C.TAKEOFF, (0.0, 0.0, 3.0)), "param7"),
        (item(C.VTOL_TAKEOFF, UP, frame=Frame.GLOBAL_RELATIVE_ALT_INT, z=0.1), "param7"),
        (item(C.LOITER_TIME, UP, p1=NAN), "param1"),
        (item(C.LOITER_TURNS, UP, p1=101.0), "param1"),
        (item(C.DELAY, p1=-1.0), "param1"),
        (item(C.CONDITION_DELAY, p1=NAN), "param1"),
        (item(C.CONDITION_DISTANCE, p1=-3.0), "param1"),
        (item(C.CONDITION_YAW, p1=400.0), "param1"),
        (item(C.DO_CHANGE_SPEED, p1=3.0, p2=1.0), "param1"),
        (item(C.DO_CHANGE_SPEED, p2=60.0), "param2"),
        (item(C.DO_SET_HOME, p1=0.0), "frame"),
        (item(C.DO_VTOL_TRANSITION, p1=4.0), "param1"),
        (item(C.DO_JUMP, p1=7.0, p2=1.0), "param1"),
        (item(C.DO_JUMP, p1=0.5, p2=1.0), "param1"),
        (item(C.DO_JUMP, p1=NAN, p2=1.0), "param1"),
        (item(C.DO_JUMP, p1=0.0, p2=-2.0), "param2"),
        (item(C.DO_JUMP, p1=2.0, p2=-1.0), "param1"),
        (item(C.RETURN_TO_LAUNCH, p1=7.0), "param1"),
        (item(C.CONDITION_DELAY, p1=1.0, p3=2.0), "param3"),
        (item(C.WAYPOINT, UP, autocontinue=256), "total"),
        (item(C.WAYPOINT, UP, mission_type=-1), "total"),
        (item(C.WAYPOINT, UP, current=1000), "total"),
    ],
)
def test_a_fault_names_the_item_and_the_field_and_leaves_the_old_plan_whole(bad: MissionItem, field: str) -> None:
    store = MemoryStore()
    m = mission(store)
    assert m.replace(PLAN) is None
    identity, stored = m.plan_id, store.read("mission.json")
    fault = m.replace((PLAN[0], PLAN[1], bad))
    assert fault is not None
    assert (fault.index, fault.field) == (2, field)
    assert fault.reason
    assert (m.items, m.plan_id, store.read("mission.json")) == (PLAN, identity, stored)


def test_more_items_than_there_is_room_for_are_refused() -> None:
    fault = mission().check((PLAN[1],) * (CAPACITY + 1))
    assert fault == Fault(CAPACITY, "total", f"more than {CAPACITY} items")


@pytest.mark.parametrize("command", sorted(ItemCommand))
def test_every_supported_command_is_accepted_in_a_sensible_form(command: ItemCommand) -> None:
    p1 = {C.DO_VTOL_TRANSITION: 3.0, C.DO_SET_HOME: 1.0}.get(command, 0.0)
    assert mission().replace((item(C.WAYPOINT, UP), item(command, UP, p1=p1))) is None


def test_a_plan_comes_back_verbatim_after_a_restart(tmp_path) -> None:
    one = mission(FolderStore(tmp_path))
    assert one.replace(PLAN) is None
    two = mission(FolderStore(tmp_path))
    assert repr(two.items) == repr(PLAN)  # NaN is not equal to itself
    assert two.plan_id == one.plan_id != 0
    assert (two.state, two.current) == (MissionState.NOT_STARTED, 0)


def test_different_plans_have_different_ids_and_an_empty_one_has_none() -> None:
    m, identities = mission(), set()
    for plan in (PLAN, PLAN[:2], PLAN[::-1], (PLAN[0], PLAN[1]._replace(z=-5.5))):
        assert m.replace(plan) is None
        identities.add(m.plan_id)
    assert len(identities) == 4
    assert m.clear() is None
    assert (m.items, m.plan_id, m.state) == ((), 0, MissionState.NO_MISSION)


def test_a_plan_that_cannot_be_saved_is_a_fault_and_so_is_clearing() -> None:
    store, events = FailingStore(), EventLog()
    m = mission(store, events)
    assert m.replace(PLAN) is None
    store.writable = False
    assert m.replace(PLAN[:1]) == Fault(0, "total", "not saved: No space left on device")
    assert m.clear() == Fault(0, "total", "not saved: No space left on device")
    assert m.items == PLAN
    assert [e.value for e in events.since(0) if e.kind is EventKind.PLAN] == [4]


@pytest.mark.parametrize(
    "damage",
    [
        b"[[",
        b"{}",
        b"[[1,2,3]]",
        b'[["x"]]',
        b"[[1,16,0,1,0,0,0,0,0,0,null]]",
        b"[[1,16,0,1,0,0,0,0,null,0,-5.0]]",
        b"[[1,16,0,1,0,0,0,0,1e300,0,-5.0]]",
        b"[[1,16,0,300,0,0,0,0,0,0,-5.0]]",
    ],
)
def test_a_damaged_plan_is_set_aside_at_start(damage: bytes) -> None:
    store, events = MemoryStore(), EventLog()
    store.write("mission.json", damage)
    assert mission(store, events).state is MissionState.NO_MISSION
    assert store.read("mission.json.damaged") == damage
    assert texts(events)[0].startswith("stored mission damaged: set aside")


@pytest.mark.parametrize("stored", [b"[]", b"{"])
def test_a_plan_that_cannot_be_read_or_set_aside_does_not_keep_the_vehicle_from_starting(stored: bytes) -> None:
    store, events = FailingStore(), EventLog()
    store.write("mission.json", stored)
    store.writable = store.readable = False
    assert mission(store, events).items == ()
    store.readable = True
    assert mission(store, events).items == ()
    assert texts(events)[0] == "stored mission not readable (Permission denied)"


def test_only_an_item_that_exists_can_be_made_current() -> None:
    m = mission()
    m.replace(PLAN)
    assert m.set_current(3).ok
    assert m.current == 3
    for index in (-1, 4):
        outcome = m.set_current(index)
        assert outcome.verdict is Verdict.DENIED
        assert "there are 4" in outcome.reason
    assert m.current == 3


def test_a_completed_mission_counts_as_not_started_once_an_item_is_chosen() -> None:
    m = mission()
    m.replace(PLAN)
    m.state = MissionState.COMPLETE
    m.set_current(0)
    assert m.state is MissionState.NOT_STARTED
    m.state = MissionState.PAUSED
    m.set_current(1)
    assert m.state is MissionState.PAUSED
    m.set_current(1, reset=True)
    assert m.state is MissionState.NOT_STARTED
