"""A file's mission, fence and rally points handed over to the vehicle: all of them, or none."""

from pathlib import Path
from typing import Any

import pytest

from gcs_tools import commands, timeline, yaml_plan
from gcs_tools import plan as plans
from gcs_tools.client import Client, LinkError, Script
from gcs_tools.convert import convert
from gcs_tools.download import download
from gcs_tools.flight import Flight
from gcs_tools.lockstep import Lockstep
from gcs_tools.plan import Home, Item, Plan, Uploaded
from gcs_tools.upload import FENCE, MISSION, RALLY, hand_over
from sitl.mavlink.wire import float32
from sitl.vehicle import DEFAULT_HOME, Vehicle
from sitl.vehicle_spec import VehicleSpec

FENCED = Path(__file__).parents[2] / "missions" / "rectangle-fenced.yaml"
ITEMS = "items:\n  - {do: takeoff, at_m: [0, 0, -5]}\n  - {do: waypoint, at_m: [20, 0, -5]}\n"
ROOM = "fence:\n  - {stay: inside, centre_m: [0, 0], radius_m: 30.3}\nrally:\n  - {at_m: [1, 2, -3]}\n"


def mission(text: str) -> Uploaded:
    found = yaml_plan.loads(f"name: test\nkind: mission\n{text}", "test.yaml")
    assert isinstance(found, Uploaded)
    return found


class Desk:
    """A client and the vehicle, which take turns."""

    def __init__(self, spec: VehicleSpec) -> None:
        self.vehicle, self.client = Vehicle(spec), Client()
        self._link = Lockstep(self.vehicle)

    def finish(self, limit_s: float = 60.0) -> Any:
        client, end_us = self.client, self.vehicle.now_us + round(limit_s * 1e6)
        while not client.finished:
            assert self.vehicle.now_us < end_us
            self._link.turn(client)
        if client.fault is not None:
            raise client.fault
        return client.result

    def run(self, talk: Script[Any]) -> Any:
        def script() -> Script[Any]:
            yield from self.client.connect()
            return (yield from talk)

        self.client.start(script())
        return self.finish()

    def hand_over(self, plan: Plan) -> Any:
        return self.run(hand_over(self.client, plan))

    def stored(self) -> tuple[tuple[Any, ...], ...]:
        p = self.vehicle.plans
        return p.mission.items, p.fence.items, p.rally.items


@pytest.fixture
def desk(spec: VehicleSpec) -> Desk:
    return Desk(spec)


def as_carried(item: Item) -> Item:
    return item._replace(**{name: float32(getattr(item, name)) for name in ("param1", "param2", "param4", "z")})


@pytest.mark.parametrize("ending", ["yaml", "plan"])
def test_what_a_file_says_is_on_the_vehicle_verbatim(desk: Desk, ending: str, tmp_path: Path) -> None:
    plan = plans.load(FENCED)
    if ending == "plan":
        convert(plan, tmp_path / "f.plan", Home(*DEFAULT_HOME))
        plan = plans.load(tmp_path / "f.plan")
    assert isinstance(plan, Uploaded)
    told = desk.hand_over(plan)
    assert told == ["5 fence items uploaded", "1 rally point uploaded", "5 mission items uploaded"]
    for kind, items in ((MISSION, plan.items), (FENCE, plan.fence), (RALLY, plan.rally)):
        assert items is not None
        before_us = desk.vehicle.now_us
        back = desk.run(download(desk.client, kind))
        assert desk.vehicle.now_us - before_us < 300_000  # a turn for each item, no repetitions
        assert str(back) == str(tuple(map(as_carried, items)))


def test_a_yaml_file_without_the_keys_leaves_fence_and_rally_points_alone(desk: Desk) -> None:
    desk.hand_over(mission(ROOM + ITEMS))
    _, fence, rally = desk.stored()
    assert desk.hand_over(mission(ITEMS)) == ["2 mission items uploaded"]
    assert desk.stored()[1:] == (fence, rally)
    assert len(fence) == len(rally) == 1


def test_a_plan_of_qgroundcontrol_without_fence_clears_the_vehicles(desk: Desk) -> None:
    desk.hand_over(mission(ROOM + ITEMS))
    empty = plans.load(FENCED.with_name("rectangle-mission.plan"))
    assert desk.hand_over(empty) == ["fence cleared", "rally points cleared", "7 mission items uploaded"]
    assert desk.stored()[1:] == ((), ())


def test_what_the_vehicle_has_already_is_not_sent_again(desk: Desk) -> None:
    desk.hand_over(mission(ROOM + ITEMS))
    before = [desk.vehicle.plans.fence.revision, desk.vehicle.plans.rally.revision]
    assert desk.hand_over(mission(ROOM + ITEMS)) == ["2 mission items uploaded"]
    assert [desk.vehicle.plans.fence.revision, desk.vehicle.plans.rally.revision] == before


NEAR_A_TOWER = mission("fence:\n  - {stay: outside, centre_m: [0, 1], radius_m: 5}\nrally: []\n" + ITEMS)
OTHERS = mission("fence: []\nrally:\n  - {at_m: [0, 0, -9]}\n" + ITEMS)
TOO_HIGH = OTHERS._replace(items=(OTHERS.items[0], OTHERS.items[1]._replace(z=-20_000.0)))


@pytest.mark.parametrize(
    ("other", "fault"),
    [
        (
            NEAR_A_TOWER,
            "the vehicle refuses the fence: Item 0, place refused: home would be inside the forbidden circle",
        ),
        (TOO_HIGH, "the vehicle refuses the mission: Item 1, param7 refused: altitude is beyond 10 km"),
    ],
)
def test_a_refusal_leaves_all_three_plans_as_they_were(desk: Desk, other: Uploaded, fault: str) -> None:
    desk.hand_over(mission(ROOM + ITEMS))
    before = desk.stored()
    with pytest.raises(LinkError) as caught:
        desk.hand_over(other)
    assert str(caught.value).startswith(fault)
    assert desk.stored() == before


def test_a_mission_that_leaves_the_fence_is_stopped_at_its_start_and_the_motors_with_it(desk: Desk) -> None:
    plan = mission(ROOM + ITEMS.replace("[20, 0, -5]", "[40, 0, -5]"))
    flight = Flight(plan, desk.client)
    with pytest.raises(LinkError) as caught:
        desk.finish()
    objection = "item 1 lies outside the fence: outside the circle of fence item 0"
    assert str(caught.value).startswith("starting the mission: refused")
    assert objection in str(caught.value)
    assert [f"{text}: the vehicle doesn't start it" for text in [objection]] == timeline.objections(plan)
    assert flight.measured_s is None
    assert not desk.vehicle.commander.armed
    assert len(desk.stored()[0]) == 2


def test_a_mission_started_by_command_is_stopped_likewise(desk: Desk) -> None:
    with pytest.raises(LinkError, match="item 1 lies outside the fence"):
        desk.run(commands.mission(desk.client, mission(ROOM + ITEMS.replace("[20, 0, -5]", "[40, 0, -5]"))))
    desk.run(desk.client.pause(0.1))
    assert not desk.vehicle.commander.armed


def test_a_streamed_flight_brings_its_fence_and_its_rally_points(desk: Desk) -> None:
    text = f"name: a\nkind: waypoints\nduration_s: 2\n{ROOM}waypoints:\n"
    text += "  - {t_s: 0, at_m: [0, 0, 0]}\n  - {t_s: 2, at_m: [0, 0, -1]}\n"
    flight = Flight(yaml_plan.loads(text, "a.yaml"), desk.client)
    desk.finish()
    assert flight.measured_s == 2.0
    assert [len(items) for items in desk.stored()] == [0, 1, 1]
    assert "1 fence item uploaded" in flight.notes
