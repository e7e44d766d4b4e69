"""MAVProxy without windows, as a process: commands into its standard input, what it says out of its standard output."""

import os
import re
import subprocess
import sys
import sysconfig
import threading
import time
from pathlib import Path

ANSWER_S = 30.0
REPEAT_S = 6.0
POLL_S = 0.5
STANDARD_MODULES = (
    *("adsb", "arm", "auxopt", "battery", "calibration", "cmdlong", "fence", "ftp", "layout", "link", "log", "misc"),
    *("mode", "output", "param", "rally", "rc", "relay", "signing", "terrain", "tuneopt", "wp"),
)


class MavProxy:
    """Connected to a UDP port; the folder is its home."""

    def __init__(self, port: int, folder: Path) -> None:
        program = Path(sysconfig.get_path("scripts")) / "mavproxy.py"
        master = f"udpout:127.0.0.1:{port}"
        self._process = subprocess.Popen(
            [sys.executable, str(program), "--master", master, "--no-state", "--nowait", "--streamrate", "2"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            bufsize=1,
            cwd=folder,
            env={**os.environ, "HOME": str(folder), "PYTHONUNBUFFERED": "1"},
        )
        self._said = ""
        self._read = 0  # up to here it was waited for
        self._news = threading.Condition()
        self._reader = threading.Thread(target=self._listen)
        self._reader.start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._news:
                self._said += line
                self._news.notify()

    @property
    def said(self) -> str:
        """Everything so far."""
        return self._said

    def type(self, line: str) -> None:
        """A line, whatever comes of it."""
        assert self._process.stdin is not None
        with self._news:
            self._read = len(self._said)
        self._process.stdin.write(line + "\n")

    def command(self, line: str, answer: str, *events: str, repeat_s: float = REPEAT_S) -> "re.Match[str]":
        """Type a line, again if the answer stays away: datagrams get lost on a busy machine. Then wait for the events.

        Answer and events are regular expressions; returns the last one's match.
        """
        end_s = time.monotonic() + ANSWER_S
        while True:
            self.type(line)
            try:
                found = self.hear(answer, repeat_s)
                break
            except AssertionError:
                if time.monotonic() > end_s:
                    raise
        for event in events:
            found = self.hear(event)
        return found

    def poll(self, line: str, answer: str) -> None:
        """Type a line until it shows what it should."""
        self.command(line, answer, repeat_s=POLL_S)

    def hear(self, pattern: str, limit_s: float = ANSWER_S) -> "re.Match[str]":
        """What fits first in what it says from here on."""
        expression, end_s = re.compile(pattern, re.MULTILINE), time.monotonic() + limit_s
        with self._news:
            while (found := expression.search(self._said, self._read)) is None:
                left_s = end_s - time.monotonic()
                if left_s <= 0.0 or self._process.poll() is not None:
                    tail = self._said[-3000:]
                    raise AssertionError(f"MAVProxy did not say /{pattern}/ in {limit_s:g} s; it said:\n{tail}")
                self._news.wait(min(left_s, 0.5))
            self._read = found.end()
        return found

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
