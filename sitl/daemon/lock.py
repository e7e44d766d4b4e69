"""One daemon per state folder: two that write the same parameters and plan would undo each other's changes."""

import os
import sys
from pathlib import Path

from sitl.daemon.config import SettingError

NAME = "lock"


class StateLock:
    """Held from construction to `close`, or to the end of the process however it ends. Raises SettingError."""

    def __init__(self, folder: Path) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = os.open(folder / NAME, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise SettingError(f"--state-dir {folder}: {error.strerror}") from None
        try:
            _lock(self._file)
        except OSError:
            holder = os.read(self._file, 20).decode("ascii", "replace").strip()
            os.close(self._file)
            raise SettingError(
                f"--state-dir {folder} is in use by another vehicle{f' (process {holder})' if holder else ''}: "
                "give each its own, with --state-dir or --instance"
            ) from None
        os.truncate(self._file, 0)
        os.write(self._file, f"{os.getpid()}\n".encode())

    def close(self) -> None:
        os.close(self._file)


if sys.platform == "win32":
    import msvcrt

    _PLACE = 1 << 20  # far behind the text: what is locked can't be read by others there

    def _lock(file: int) -> None:
        os.lseek(file, _PLACE, os.SEEK_SET)
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        finally:
            os.lseek(file, 0, os.SEEK_SET)

else:
    import fcntl

    def _lock(file: int) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
