"""Where parameters and the plan outlive the process."""

import os
from pathlib import Path
from typing import Protocol

from sitl.atomic import atomically


class Store(Protocol):
    """Named blobs. `write` replaces a blob as a whole: a reader finds the old one or the new one, never a part."""

    def read(self, name: str) -> bytes | None: ...

    def write(self, name: str, data: bytes) -> None: ...

    def set_aside(self, name: str) -> None:
        """Move a blob that can't be read out of the way, without destroying it."""
        ...


class MemoryStore:
    """A store that lives as long as the process."""

    def __init__(self) -> None:
        self._blobs: dict[str, bytes] = {}

    def read(self, name: str) -> bytes | None:
        return self._blobs.get(name)

    def write(self, name: str, data: bytes) -> None:
        self._blobs[name] = data

    def set_aside(self, name: str) -> None:
        blob = self._blobs.pop(name, None)
        if blob is not None:
            self._blobs[f"{name}.damaged"] = blob


class FolderStore:
    """A store of files in one folder, made when first written to; who may read them, the umask says."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def read(self, name: str) -> bytes | None:
        try:
            return (self.folder / name).read_bytes()
        except FileNotFoundError:
            return None

    def write(self, name: str, data: bytes) -> None:
        atomically(self.folder / name, lambda to: to.write_bytes(data))

    def set_aside(self, name: str) -> None:
        path = self.folder / name
        if path.exists():
            os.replace(path, path.with_name(f"{name}.damaged"))


def reason(error: OSError) -> str:
    """What went wrong, in the operating system's words where it has some."""
    return error.strerror or str(error) or type(error).__name__


def put_aside(store: Store, name: str, error: Exception) -> str:
    """Move a blob aside that `error` kept from being read, if that is possible; says what has come of it."""
    if isinstance(error, OSError):  # it may be sound: it is just out of reach
        return f"not readable ({reason(error)})"
    try:
        store.set_aside(name)
    except OSError as second:
        return f"damaged, and not set aside ({reason(second)})"
    return "damaged: set aside"
