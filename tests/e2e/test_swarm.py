"""A real swarm of three in a process of its own, with real clients on its shared port and on the vehicles' own."""

import asyncio
import json
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh
from daemon_process import BOOT_LIMIT_S, ROOT, command, mavlink
from pymavlink import mavutil
from terminal import Terminal

pytestmark = pytest.mark.e2e

COUNT = 3
FIRSTS = range(170, 250, COUNT)
SPEED = 10
METRES_PER_1E7 = 0.0111195  # of latitude


class Swarm:
    def __init__(self, folder: Path) -> None:
        self.first = next(first for first in FIRSTS if _free(first))
        self.systems = range(self.first + 1, self.first + 1 + COUNT)
        self.port = 18300 + self.first
        self.log = folder / "log.txt"
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                command(
                    "swarm", str(COUNT), "--instance", str(self.first), "--state-dir", str(folder / "state"),
                    "--speed", str(SPEED), "--spacing", "4", "--set", "COM_OF_LOSS_T=30",
                ),
                stderr=log,
                cwd=ROOT,
            )  # fmt: skip

    def connect(self, port: int | None = None, system: int = 255) -> mavutil.mavfile:
        """A ground station at the shared port, or another."""
        link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port or self.port}", source_system=system)
        link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0)
        return link

    def ready(self) -> None:
        link, standing = self.connect(), set()
        end_s = time.monotonic() + BOOT_LIMIT_S
        while standing != set(self.systems):
            assert time.monotonic() < end_s, self.log.read_text()
            m = link.recv_match(type="HEARTBEAT", blocking=True, timeout=1.0)
            link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0)
            if m is not None and m.system_status == mavlink.MAV_STATE_STANDBY:
                standing.add(m.get_srcSystem())
        link.close()


def _free(first: int) -> bool:
    with ExitStack() as held:
        numbers = [18300 + first, *(base + first + k for base in (18570, 14580) for k in range(COUNT))]
        for number, kind in [*((n, socket.SOCK_DGRAM) for n in numbers), (7447 + first, socket.SOCK_STREAM)]:
            sock = held.enter_context(socket.socket(socket.AF_INET, kind))
            try:
                sock.bind(("127.0.0.1", number))
            except OSError:
                return False
    return True


@pytest.fixture(scope="module")
def swarm(tmp_path_factory) -> Iterator[Swarm]:
    swarm = Swarm(tmp_path_factory.mktemp("swarm"))
    try:
        swarm.ready()
        yield swarm
        swarm.process.send_signal(signal.SIGINT)
        assert swarm.process.wait(20) == 0
        assert "0 faults" in swarm.log.read_text()
    finally:
        if swarm.process.poll() is None:
            swarm.process.kill()
            swarm.process.wait()


def told(link, wanted: str, enough: int, limit_s: float = 10.0) -> dict:
    """The newest message of this name from each system, when so many have told one."""
    found, end_s = {}, time.monotonic() + limit_s
    while len(found) < enough and time.monotonic() < end_s:
        m = link.recv_match(type=wanted, blocking=True, timeout=1.0)
        if m is not None:
            found[m.get_srcSystem()] = m
    return found


def test_a_ground_station_at_the_shared_port_sees_all_of_them_apart(swarm) -> None:
    places = told(swarm.connect(), "GLOBAL_POSITION_INT", COUNT)
    assert set(places) == set(swarm.systems)
    a, b, c = (places[system] for system in swarm.systems)
    shrunk = 0.5635  # cosine of the latitude
    assert (b.lon - a.lon) * METRES_PER_1E7 * shrunk == pytest.approx(4.0, abs=0.05)
    assert (c.lat - a.lat) * METRES_PER_1E7 == pytest.approx(4.0, abs=0.05)
    assert a.lat == pytest.approx(b.lat, abs=2)


def test_the_dashboard_has_a_row_for_each_and_shows_the_one_that_is_chosen(swarm) -> None:
    second, third = swarm.systems[1:]
    with Terminal("watch", "--system", str(second), "--connect", f"udpout:127.0.0.1:{swarm.port}") as terminal:
        screen = terminal.until(lambda screen: "3 vehicles" in screen and f"· system {second} " in screen)
        assert f"▶ {second}" in screen
        terminal.press("3")
        terminal.until(lambda screen: f"· system {third} " in screen and f"▶ {third}" in screen)
        terminal.process.send_signal(signal.SIGTERM)
        assert terminal.end() == 128 + signal.SIGTERM


def test_a_command_acts_on_the_vehicle_that_it_names_and_its_own_port_reaches_it_too(swarm) -> None:
    named = swarm.systems[1]
    shared, own = swarm.connect(), swarm.connect(18570 + swarm.first + 1)
    for link, armed in ((shared, 1.0), (own, 0.0)):
        link.mav.command_long_send(named, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, armed, *(0.0,) * 6)
        ack = told(link, "COMMAND_ACK", 1)
        assert {system: m.result for system, m in ack.items()} == {named: 0}
    assert set(told(own, "ATTITUDE", 2, limit_s=1.0)) == {named}


def test_a_parameter_write_to_all_is_answered_by_each(swarm) -> None:
    link = swarm.connect()
    link.mav.param_set_send(0, 1, b"POS_X_P", 1.25, mavlink.MAV_PARAM_TYPE_REAL32)
    values = told(link, "PARAM_VALUE", COUNT)
    assert {system: m.param_value for system, m in values.items()} == dict.fromkeys(swarm.systems, 1.25)


def test_one_zenoh_session_tells_of_all_of_them(swarm) -> None:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{7447 + swarm.first}"]))
    config.insert_json5("scouting/multicast/enabled", "false")
    instances = [system - 1 for system in swarm.systems]
    with zenoh.open(config) as session:
        replies = [reply.ok for reply in session.get("yawsitter/*/mode", timeout=10.0) if reply.ok is not None]
        assert sorted(str(r.key_expr) for r in replies) == [f"yawsitter/{i}/mode" for i in instances]
        described = session.get(f"yawsitter/{instances[2]}/description", timeout=10.0)
        assert [json.loads(r.ok.payload.to_string())["instance"] for r in described] == [instances[2]]
        alive = session.liveliness().get("yawsitter/*/alive", timeout=10.0)
        assert sorted(str(r.ok.key_expr) for r in alive) == [f"yawsitter/{i}/alive" for i in instances]
        heard, end_s = set(), time.monotonic() + 10.0
        with session.declare_subscriber("yawsitter/*/state") as subscriber:
            while len(heard) < COUNT and time.monotonic() < end_s:
                sample = subscriber.try_recv()
                heard |= {str(sample.key_expr)} if sample is not None else set()
        assert heard == {f"yawsitter/{i}/state" for i in instances}


def test_mavsdk_flies_one_over_its_own_port_and_sees_all_at_the_shared_one(swarm) -> None:
    from mavsdk_drone import Drone, Generation

    async def fly() -> int:
        own = f"udpout://127.0.0.1:{14580 + swarm.first + 2}"
        async with Drone.connected(Generation.NATIVE, own) as drone:
            await drone.airborne()
            await drone.action.land()
            await drone.told("armed", lambda armed: not armed)
        return await _systems_at(f"udpout://127.0.0.1:{swarm.port}")

    assert asyncio.run(fly()) == COUNT


async def _systems_at(address: str) -> int:
    """How many vehicles MAVSDK finds there."""
    from mavsdk import ComponentType, Configuration
    from mavsdk.asyncio import Mavsdk

    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        await mavsdk.add_any_connection(address)
        for _ in range(100):
            if await mavsdk.system_count() == COUNT:
                break
            await asyncio.sleep(0.1)
        return await mavsdk.system_count()


def test_gcs_chooses_its_vehicle_at_the_shared_port(swarm) -> None:
    arguments = ("fly", "missions/hover.yaml", "--connect", f"udpout:127.0.0.1:{swarm.port}", "--json")
    flown = subprocess.run(
        [sys.executable, "-m", "gcs_tools", *arguments, "--system", str(swarm.systems[2])],
        capture_output=True, text=True, cwd=ROOT, timeout=60, check=False,
    )  # fmt: skip
    assert flown.returncode == 0, flown.stderr
    armed = re.findall(r"system (\d+): [\d.]+ s: armed: armed", swarm.log.read_text())
    assert armed[-1] == str(swarm.systems[2])


def test_a_client_that_floods_the_shared_port_does_not_stop_the_others(swarm) -> None:
    link, begun_s = swarm.connect(), time.monotonic()
    beats, answers, asked_s = [], 0, 0.0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flooder:
        heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(mavlink.MAVLink(None, 254, 190))
        while (now_s := time.monotonic()) < begun_s + 3.5:
            for _ in range(200):
                flooder.sendto(heartbeat, ("127.0.0.1", swarm.port))
            if now_s - asked_s > 0.25:
                asked_s = now_s
                wanted = float(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
                request = mavlink.MAV_CMD_REQUEST_MESSAGE
                link.mav.command_long_send(swarm.systems[0], 1, request, 0, wanted, *(0.0,) * 6)
            while (m := link.recv_match(type=["HEARTBEAT", "COMMAND_ACK"])) is not None:
                answers += m.get_type() == "COMMAND_ACK"
                beats += [m.get_srcSystem()] if m.get_type() == "HEARTBEAT" else []
            time.sleep(0.005)
    assert answers >= 5
    assert {system: beats.count(system) >= 3 for system in swarm.systems} == dict.fromkeys(swarm.systems, True)


def test_the_example_flies_them_in_formation(swarm) -> None:
    flown = subprocess.run(
        [
            sys.executable, "examples/formation.py", "circle", "--connect", f"udpout:127.0.0.1:{swarm.port}",
            "--first", str(swarm.systems[0]), "--count", str(COUNT),
        ],
        capture_output=True, text=True, cwd=ROOT, timeout=90, check=False,
    )  # fmt: skip
    assert flown.returncode == 0, flown.stderr
    rows = [line.split() for line in flown.stdout.splitlines()[1:]]
    assert [int(row[0]) for row in rows] == list(swarm.systems)
    assert max(float(row[1]) for row in rows) < 0.5  # of a lap of 19 m at ten times real time, targets 20 Hz
