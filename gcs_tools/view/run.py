"""`gcs view`: put source and page together, and run them until Ctrl-C."""

import argparse
import contextlib
import importlib.util
import io
import logging
import socket
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sitl.strict_yaml import ConfigError

TURN_S = 1.0 / 30.0  # between two updates of the page


def run(args: argparse.Namespace) -> None:
    """Raises ConfigError, KeyboardInterrupt."""
    _need("viser")
    from gcs_tools.view.page import Page
    from gcs_tools.view.panels import Panels, missions_of
    from gcs_tools.view.pilot_thread import Pilots

    missions = missions_of(Path("missions"), args.mission)
    with contextlib.ExitStack() as stack:
        source = _recording(args.file) if args.file is not None else _live(args)
        stack.callback(source.close)
        server = open_server(args.host, args.port)
        stack.callback(server.stop)
        page = Page(server, source)
        if page.live:
            pilots = Pilots(args.mavlink, args.signing_key)
            stack.callback(pilots.close)
            Panels(page, pilots, missions)
        print(f"gcs view: http://{args.host}:{args.port}  {source.status.text}", flush=True)
        turn(page)


def turn(page: Any) -> None:
    """Update the page at even times; what can't be kept is left out."""
    due_s = time.monotonic()
    while True:
        page.tick(time.monotonic())
        due_s = max(due_s + TURN_S, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))


def _need(package: str) -> None:
    if importlib.util.find_spec(package) is None:
        raise ConfigError(f"the page needs the package {package}: pip install 'yawsitter-sitl[view]'")


def _live(args: argparse.Namespace) -> Any:
    from gcs_tools.view.feed import Feed, FeedError, endpoint_of

    instances = args.instance or ([] if args.connect else [0])
    try:
        return Feed(args.connect or [endpoint_of(k) for k in instances], args.instance or [])
    except FeedError as error:
        raise ConfigError(f"--connect: {error}") from None


def _recording(path: Path) -> Any:
    from gcs_tools.view.replay import Replay

    _need("mcap")
    return Replay.load(path)


def open_server(host: str, port: int) -> Any:
    """viser's server, quietly. Raises ConfigError where the port can't be had."""
    import viser

    try:
        with socket.create_server((host, port)):
            pass
    except OverflowError:
        raise ConfigError(f"--port {port}: a port is 1 to 65535") from None
    except OSError as error:
        reason = "is taken" if error.errno == 98 else f"can't be used: {error.strerror}"
        raise ConfigError(f"{host}:{port} {reason}; choose another with --port") from None
    for name in ("websockets", "websockets.server"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # a browser that goes away is no error
    warnings.filterwarnings("ignore", "Queued a", UserWarning)  # nor is what was on its way to it
    with _quiet():
        server = viser.ViserServer(host, port, label="YawSitter", verbose=False)
    if server.get_port() != port:  # somebody was quicker
        server.stop()
        raise ConfigError(f"{host}:{port} is taken; choose another with --port")
    return server


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """viser prints its addresses in a box, whatever it is told."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
