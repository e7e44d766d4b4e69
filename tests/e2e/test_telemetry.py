"""The real daemon's telemetry, heard by real Zenoh sessions: what goes out, and what bad listeners can't do to it."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import defaultdict

import pytest
import zenoh
from daemon_process import BOOT_LIMIT_S, ROOT, Client, Daemon, command, mavlink

pytestmark = pytest.mark.e2e

SAMPLED = ("state", "attitude", "setpoint", "actuators", "loads")
LIMIT_S = 10.0

BAD_LISTENER = """
import sys, time, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{sys.argv[1]}"]')
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
subscriber = session.declare_subscriber(sys.argv[2], zenoh.handlers.FifoChannel(1))
print("listening", flush=True)
time.sleep(300)
"""


BAD_ASKER = """
import sys, time, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{sys.argv[1]}"]')
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
print("listening", flush=True)
unread = []
while True:
    unread.append(session.get(sys.argv[2], zenoh.handlers.FifoChannel(1)))
    time.sleep(0.002)
"""


def connect(daemon: Daemon):
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([daemon.zenoh_endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    end_s = time.monotonic() + BOOT_LIMIT_S
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError:
            if time.monotonic() > end_s:
                raise
            time.sleep(0.1)


def ask(session, key: str) -> dict[str, bytes]:
    """The answers to a get, by key."""
    replies = session.get(key, timeout=LIMIT_S)
    return {str(reply.ok.key_expr): reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None}


@pytest.fixture
def daemon(tmp_path):
    with Daemon(tmp_path, zenoh=True) as running:
        yield running


@pytest.fixture
def client(daemon):
    ground = Client(daemon)
    ground.until_ready()
    yield ground
    ground.close()


@pytest.fixture
def session(daemon, client):
    with connect(daemon) as opened:
        yield opened


class Ear:
    """Collects what is published under a key expression."""

    def __init__(self, session, key: str) -> None:
        self._subscriber = session.declare_subscriber(key, zenoh.handlers.FifoChannel(10_000))

    def listen(self, seconds: float) -> dict[str, list]:
        heard, end_s = defaultdict(list), time.monotonic() + seconds
        while time.monotonic() < end_s:
            sample = self._subscriber.try_recv()
            if sample is None:
                time.sleep(0.002)
            else:
                heard[str(sample.key_expr).split("/", 2)[2]].append(sample)
        return heard


def decoded(samples: list) -> list[dict]:
    return [json.loads(sample.payload.to_bytes()) for sample in samples]


def test_every_sampled_topic_comes_as_json_at_the_rate_of_the_parameter(session, client, daemon) -> None:
    ear = Ear(session, f"yawsitter/{daemon.instance}/**")
    ear.listen(0.5)
    heard = ear.listen(2.0)
    for topic in SAMPLED:
        stamps = [message["now_us"] for message in decoded(heard[topic])]
        rate_Hz = (len(stamps) - 1) / ((stamps[-1] - stamps[0]) * 1e-6)
        assert rate_Hz == pytest.approx(50.0, rel=0.1), topic
        assert stamps == sorted(set(stamps))
        assert str(heard[topic][0].encoding) == "application/json"
    client.set("SIM_TLM_RATE", 20.0)
    ear.listen(0.5)
    assert len(ear.listen(2.0)["attitude"]) == pytest.approx(40, abs=8)


def test_standing_it_shows_the_paper_s_angles_and_loads_in_balance(session, daemon) -> None:
    attitude = json.loads(ask(session, f"yawsitter/{daemon.instance}/attitude").popitem()[1])
    assert 80.0 < attitude["theta_deg"] < 110.0
    assert sum(x * x for x in attitude["q_NB"]) == pytest.approx(1.0)
    loads = json.loads(ask(session, f"yawsitter/{daemon.instance}/loads").popitem()[1])
    assert {"gravity", "thrust", "side_force", "aero", "flaps", "ground"} <= set(loads["causes"])
    assert loads["total"]["force_B_N"] == pytest.approx([0.0, 0.0, 0.0], abs=0.05)


def test_the_latest_of_everything_can_be_asked_for_in_one_query(session, daemon) -> None:
    answers = {
        key.split("/", 2)[2]: json.loads(data) for key, data in ask(session, f"yawsitter/{daemon.instance}/*").items()
    }
    assert {*SAMPLED, "mode", "loop", "events", "parameters", "mission", "description"} == set(answers)
    assert answers["mode"]["mode"] == "hold"
    assert answers["mode"]["armed"] is False
    gains = {entry["name"]: entry for entry in answers["parameters"]["parameters"]}
    assert gains["RATE_Y_P"]["minimum"] <= gains["RATE_Y_P"]["value"] <= gains["RATE_Y_P"]["maximum"]
    assert answers["description"]["vehicle"]["name"] == "yawsitter"
    assert answers["description"]["schema_version"] == 1


def test_a_query_sees_a_parameter_as_written_over_mavlink(session, client, daemon) -> None:
    client.set("POS_X_P", 1.125)
    answer = json.loads(ask(session, f"yawsitter/{daemon.instance}/parameters").popitem()[1])
    assert next(entry["value"] for entry in answer["parameters"] if entry["name"] == "POS_X_P") == 1.125


def test_the_state_can_be_asked_for_while_paused(session, client, daemon) -> None:
    client.set("SIM_PAUSE", 1, integer=True)
    first = json.loads(ask(session, f"yawsitter/{daemon.instance}/state").popitem()[1])
    again = json.loads(ask(session, f"yawsitter/{daemon.instance}/state").popitem()[1])
    assert first["now_us"] == again["now_us"]
    assert json.loads(ask(session, f"yawsitter/{daemon.instance}/mode").popitem()[1])["paused"] is True


def test_arming_is_told_as_mode_and_event_at_once(session, client, daemon) -> None:
    ear = Ear(session, f"yawsitter/{daemon.instance}/*")
    ear.listen(0.3)
    assert client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_ACCEPTED
    heard = ear.listen(0.5)
    assert any(message["armed"] for message in decoded(heard["mode"]))
    events = decoded(heard["event"])
    assert [event["value"] for event in events if event["kind"] == "armed"] == [1]
    numbers = [event["number"] for event in events]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_the_mavlink_keys_carry_whole_frames_of_both_directions(session, client, daemon) -> None:
    ear = Ear(session, f"yawsitter/{daemon.instance}/mavlink/*")
    ear.listen(0.3)
    list(client.messages(1.5))
    heard = ear.listen(0.5)
    kinds = {}
    for topic in ("mavlink/out", "mavlink/in"):
        parser = mavlink.MAVLink(None)
        data = b"".join(sample.payload.to_bytes() for sample in heard[topic])
        messages = parser.parse_buffer(data)
        assert all(message.get_type() != "BAD_DATA" for message in messages)
        kinds[topic] = {(message.get_type(), message.get_srcSystem()) for message in messages}
    assert ("ATTITUDE", daemon.instance + 1) in kinds["mavlink/out"]
    assert kinds["mavlink/in"] == {("HEARTBEAT", 255)}


def test_at_full_speed_listeners_are_not_flooded(session, client, daemon) -> None:
    client.set("SIM_SPEED", 0.0)
    ear = Ear(session, f"yawsitter/{daemon.instance}/attitude")
    ear.listen(0.5)
    heard = decoded(ear.listen(2.0)["attitude"])
    assert 20 <= len(heard) <= 130
    assert heard[-1]["now_us"] - heard[0]["now_us"] > 10_000_000


def test_the_liveliness_token_stands_while_the_daemon_runs(daemon, client) -> None:
    observer_config = zenoh.Config()
    observer_config.insert_json5("mode", '"peer"')
    observer_config.insert_json5("connect/endpoints", json.dumps([daemon.zenoh_endpoint]))
    observer_config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(observer_config) as observer:
        token = observer.liveliness().declare_subscriber(
            "yawsitter/*/alive", zenoh.handlers.FifoChannel(10), history=True
        )
        changes, end_s = [], time.monotonic() + LIMIT_S
        while len(changes) < 2 and time.monotonic() < end_s:
            sample = token.try_recv()
            if sample is None:
                time.sleep(0.02)
                continue
            changes.append((str(sample.key_expr), sample.kind))
            if len(changes) == 1:
                daemon.stop()
    key = f"yawsitter/{daemon.instance}/alive"
    assert changes == [(key, zenoh.SampleKind.PUT), (key, zenoh.SampleKind.DELETE)]


def test_a_listener_that_never_reads_stops_or_dies_does_not_delay_the_loop(daemon, client, session) -> None:
    """Three listeners to everything: one never reads, one is halted, one is killed in the midst of it."""
    client.set("SIM_TLM_RATE", 250.0)
    loop_key = f"yawsitter/{daemon.instance}/loop"
    list(client.messages(3.0))
    alone = json.loads(ask(session, loop_key)[loop_key])  # the machine's own lateness
    listeners = [
        subprocess.Popen(
            [sys.executable, "-c", BAD_LISTENER, daemon.zenoh_endpoint, f"yawsitter/{daemon.instance}/**"],
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(3)
    ]
    try:
        for listener in listeners:
            assert listener.stdout.readline().strip() == "listening"
        before = json.loads(ask(session, loop_key)[loop_key])
        listeners[1].send_signal(signal.SIGSTOP)
        list(client.messages(3.0))
        listeners[2].kill()
        list(client.messages(12.0))
        after = json.loads(ask(session, loop_key)[loop_key])
    finally:
        for listener in listeners:
            listener.kill()
            listener.wait(10)
            listener.stdout.close()
    turns = after["turns"] - before["turns"]
    sent = after["telemetry_messages"] - before["telemetry_messages"]
    busy_ms = after["telemetry_busy_ms"] - before["telemetry_busy_ms"]
    assert busy_ms / turns < 1.0
    assert after["overruns"] - before["overruns"] < (alone["overruns"] / alone["turns"] + 0.05) * turns
    assert after["telemetry_worst_ms"] < 100.0
    assert after["slipped_s"] == before["slipped_s"]
    assert sent > 10_000  # it went on publishing all the while


def test_an_asker_that_never_reads_its_answers_does_not_delay_the_loop(daemon, client, session) -> None:
    key = f"yawsitter/{daemon.instance}/*"
    asker = subprocess.Popen(
        [sys.executable, "-c", BAD_ASKER, daemon.zenoh_endpoint, key], stdout=subprocess.PIPE, text=True
    )
    try:
        assert asker.stdout.readline().strip() == "listening"
        list(client.messages(4.0))
        asker.send_signal(signal.SIGSTOP)
        list(client.messages(3.0))
        after = json.loads(ask(session, f"yawsitter/{daemon.instance}/loop").popitem()[1])  # others are answered
        start_s = time.monotonic()
        assert daemon.stop() == 0
        assert time.monotonic() - start_s < 5.0
    finally:
        asker.kill()
        asker.wait(10)
        asker.stdout.close()
    assert after["telemetry_worst_ms"] < 100.0
    assert after["slipped_s"] == 0.0


def test_the_example_in_the_document_runs(daemon, client) -> None:
    document = (ROOT / "docs" / "telemetry.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", document, re.DOTALL)
    assert "tcp/127.0.0.1:7447" in example
    example = example.replace("tcp/127.0.0.1:7447", daemon.zenoh_endpoint)
    example = example.replace("yawsitter/0/", f"yawsitter/{daemon.instance}/")
    utf8 = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run([sys.executable, "-c", example], capture_output=True, text=True, env=utf8, timeout=30)
    assert done.returncode == 0, done.stderr
    first, *samples = done.stdout.splitlines()
    assert first == "mode hold disarmed"
    assert len(samples) == 100


def test_a_zenoh_port_in_use_is_one_line_and_status_2(daemon, client, tmp_path) -> None:
    own = ["--instance", str(daemon.instance + 50), "--state-dir", str(tmp_path / "second")]
    done = subprocess.run(
        command("run", *own, "--zenoh-endpoint", daemon.zenoh_endpoint),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=BOOT_LIMIT_S,
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert daemon.zenoh_endpoint in line
    assert "--no-zenoh" in line


def test_the_examples_subscriber_prints_where_the_vehicle_is(daemon, client) -> None:
    example = [sys.executable, "examples/zenoh_subscriber.py", daemon.zenoh_endpoint, str(daemon.instance), "3"]
    done = subprocess.run(example, cwd=ROOT, capture_output=True, text=True, timeout=30)
    assert done.returncode == 0, done.stderr
    poses = [[float(number) for number in re.findall(r"-?\d+\.\d+", line)] for line in done.stdout.splitlines()]
    assert len(poses) == 3
    for _, north, east, down, *q in poses:
        assert (north, east, down) == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
        assert sum(x * x for x in q) == pytest.approx(1.0, abs=5e-3)
