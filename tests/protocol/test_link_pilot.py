"""The page's pilot against the vehicle itself: parameters, commands, missions, and what it lets the link carry."""

from collections.abc import Callable

import pytest
from mavlink_pair import World

from gcs_tools import commands
from gcs_tools import plan as plans
from gcs_tools.client import Client
from gcs_tools.view.pilot import Pilot
from sitl.mavlink.peers import PortKind

LIMIT_S = 20.0


class Page:
    """A pilot at the end of a link, and another station at the end of another."""

    def __init__(self, world: World) -> None:
        self.world, self.pilot = world, Pilot(Client(1))
        self.other = world.station()
        self.sent: list[bytes] = []
        self.received = 0
        self._station = world.station(greeting=False, kind=PortKind.GCS)
        self._station.take = self._take  # type: ignore[method-assign]
        self.until(lambda: self.pilot.up)

    def _take(self, data: bytes) -> None:
        self.received += 1
        self.pilot.client.receive(data, self.world.wall_s)

    def turn(self) -> None:
        for data in self.pilot.client.poll(self.world.wall_s):
            self.sent.append(data)
            self._station.send_bytes(data)
        self.world.step()

    def until(self, true: Callable[[], bool], limit_s: float = LIMIT_S) -> None:
        end_s = self.world.wall_s + limit_s
        while not true():
            assert self.world.wall_s < end_s, [line.text for line in self.pilot.lines]
            self.turn()

    def run(self, seconds: float) -> None:
        end_s = self.world.wall_s + seconds
        self.until(lambda: self.world.wall_s >= end_s)


@pytest.fixture
def page(make_world: Callable[..., World]) -> Page:
    return Page(make_world())


def test_of_a_drags_values_the_last_is_in_force_and_few_are_sent(page: Page) -> None:
    before = len(page.sent)
    for k in range(100):
        page.pilot.write("RATE_Y_P", 1.0 + k * 0.01)
        if k % 10 == 9:
            page.turn()
    page.run(0.5)
    assert page.world.vehicle.parameters["RATE_Y_P"] == pytest.approx(1.99)
    assert page.pilot.value("RATE_Y_P") == 1.99
    assert len(page.sent) - before < 20


def test_what_another_station_writes_is_known(page: Page) -> None:
    page.other.send("PARAM_SET", target_system=1, param_id="RATE_Y_P", param_value=0.75, param_type=9)
    page.run(0.1)
    assert page.pilot.value("RATE_Y_P") == 0.75


def test_a_value_out_of_range_is_told_and_the_old_one_stands(page: Page) -> None:
    old = page.pilot.value("RATE_Y_P")
    page.pilot.write("RATE_Y_P", 99.0)
    page.run(0.5)
    assert page.pilot.lines[-1].text == f"RATE_Y_P: value out of range; it stays {old}"
    assert page.pilot.value("RATE_Y_P") == old


def test_the_vehicles_reason_stands_in_the_refusals_line_alone(page: Page) -> None:
    page.pilot.ask(lambda client: commands.mode(client, "offboard"))
    page.until(lambda: page.pilot.completed == 1)
    about = [line.text for line in page.pilot.lines if "offboard" in line.text]
    assert about == ["mode offboard: refused by the vehicle: offboard refused: no target in the last 0.5 s"]


def test_the_link_is_quiet_once_the_vehicle_is_met(page: Page) -> None:
    page.run(2.0)
    before = page.received
    page.run(10.0)
    assert page.received - before < 25 * 10  # they are 400 a second by default


@pytest.mark.compiled
def test_a_mission_is_started_in_the_air_and_the_vehicle_held_in_its_midst(page: Page) -> None:
    commander = page.world.vehicle.commander
    page.pilot.ask(lambda client: commands.takeoff(client, height_m=2.0, wait=False))
    page.until(lambda: page.pilot.completed == 1)
    page.world.speed = 5.0
    page.until(lambda: commander.armed and commander.mode.value == "hold")
    mission = plans.load("missions/rectangle-fenced.yaml")
    page.pilot.ask(lambda client: commands.mission(client, mission))
    page.until(lambda: page.pilot.completed == 2)
    assert page.pilot.lines[-1].text == "mission rectangle-fenced under way"
    assert commander.mode.value == "mission"
    page.run(1.0)
    page.pilot.ask(lambda client: commands.mode(client, "hold"))
    page.until(lambda: page.pilot.completed == 3)
    assert commander.mode.value == "hold"
