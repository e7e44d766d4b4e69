"""The viewer's page in a real browser: the vehicle is there, moves, goes and comes back; a recording plays."""

import pytest
from browser import Viewer, chromium, looking_at, needs_browser, picture, row_of, share_changed, text_of, until
from daemon_process import BOOT_LIMIT_S, Client, Daemon, free_instance, mavlink

pytestmark = [pytest.mark.e2e, needs_browser]

INSTANCES = range(100, 110)
NAN = float("nan")


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


def test_a_page_that_is_open_before_its_vehicle_shows_it_come_fly_go_and_come_back(browser, tmp_path) -> None:
    instance = free_instance(INSTANCES)
    with Viewer(tmp_path, "--instance", str(instance)) as viewer:
        viewer.until_serving()
        with looking_at(browser, viewer.url) as page:
            until(lambda: f"Nobody answers at tcp/127.0.0.1:{7447 + instance}" in text_of(page), "it waits")
            with Daemon(tmp_path, instance=instance, zenoh=True) as daemon:
                client = Client(daemon)
                client.until_ready()
                until(lambda: "disarmed" in text_of(page), "the vehicle is there", BOOT_LIMIT_S)
                assert client.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, 0, 0, NAN) == 0
                assert client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
                until(lambda: (row_of(page, "position") or [0, 0, 0])[2] < -1.0, "it climbs")
                client.close()
                daemon.stop()
            until(lambda: "is gone" in text_of(page), "it is missed")
            with Daemon(tmp_path, instance=instance, zenoh=True) as daemon:
                client = Client(daemon)
                client.until_ready()
                client.close()
                until(lambda: "disarmed" in text_of(page) and "is gone" not in text_of(page), "it is back")


def test_two_viewers_of_one_vehicle_share_nothing_but_the_vehicle(browser, tmp_path) -> None:
    with Daemon(tmp_path, instance=free_instance(INSTANCES), zenoh=True) as daemon:
        client = Client(daemon)
        client.until_ready()
        client.close()
        arguments = ("--connect", daemon.zenoh_endpoint)
        with Viewer(tmp_path, *arguments) as one, Viewer(tmp_path, *arguments) as other:
            for viewer in (one, other):
                viewer.until_serving()
                with looking_at(browser, viewer.url) as page:
                    until(lambda page=page: "disarmed" in text_of(page), "it shows the vehicle")


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A take-off, recorded by a real vehicle."""
    folder = tmp_path_factory.mktemp("recording")
    with Daemon(folder, "--record", str(folder / "logs"), "--speed", "5", instance=free_instance(INSTANCES)) as daemon:
        client = Client(daemon)
        client.until_ready()
        assert client.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, 0, 0, NAN) == 0
        assert client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        client.wait(lambda m: m.get_type() == "LOCAL_POSITION_NED" and m.z < -1.5)
        client.close()
        daemon.stop()
    [path] = (folder / "logs").glob("*.mcap")
    return path


def test_a_recorded_flight_plays_and_is_scrubbed(browser, tmp_path, recording) -> None:
    with Viewer(tmp_path, str(recording)) as viewer:
        viewer.until_serving()
        with looking_at(browser, viewer.url) as page:
            until(lambda: "Replay" in text_of(page) and row_of(page, "position"), "it is there")
            begin_s = row_of(page, "time")[0]
            thumb = page.get_by_role("slider").first
            thumb.focus()
            thumb.press("End")
            until(lambda: row_of(page, "position")[2] < -1.0, "the end is in the air")
            high = picture(page)
            thumb.press("Home")
            until(lambda: row_of(page, "position")[2] > -0.1, "the begin is on the ground")
            until(lambda: share_changed(high, picture(page)) > 0.005, "the picture is another")
            page.get_by_role("button", name="Play").click()
            until(lambda: row_of(page, "time")[0] > begin_s + 1.0, "it plays")
