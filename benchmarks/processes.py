"""The real daemon, its clients and its listeners as processes of their own, on loopback, ended when done with."""

import contextlib
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from gcs_tools.client import Client, Script
from gcs_tools.impairment import GOOD, Impairment
from gcs_tools.link import UdpLink, parse_connection

T = TypeVar("T")

ROOT = Path(__file__).resolve().parents[1]
INSTANCES = range(70, 90)  # away from those in daily use
LOCAL_GCS, LOCAL_ONBOARD, ZENOH = 18570, 14580, 7447
_STOP_S = 5.0


class BenchmarkError(Exception):
    """A figure that could not be measured; the message says why in one line."""


def free_instances(count: int) -> list[int]:
    """Instances none of whose ports is in use. Raises BenchmarkError."""
    found = []
    for instance in INSTANCES:
        ports = (LOCAL_GCS + instance, LOCAL_ONBOARD + instance)
        if all(map(_free, ports)) and not _answers(ZENOH + instance):
            found.append(instance)
            if len(found) == count:
                return found
    raise BenchmarkError(f"the ports of instances {INSTANCES.start} to {INSTANCES.stop - 1} are nearly all in use")


def free_instance() -> int:
    """One such instance."""
    return free_instances(1)[0]


def _free(port: int) -> bool:
    """Whether this UDP port can be listened on."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def _answers(port: int) -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.2)
        return probe.connect_ex(("127.0.0.1", port)) == 0


def start(module: str, *arguments: str, **options: Any) -> subprocess.Popen[str]:
    """`python -m module arguments…` in the background."""
    command = [sys.executable, "-m", module, *arguments]
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "stdin": subprocess.DEVNULL, **options}
    return subprocess.Popen(command, cwd=ROOT, text=True, **streams)


def stop(process: subprocess.Popen[str]) -> None:
    """End a process that `start` began."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextlib.contextmanager
def running(process: subprocess.Popen[str]) -> Iterator[subprocess.Popen[str]]:
    """A process for the length of a block."""
    try:
        yield process
    finally:
        stop(process)


@contextlib.contextmanager
def daemon(instance: int, *options: str, logs: Mapping[str, bytes] | None = None) -> Iterator[subprocess.Popen[str]]:
    """`sitl run` with a state folder of its own, in which there are `logs`."""
    with tempfile.TemporaryDirectory(prefix="yawsitter-benchmark-") as state:
        for name, data in (logs or {}).items():
            (Path(state) / "logs").mkdir(exist_ok=True)
            (Path(state) / "logs" / name).write_bytes(data)
        arguments = ("run", "--instance", str(instance), "--state-dir", state, *options)
        with running(start("sitl", *arguments)) as process:
            yield process


def onboard(instance: int) -> str:
    """The connection of a client that calls this instance as an onboard computer."""
    return f"udpout:127.0.0.1:{LOCAL_ONBOARD + instance}"


def ground(instance: int) -> str:
    """The connection of a client that calls this instance's port for ground stations."""
    return f"udpout:127.0.0.1:{LOCAL_GCS + instance}"


def converse(connection: str, system: int, talk: Callable[[Client], Script[T]], impairment: Impairment = GOOD) -> T:
    """Run a script over UDP once the vehicle is heard, and return its result. Raises LinkError."""
    client = Client(system)
    with UdpLink(parse_connection(connection), impairment) as link:
        client.start(_connected(client, talk))
        link.run(client)
    result: T = client.result
    return result


def _connected(client: Client, talk: Callable[[Client], Script[T]]) -> Script[T]:
    yield from client.connect()
    return (yield from talk(client))


@contextlib.contextmanager
def listener(endpoint: str, manner: str) -> Iterator[subprocess.Popen[str]]:
    """A Zenoh subscriber (see listener.py) for the length of a block, from when it has subscribed."""
    process = start("benchmarks.listener", endpoint, manner, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert process.stdout is not None
        if process.stdout.readline().strip() != "ready":
            raise BenchmarkError(f"no Zenoh session with {endpoint}")
        yield process
    finally:
        process.kill()  # it may be stopped, or stuck in a full queue on purpose
        process.communicate()


def zenoh_endpoint(instance: int) -> str:
    return f"tcp/127.0.0.1:{ZENOH + instance}"
