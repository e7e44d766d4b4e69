"""The .tlog of a run: for every frame that passes, 8 bytes of wall time (µs since 1970, big-endian) and the frame."""

import struct
import time
from pathlib import Path

from sitl.daemon.config import SettingError

_STAMP = struct.Struct(">Q")


class Recorder:
    """Writes frames to a new file in `folder`."""

    def __init__(self, folder: Path, instance: int, unix_s: float) -> None:
        stamp = time.strftime("%Y-%m-%d_%H-%M-%S", time.gmtime(unix_s))
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.path, self._file = next(
                (path, path.open("xb"))
                for k in range(1000)
                if not (path := folder / f"{stamp}Z_instance-{instance}{f'_{k}' if k else ''}.tlog").exists()
            )
        except OSError as error:
            raise SettingError(f"--record {folder}: {error.strerror}") from None

    def frame(self, frame: bytes, unix_s: float) -> None:
        self._file.write(_STAMP.pack(int(unix_s * 1e6)) + frame)

    def close(self) -> None:
        self._file.close()
