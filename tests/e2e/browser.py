"""The viewer in a process of its own and a real headless Chromium that looks at it, for the tests in this folder."""

import contextlib
import io
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from daemon_process import ROOT

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or "/usr/bin/chromium"
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync",
)  # fmt: skip
START_LIMIT_S = 30.0
LIMIT_S = 20.0
SIZE = (1280, 720)


def _why_not() -> str:
    """What is missing to look at a page; empty: nothing."""
    if not Path(CHROMIUM).exists():
        return "there is no Chromium on this machine (on Debian: apt install chromium)"
    for package in ("viser", "playwright"):
        try:
            __import__(package)
        except ImportError:
            return f"the package {package} is missing: pip install 'yawsitter-sitl[test]'"
    return ""


needs_browser = pytest.mark.skipif(bool(_why_not()), reason=_why_not())


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Viewer:
    """`gcs view`; what it prints goes to a file."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.port = free_port()
        self.log_path = folder / f"viewer-{time.monotonic_ns()}.txt"
        with self.log_path.open("w") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "gcs_tools", "view", "--port", str(self.port), *arguments],
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                cwd=ROOT,
                env={**os.environ, "PYTHONUNBUFFERED": "1"},
            )

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def log(self) -> str:
        return self.log_path.read_text()

    def until_serving(self) -> None:
        def serves() -> bool:
            assert self.process.poll() is None, f"the viewer ended:\n{self.log}"
            return self.url in self.log

        until(serves, f"the viewer serves; it said:\n{self.log}", START_LIMIT_S)

    def __enter__(self) -> "Viewer":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(20)


def until(true: Callable[[], Any], what: str, limit_s: float = LIMIT_S) -> Any:
    """Wait until it is true; what it gave then."""
    end_s = time.monotonic() + limit_s
    while not (result := true()):
        assert time.monotonic() < end_s, f"not within {limit_s:g} s: {what}"
        time.sleep(0.1)
    return result


@contextlib.contextmanager
def chromium() -> Iterator[Any]:
    """A headless browser with nothing in it."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        try:
            yield browser
        finally:
            browser.close()


@contextlib.contextmanager
def looking_at(browser: Any, url: str, size: tuple[int, int] = SIZE, sharpness: float = 1.0) -> Iterator[Any]:
    """A browser page that shows `url`, from when the page is drawn. Its script errors fail the test at the end.

    sharpness: pixels drawn for each of the page's; below 1 the scene, drawn without a graphics card, costs less.
    """
    page = browser.new_page(viewport={"width": size[0], "height": size[1]}, device_scale_factor=sharpness)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    try:
        page.goto(url)
        page.locator("canvas").first.wait_for()
        yield page
    finally:
        page.close()
    assert errors == []


def text_of(page: Any) -> str:
    """All text that can be read on the page."""
    return str(page.locator("body").inner_text())


def row_of(page: Any, label: str) -> list[float]:
    """The numbers behind a label in the read-outs; empty before there are any."""
    for line in text_of(page).splitlines():
        words = line.split()
        if words[:1] == [label]:
            return [float(word) for word in words[1:] if word.lstrip("-").replace(".", "", 1).isdigit()]
    return []


def picture(page: Any) -> Any:
    """The page as it looks, as a PIL image."""
    from PIL import Image

    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def share_changed(before: Any, after: Any) -> float:
    """How much of two pictures of one size differs clearly, 0 … 1."""
    from PIL import ImageChops

    difference = ImageChops.difference(before, after).convert("L")
    return sum(difference.histogram()[24:]) / (difference.width * difference.height)
