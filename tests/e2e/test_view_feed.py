"""The viewer's feed on a real vehicle's Zenoh: while it is paused, when it is killed, and whom it leaves out."""

import signal
import time
from collections.abc import Callable

import pytest
from daemon_process import BOOT_LIMIT_S, Client, Daemon, free_instance, mavlink

from gcs_tools.view.feed import Feed

pytestmark = pytest.mark.e2e

INSTANCES = range(100, 110)
LIMIT_S = 15.0


def until(feed: Feed, true: Callable[[], object], what: str, limit_s: float = LIMIT_S) -> None:
    end_s = time.monotonic() + limit_s
    while not true():
        assert time.monotonic() < end_s, f"not within {limit_s:g} s: {what}"
        feed.poll(time.monotonic())
        time.sleep(0.02)


def test_a_paused_vehicle_is_known_and_each_step_and_each_new_plan_of_it_seen(tmp_path) -> None:
    instance = free_instance(INSTANCES)
    with Daemon(tmp_path, "--set", "SIM_PAUSE=1", instance=instance, zenoh=True) as daemon:
        feed = Feed([daemon.zenoh_endpoint])
        try:
            until(feed, lambda: instance in feed.vehicles, "it is there", BOOT_LIMIT_S)
            vehicle = feed.vehicles[instance]
            until(feed, lambda: vehicle.instant is not None and vehicle.mode is not None, "it is known", BOOT_LIMIT_S)
            assert vehicle.mode.paused
            before_us = vehicle.instant.now_us
            client = Client(daemon)
            client.until_ready()
            client.set("SIM_STEP_MS", 40, integer=True)
            until(feed, lambda: vehicle.instant.now_us == before_us + 40_000, "the step is seen")
            assert vehicle.mission.rally_N_m == []
            client.request(
                mavlink.MAVLink_mission_count_message(instance + 1, 1, 1, mission_type=2),
                lambda m: m.get_type() == "MISSION_REQUEST_INT",
            )
            rally = (instance + 1, 1, 0, 1, 5100, 0, 1, 0, 0, 0, 0, 30_000, -20_000, -4.0)
            client.request(
                mavlink.MAVLink_mission_item_int_message(*rally, mission_type=2),
                lambda m: m.get_type() == "MISSION_ACK",
            )
            client.close()
            until(feed, lambda: vehicle.mission.rally_N_m == [(3.0, -2.0, -4.0)], "a new rally point is seen")
        finally:
            feed.close()


def test_a_vehicle_that_is_killed_is_missed_and_its_last_state_kept(tmp_path) -> None:
    instance = free_instance(INSTANCES)
    with Daemon(tmp_path, instance=instance, zenoh=True) as daemon:
        feed = Feed([daemon.zenoh_endpoint], [instance])
        try:
            until(feed, lambda: instance in feed.vehicles, "it is there", BOOT_LIMIT_S)
            vehicle = feed.vehicles[instance]
            until(feed, lambda: vehicle.instant is not None, "it is known", BOOT_LIMIT_S)
            assert feed.status.connected
            daemon.stop(signal.SIGKILL)
            until(feed, lambda: not vehicle.alive, "it is missed")
            assert vehicle.instant is not None
            until(feed, lambda: not feed.status.connected, "so is its endpoint")
            assert "Nobody answers" in feed.status.text
        finally:
            feed.close()


def test_only_the_vehicles_that_are_asked_for_are_shown(tmp_path) -> None:
    instance = free_instance(INSTANCES)
    with Daemon(tmp_path, instance=instance, zenoh=True) as daemon:
        feed = Feed([daemon.zenoh_endpoint], [instance + 1])
        try:
            until(feed, lambda: feed.status.connected, "it is connected", BOOT_LIMIT_S)
            for _ in range(20):
                feed.poll(time.monotonic())
                time.sleep(0.02)
            assert feed.vehicles == {}
            assert "no vehicle is there" in feed.status.text
        finally:
            feed.close()
