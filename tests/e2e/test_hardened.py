"""The real daemon flooded, signed, and over a bad link."""

import hashlib
import os
import re
import subprocess
import sys
import time

os.environ.setdefault("MAVLINK20", "1")

import pytest
from daemon_process import BOOT_LIMIT_S, ROOT, Client, Daemon
from pymavlink import mavutil

from benchmarks.flood import flood

pytestmark = pytest.mark.e2e


def test_a_flood_from_one_address_leaves_others_their_heartbeats_and_answers(tmp_path) -> None:
    with Daemon(tmp_path) as daemon:
        seen = flood(daemon.instance, 20_000, 4.0)
        assert daemon.stop() == 0
        assert ", 0 faults" in daemon.log
    assert seen.sent > 20_000  # of 80,000: a loaded machine sends fewer
    assert len(seen.beats_s) >= 2
    assert max(seen.beats_s) < 2.5  # 1.0 on an idle machine: benchmarks measure it
    assert seen.answered >= seen.asked - 1
    assert re.search(r"\d{3,} datagrams refused", daemon.log)


@pytest.fixture
def key_file(tmp_path):
    path = tmp_path / "flight.key"
    path.write_text(hashlib.sha256(b"a passphrase").hexdigest() + "\n")
    return path


def gcs(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gcs_tools", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=BOOT_LIMIT_S + 60)


def where(daemon: Daemon) -> tuple[str, ...]:
    return ("--connect", f"udpout:127.0.0.1:{18570 + daemon.instance}", "--system", str(daemon.instance + 1))


def test_a_signed_daemon_serves_who_has_the_key_and_tells_who_has_not(tmp_path, key_file) -> None:
    with Daemon(tmp_path, "--signing-key", str(key_file)) as daemon:
        Client(daemon).until_ready()
        key = ("--signing-key", str(key_file))
        done = gcs("param", "set", "RATE_Y_P", "0.25", *where(daemon), *key)
        assert (done.returncode, done.stdout) == (0, "RATE_Y_P = 0.25\n"), done.stderr
        done = gcs("param", "get", "RATE_Y_P", *where(daemon))
        assert done.returncode == 1
        assert "--signing-key" in done.stderr

        link = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{18570 + daemon.instance}", source_system=254, dialect="common"
        )
        link.setup_signing(hashlib.sha256(b"a passphrase").digest(), sign_outgoing=True)
        end_s = time.monotonic() + 20.0
        accepted = False
        while not accepted and time.monotonic() < end_s:
            link.mav.command_long_send(daemon.instance + 1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
            ack = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=1.0)
            accepted = ack is not None and ack.command == 400 and ack.result == 0
        link.close()
        assert accepted
        assert daemon.stop() == 0
    saved = int((daemon.state_dir / "signing-stamp").read_text())
    assert abs(saved / 1e5 + 1_420_070_400 - time.time()) < 120.0
    assert key_file.read_text().strip() not in daemon.log


def test_a_key_file_that_holds_no_key_is_one_line_and_status_2(tmp_path) -> None:
    (tmp_path / "key").write_text("open sesame")
    with Daemon(tmp_path, "--signing-key", str(tmp_path / "key")) as daemon:
        assert daemon.process.wait(BOOT_LIMIT_S) == 2
        (line,) = daemon.log.splitlines()
    assert "64 hexadecimal digits" in line
    assert str(tmp_path / "key") in line


def test_the_tools_work_over_an_impaired_socket(tmp_path) -> None:
    bad = ("--impair", "loss=0.2,dup=0.05,jitter=0.1,seed=3")
    with Daemon(tmp_path) as daemon:
        Client(daemon).until_ready()
        done = gcs("param", "set", "RATE_Y_P", "0.25", *where(daemon), *bad)
        assert (done.returncode, done.stdout) == (0, "RATE_Y_P = 0.25\n"), done.stderr
        done = gcs("takeoff", "--height", "2", "--wait", *where(daemon), *bad)
        assert (done.returncode, done.stdout) == (0, "hovering\n"), done.stderr
        done = gcs("hold", *where(daemon), "--impair", "loss=2")
        assert done.returncode == 2
        assert "loss=0..0.95" in done.stderr


@pytest.mark.parametrize("identity", ["px4", "generic"])
def test_pymavlinks_own_tools_read_mode_type_and_arming(tmp_path, identity) -> None:
    with Daemon(tmp_path, "--identity", identity) as daemon:
        client = Client(daemon)
        client.until_ready()
        link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{18570 + daemon.instance}", dialect="development")
        modes = {"LOITER": (4, 3), "RTL": (4, 5), "LAND": (4, 6), "POSCTL": (3, 0)}
        names = {name: name if identity == "px4" else f"Mode({a << 16 | b << 24})" for name, (a, b) in modes.items()}
        link.mav.heartbeat_send(6, 8, 0, 0, 0)
        assert link.wait_heartbeat(timeout=10.0).type == 19
        for name, (main, sub) in modes.items():
            client.command(176, 1, main, sub)
            end_s = time.monotonic() + 10.0
            while link.flightmode != names[name] and time.monotonic() < end_s:
                link.mav.heartbeat_send(6, 8, 0, 0, 0)
                link.recv_match(type="HEARTBEAT", blocking=True, timeout=1.0)
            assert link.flightmode == names[name]
        client.command(176, 1, 4, 3)
        client.command(400, 1)
        link.motors_armed_wait()
        link.close()
        client.close()
