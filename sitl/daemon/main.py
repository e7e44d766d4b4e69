"""`sitl run` and `sitl swarm`: sockets and boot heartbeats first, then the vehicles, then the loop until the end."""

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from sitl.daemon import config as settings
from sitl.daemon import recorder as recording
from sitl.daemon.boot import Boot
from sitl.daemon.config import Place, RunConfig, SettingError, Setup
from sitl.daemon.lock import StateLock
from sitl.daemon.recorder import Recorder
from sitl.daemon.udp import Sockets
from sitl.mavlink.identity import Identity
from sitl.mavlink.signing import KeyFileError, Signer, after_restart, read_key
from sitl.onboard.store import FolderStore, Store

if TYPE_CHECKING:
    from sitl.daemon.assembly import Built

log = logging.getLogger("sitl")

BOOT_TURN_S = 0.02
STAMP_FILE = "signing-stamp"


def wall_clock() -> Callable[[], float]:
    """Seconds since 1970 as they were at start, from then on by the monotonic clock: they never jump."""
    offset_s = time.time() - time.monotonic()
    monotonic = time.monotonic
    return lambda: offset_s + monotonic()


class Stop:
    """Set by Ctrl-C and SIGTERM; a second Ctrl-C ends the process the hard way."""

    def __init__(self) -> None:
        self.requested = False
        signal.signal(signal.SIGINT, self._request)
        signal.signal(signal.SIGTERM, self._request)

    def _request(self, number: int, _: FrameType | None) -> None:
        if self.requested:
            signal.signal(number, signal.SIG_DFL)
        self.requested = True

    def __call__(self) -> bool:
        return self.requested


class Construction(threading.Thread):
    """Imports and builds the vehicles while the main thread keeps up the heartbeats."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(name="construction", daemon=True)
        self.built: Built | None = None
        self.failure: BaseException | None = None
        self._setup = setup

    def run(self) -> None:
        try:
            from sitl.daemon import assembly

            self.built = assembly.build(self._setup)
        except BaseException as failure:
            self.failure = failure


def _locked(folder: Path) -> StateLock:
    """The state folder as ours alone, and one that can be written to. Raises SettingError."""
    lock = StateLock(folder)
    if not os.access(folder, os.W_OK | os.X_OK):
        lock.close()
        raise SettingError(f"--state-dir {folder}: not writable")
    return lock


def _signer(config: RunConfig, store: Store) -> Signer | None:
    """The key of the settings, if they have one, with the stamp that its last use came to. Raises SettingError."""
    if config.signing_key is None:
        return None
    try:
        key = read_key(config.signing_key)
    except KeyFileError as error:
        raise SettingError(f"--signing-key {error}") from None

    def save(stamp: int) -> None:
        try:
            store.write(STAMP_FILE, b"%d\n" % stamp)
        except OSError as error:
            log.error("the signatures' time stamp is not saved: %s", error.strerror)

    saved = store.read(STAMP_FILE) or b""
    return Signer(key, after_restart(int(saved)) if saved.strip().isdigit() else 0, save)


def main(setup: Setup, verbose: bool = False) -> int:
    """Run until told to stop; returns the exit status. Raises SettingError for settings that can't be used."""
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", level=logging.INFO, stream=sys.stderr)
    if verbose:
        log.setLevel(logging.DEBUG)
    setup = settings.check(setup).resolved()
    config = setup.first
    stop = Stop()
    clock = wall_clock()
    folders = [vehicle.state_dir for vehicle in setup.vehicles if vehicle.state_dir is not None]
    signer = _signer(config, FolderStore(folders[0]))
    sockets: Sockets[Place] = Sockets(setup.sockets, config.instance)
    boot: Boot[Place] = Boot(sockets, Identity(config.identity), setup.voices, setup.static_peers, signer)
    boot.turn(clock())
    recorders: list[Recorder] = []
    locks: list[StateLock] = []
    construction = Construction(setup)
    try:
        for folder in folders:
            locks.append(_locked(folder))
        recorders = recording.start(setup.vehicles)
        construction.start()
        while construction.is_alive() and not stop():
            boot.turn(clock())
            sockets.wait(BOOT_TURN_S)
        if construction.is_alive():
            # no orderly way out of a thread that compiles; nothing is written yet
            logging.shutdown()
            os._exit(0)
        if construction.failure is not None:
            raise construction.failure
        assert construction.built is not None
        _fly(setup, construction.built, sockets, recorders, boot, stop, clock, signer)
    finally:
        if construction.built is not None:
            construction.built.close()
        recording.close(recorders)
        for lock in locks:
            lock.close()
        sockets.close()
    return 0


def _fly(
    setup: Setup,
    built: "Built",
    sockets: Sockets[Place],
    recorders: Sequence[Recorder],
    boot: Boot[Place],
    stop: Stop,
    clock: Callable[[], float],
    signer: Signer | None,
) -> None:
    """The loop, again for each reboot of a lone vehicle, until it ends."""
    from sitl.daemon import assembly
    from sitl.daemon.loop import Ending

    vehicles = built.vehicles
    log.info("%s", assembly.banner(setup, vehicles[0], built.session is not None))
    while True:
        loop = assembly.build_loop(setup, vehicles, sockets, built.publishers, recorders, clock, signer)
        assembly.introduce(loop, boot, clock())
        assembly.settle_garbage()
        ending = loop.run(stop)
        figures = loop.figures()
        log.info(
            "%s after %.1f s simulated; %d turns, %d late by more than one, the worst by %.1f ms, %d faults",
            ending.value,
            figures.now_us * 1e-6,
            figures.turns,
            figures.overruns,
            figures.worst_late_ms,
            figures.faults,
        )
        if ending is not Ending.REBOOT:
            return
        vehicles = [assembly.build_vehicle(setup.first)]
