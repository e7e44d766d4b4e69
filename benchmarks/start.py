"""Start: from the process's birth to its first HEARTBEAT and to the first accepted arming, kernels cached."""

import socket
import time
from collections.abc import Iterator

from benchmarks.figure import Figure, at_most
from benchmarks.processes import LOCAL_ONBOARD, BenchmarkError, daemon, free_instance
from sitl.daemon.config import ONBOARD_PEER_LAST
from sitl.mavlink import codec
from sitl.mavlink.codec import mav

RUNS = 5
_LIMIT_S = 30.0
_ASK_S = 0.02  # between two tries to arm
_ARM = mav.MAV_CMD_COMPONENT_ARM_DISARM


def measure(quick: bool) -> Iterator[Figure]:
    _one_start()  # reads the files once and compiles what is not compiled yet
    heard, armed = zip(*(_one_start() for _ in range(RUNS)), strict=True)
    yield at_most("process start to first HEARTBEAT", heard, 1.0, "s")
    yield at_most("process start to arming accepted", armed, 2.5, "s")


def _one_start() -> tuple[float, float]:
    instance = free_instance()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", ONBOARD_PEER_LAST))
        peer.settimeout(_ASK_S)
        born_s = time.perf_counter()
        with daemon(instance):
            return _watch(peer, instance, born_s)


def _watch(peer: socket.socket, instance: int, born_s: float) -> tuple[float, float]:
    """Seconds to the first HEARTBEAT and to the first arming that is accepted."""
    parser, encoder = codec.Parser(), codec.Encoder(252, mav.MAV_COMP_ID_MISSIONPLANNER)
    arm = codec.message("COMMAND_LONG", target_system=instance + 1, target_component=1, command=_ARM, param1=1.0)
    heartbeat_s: float | None = None
    asked_s = born_s
    while (now_s := time.perf_counter()) < born_s + _LIMIT_S:
        if heartbeat_s is not None and now_s - asked_s >= _ASK_S:
            asked_s = now_s
            peer.sendto(encoder.encode(arm), ("127.0.0.1", LOCAL_ONBOARD + instance))
        try:
            data, (_, port) = peer.recvfrom(65_535)
        except TimeoutError:
            continue
        if port != LOCAL_ONBOARD + instance:
            continue  # all high instances send there
        now_s = time.perf_counter()
        for frame in parser.feed(data):
            if frame.name == "HEARTBEAT" and heartbeat_s is None:
                heartbeat_s = now_s - born_s
            accepted = frame.name == "COMMAND_ACK" and frame.message.result == mav.MAV_RESULT_ACCEPTED
            if accepted and frame.message.command == _ARM and heartbeat_s is not None:
                return heartbeat_s, now_s - born_s
    raise BenchmarkError(f"not armed {_LIMIT_S:g} s after its start")
