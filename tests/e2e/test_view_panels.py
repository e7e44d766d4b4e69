"""The page's controls in a real browser: what is done there happens to the vehicle, and what happens to it is seen."""

import contextlib
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from browser import Viewer, chromium, looking_at, needs_browser, row_of, text_of, until
from daemon_process import BOOT_LIMIT_S, Client, Daemon, free_instance, mavlink

pytestmark = [pytest.mark.e2e, needs_browser]

INSTANCES = range(110, 120)
SPEED = 10
PATIENT = ("--set", "COM_OF_LOSS_T=20")  # at ten times real time, with targets streamed from a busy machine
LOOK = {"size": (760, 800), "sharpness": 0.2}  # little of the scene to draw
REFUSED = "disarming: refused for now by the vehicle: disarming refused: in the air"


class Bench(NamedTuple):
    daemon: Daemon
    station: Client  # another ground station
    page: Any


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


@contextlib.contextmanager
def flown(daemon: Daemon) -> Iterator[Client]:
    station = Client(daemon)
    station.until_ready()
    yield station
    station.close()


@pytest.fixture(scope="module")
def bench(browser, tmp_path_factory) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("panels")
    instance = free_instance(INSTANCES)
    with (
        Daemon(folder, "--speed", str(SPEED), *PATIENT, instance=instance, zenoh=True) as daemon,
        flown(daemon) as station,
        Viewer(folder, "--instance", str(instance)) as viewer,
    ):
        viewer.until_serving()
        with looking_at(browser, viewer.url, **LOOK) as page:
            open_tab(page, "Fly")
            until(lambda: enabled(page, "Arm"), "the vehicle can be commanded")
            yield Bench(daemon, station, page)


def open_tab(page: Any, *names: str) -> None:
    for name in names:
        press(page.get_by_role("tab", name=name, exact=True))


def press(element: Any) -> None:
    """A click that doesn't wait for the scene to be drawn, which takes long without a graphics card."""
    element.wait_for()
    element.click(force=True)


def button(page: Any, name: str) -> Any:
    return page.get_by_role("button", name=name, exact=True, disabled=False).locator("visible=true").first


def enabled(page: Any, name: str) -> bool:
    return page.get_by_role("button", name=name, exact=True, disabled=False).locator("visible=true").count() == 1


def slider(page: Any, label: str, place: int = 0) -> Any:
    """The track of the slider that stands `place` sliders below the first one with this label."""
    words = page.locator("label").locator("visible=true").filter(has_text=re.compile(rf"^{re.escape(label)}$"))
    return page.locator(f'[id="{words.nth(place).get_attribute("for")}"]')


def number_of(track: Any) -> float:
    return float(track.locator("xpath=following-sibling::*//input").input_value())


def drag(page: Any, track: Any, share: float) -> None:
    """To a place on the track, 0 … 1, by way of others."""
    box = track.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.9 * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + share * box["width"], y, steps=3)
    page.mouse.up()


def down_m(page: Any) -> float:
    open_tab(page, "Vehicle")
    position = row_of(page, "position")
    return position[2] if len(position) == 3 else 0.0


def test_a_dragged_gain_is_in_force_and_put_back_to_the_papers_and_the_tuned_value(bench: Bench) -> None:
    page, station = bench.page, bench.station
    open_tab(page, "Gains", "Rate")
    track = slider(page, "P N·m·s", 1)
    until(lambda: number_of(track) == 2.5, "the slider shows the gain in force")
    drag(page, track, 0.3)
    until(lambda: station.get("RATE_Y_P") == pytest.approx(number_of(track)), "the vehicle has what the slider shows")
    assert station.get("RATE_Y_P") == pytest.approx(0.3 * 5.0, abs=0.2)
    press(button(page, "tuned 0.386"))
    until(lambda: station.get("RATE_Y_P") == pytest.approx(0.386), "the tuned value is in force")
    until(lambda: number_of(track) == 0.386, "the slider shows it")
    press(button(page, "paper"))
    until(lambda: number_of(track) == 2.5, "the slider shows the paper's value")
    assert station.get("RATE_Y_P") == pytest.approx(2.5)


def test_what_another_station_writes_moves_the_slider_and_its_scale(bench: Bench) -> None:
    page = bench.page
    open_tab(page, "Gains", "Vel")
    track = slider(page, "P 1/s", 2)
    for value in (2.125, 20.0):
        bench.station.set("VEL_Z_P", value)
        until(lambda value=value: number_of(track) == value, f"the slider shows {value}")
    bench.station.set("VEL_Z_P", 1.57)


def test_a_vehicle_takes_off_refuses_to_be_disarmed_and_lands(bench: Bench) -> None:
    page = bench.page
    open_tab(page, "Fly")
    press(button(page, "Take off"))
    until(lambda: down_m(page) < -2.4, "it is up")
    open_tab(page, "Fly")
    until(lambda: "in air" in text_of(page), "the page says so")
    press(button(page, "Disarm"))
    until(
        lambda: REFUSED in text_of(page),
        "the refusal and its reason are shown",
    )
    press(button(page, "Land"))
    until(lambda: "disarmed · on ground" in text_of(page), "it is down")


def test_wind_and_time_are_set_and_the_vehicle_stepped_while_it_stands_still(bench: Bench) -> None:
    page, station = bench.page, bench.station
    open_tab(page, "Fly")
    drag(page, slider(page, "north"), 0.75)
    until(lambda: station.get("SIM_WIND_N") == pytest.approx(4.0, abs=0.6), "the wind blows")
    press(button(page, "Calm"))
    until(lambda: station.get("SIM_WIND_N") == 0.0, "it is calm")
    press(button(page, "Pause"))
    until(lambda: enabled(page, "Go on"), "it stands still")
    before_ms = time_ms(station)
    press(button(page, "100"))
    until(lambda: time_ms(station) >= before_ms + 100, "it was stepped")
    assert time_ms(station) == before_ms + 100
    press(button(page, "Go on"))
    until(lambda: enabled(page, "Pause"), "it goes on")
    press(button(page, "2"))
    until(lambda: station.get("SIM_SPEED") == 2.0, "at twice real time")
    station.set("SIM_SPEED", SPEED)


def time_ms(station: Client) -> int:
    """The vehicle's time, which it tells on request even where it stands still."""
    number = mavlink.MAVLINK_MSG_ID_SYSTEM_TIME
    message = mavlink.MAVLink_command_long_message(0, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, number, 0, 0, 0, 0, 0, 0)
    return station.request(message, lambda m: m.get_type() == "SYSTEM_TIME").time_boot_ms


@pytest.mark.parametrize(
    ("mission", "told"),
    [
        ("rectangle-mission.yaml", "mission rectangle-mission under way"),
        ("hover.yaml", "hover: flown; mean absolute error north / east / down "),
    ],
)
def test_a_mission_is_flown_from_the_list(bench: Bench, mission: str, told: str) -> None:
    page = bench.page
    open_tab(page, "Fly")
    press(page.locator('input[aria-haspopup="listbox"]').locator("visible=true").first)
    press(page.get_by_role("option", name=mission, exact=True))
    press(button(page, "Fly it"))
    until(lambda: "armed · in air" in text_of(page), "it flies")
    until(lambda: "disarmed · on ground" in text_of(page), "it has landed", 30.0)
    until(lambda: told in text_of(page), "what came of it is shown")


def test_two_viewers_keep_each_others_sliders_current(bench: Bench, browser, tmp_path) -> None:
    with Viewer(tmp_path, "--connect", bench.daemon.zenoh_endpoint) as viewer:
        viewer.until_serving()
        with looking_at(browser, viewer.url, **LOOK) as other:
            tracks = []
            for page in (bench.page, other):
                open_tab(page, "Gains", "Pos")
                tracks.append(slider(page, "P 1/s", 0))
            mine, theirs = tracks
            until(lambda: number_of(theirs) == 2.84, "the other viewer knows the gain")
            drag(bench.page, mine, 0.25)
            until(lambda: number_of(theirs) == number_of(mine) != 2.84, "it follows")
            drag(other, theirs, 0.6)
            until(lambda: number_of(mine) == number_of(theirs) == pytest.approx(3.6, abs=0.3), "and back")


def test_what_is_done_happens_to_the_chosen_vehicle_which_may_be_lost_and_come_back(
    bench: Bench, browser, tmp_path
) -> None:
    instance = free_instance([k for k in INSTANCES if k != bench.daemon.instance])
    both = ("--instance", str(bench.daemon.instance), "--instance", str(instance))
    with contextlib.ExitStack() as stack:
        daemon = stack.enter_context(Daemon(tmp_path, instance=instance, zenoh=True))
        with flown(daemon) as station:
            station.set("SIM_WIND_E", 2.0)
        viewer = stack.enter_context(Viewer(tmp_path, *both))
        viewer.until_serving()
        page = stack.enter_context(looking_at(browser, viewer.url, **LOOK))
        until(lambda: choices(page).count() == 1, "there is a choice of vehicles")
        open_tab(page, "Fly")
        for chosen, wind in ((bench.daemon.instance, 0.0), (instance, 2.0)):
            choose(page, f"yawsitter {chosen}")
            until(lambda wind=wind: number_of(slider(page, "east")) == wind, "it is the chosen one's wind")
            assert enabled(page, "Arm")
        daemon.stop()
        until(lambda: not enabled(page, "Arm"), "it can't be commanded")
        assert "is gone" in text_of(page)
        with Daemon(tmp_path, instance=instance, zenoh=True) as again, flown(again) as station:
            until(lambda: enabled(page, "Arm"), "it can be commanded again", BOOT_LIMIT_S)
            until(lambda: number_of(slider(page, "east")) == 0.0, "its wind is the new one's")
            press(button(page, "Arm"))
            until(lambda: is_armed(station), "it obeys")
            assert not is_armed(bench.station)


def choices(page: Any) -> Any:
    return page.get_by_label("Vehicle", exact=True).locator("visible=true")


def choose(page: Any, name: str) -> None:
    press(choices(page))
    press(page.get_by_role("option", name=name, exact=True))


def is_armed(station: Client) -> bool:
    station.drain()
    return bool(station.wait("HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
