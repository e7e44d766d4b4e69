"""`gcs watch` in a real terminal, before a real daemon."""

import re
import signal
from pathlib import Path

import pytest
from daemon_process import Client, Daemon
from terminal import Terminal

pytestmark = pytest.mark.e2e


def test_the_dashboard_outlives_a_resize_and_a_lost_vehicle_and_gives_the_terminal_back(
    tmp_path: Path,
) -> None:
    with Daemon(tmp_path) as daemon:
        client = Client(daemon)
        client.until_ready()
        client.close()
        endpoint = f"udpout:127.0.0.1:{18570 + daemon.instance}"
        with Terminal("watch", "--connect", endpoint, NO_COLOR="1") as terminal:
            screen = terminal.until(lambda screen: " trip " in screen and "ready" in screen and "N ▕" in screen)
            assert re.search(r"yawsitter · system \d+ +HOLD +disarmed +on the ground", screen)
            assert re.search(r"position +-?0\.0\d\d +-?0\.0\d\d +-?0\.0\d\d m", screen)
            terminal.resize(140, 40)
            terminal.until(lambda screen: "map · north up" in screen)
            daemon.process.send_signal(signal.SIGSTOP)
            terminal.until(lambda screen: "LOST for 0:0" in screen)
            daemon.process.send_signal(signal.SIGCONT)
            terminal.until(lambda screen: "LOST" not in screen)
            terminal.press("\x03")
            assert terminal.end() == 130
            assert terminal.said == ""
            styles = set(b";".join(re.findall(rb"\x1b\[([0-9;]*)m", terminal.output)).split(b";"))
            assert styles <= {b"0", b"1", b"2", b"7"}  # plain, bold, dim, reverse


def test_who_watches_nobody_is_told_so() -> None:
    with Terminal("watch", "--connect", "udpout:127.0.0.1:1") as terminal:
        terminal.until(lambda screen: "waiting for a vehicle at udpout:127.0.0.1:1" in screen)
        terminal.press("q")
        assert terminal.end() == 1
        assert terminal.said.strip() == "gcs watch: no vehicle was heard at udpout:127.0.0.1:1"
