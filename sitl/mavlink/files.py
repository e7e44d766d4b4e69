"""The files that the link shows, whatever they are kept in.

An area is one tree of files. `Files` hangs areas side by side under names, as the folders of one root, and is where
paths from the link are taken apart: none leads out of its area, and none changes what is only to be read. What fails is
an OSError with the errno that a file system would give.
"""

import errno
import os
from collections.abc import Mapping
from typing import NamedTuple, NoReturn, Protocol

Path = tuple[str, ...]  # names from an area's root, which is ()


class Entry(NamedTuple):
    """What a folder holds under a name."""

    name: str
    size: int | None  # bytes, None: a folder
    changed_s: float = 0.0  # seconds since 1970


class OpenFile(Protocol):
    """A file in use. It is read as it is now; `size` may grow while somebody else writes."""

    @property
    def size(self) -> int: ...
    def read(self, offset: int, count: int) -> bytes: ...
    def write(self, offset: int, data: bytes) -> None: ...
    def close(self) -> None: ...


class Area(Protocol):
    def entries(self, path: Path) -> list[Entry]:
        """What a folder holds, by name."""
        ...

    def open(self, path: Path) -> OpenFile:
        """To read."""
        ...

    def create(self, path: Path, *, empty: bool) -> OpenFile:
        """To write; an old file is emptied first, or not."""
        ...

    def truncate(self, path: Path, size: int) -> None: ...
    def remove(self, path: Path) -> None: ...
    def make_folder(self, path: Path) -> None: ...
    def remove_folder(self, path: Path) -> None: ...
    def rename(self, path: Path, new: Path) -> None: ...


def fail(number: int) -> NoReturn:
    """Raise the OSError (FileNotFoundError, …) of an errno."""
    raise OSError(number, os.strerror(number))


class Mount(NamedTuple):
    area: Area
    writable: bool


class Files:
    """Areas as folders of one root, for clients that name files by text."""

    def __init__(self, mounts: Mapping[str, Mount]) -> None:
        self._mounts = mounts

    def entries(self, text: str) -> list[Entry]:
        if not _names(text):
            return [Entry(name, None) for name in sorted(self._mounts)]
        mount, path = self._find(text)
        return mount.area.entries(path)

    def open(self, text: str) -> OpenFile:
        mount, path = self._find(text)
        return mount.area.open(path)

    def create(self, text: str, *, empty: bool) -> OpenFile:
        area, path = self._writable(text)
        return area.create(path, empty=empty)

    def truncate(self, text: str, size: int) -> None:
        area, path = self._writable(text)
        area.truncate(path, size)

    def remove(self, text: str) -> None:
        area, path = self._writable(text)
        area.remove(path)

    def make_folder(self, text: str) -> None:
        area, path = self._writable(text)
        area.make_folder(path)

    def remove_folder(self, text: str) -> None:
        area, path = self._writable(text)
        area.remove_folder(path)

    def rename(self, text: str, new: str) -> None:
        (area, path), (new_area, new_path) = self._writable(text), self._writable(new)
        if new_area is not area:
            fail(errno.EXDEV)
        area.rename(path, new_path)

    def _find(self, text: str) -> tuple[Mount, Path]:
        names = _names(text)
        if not names:
            fail(errno.EISDIR)
        if names[0] not in self._mounts:
            fail(errno.ENOENT)
        return self._mounts[names[0]], names[1:]

    def _writable(self, text: str) -> tuple[Area, Path]:
        names = _names(text)
        if len(names) < 2 or not (names[0] in self._mounts and self._mounts[names[0]].writable):
            fail(errno.EACCES)  # the root, an area's own folder, or what is only to be read
        return self._mounts[names[0]].area, names[1:]


def _names(text: str) -> Path:
    names = tuple(name for name in text.split("/") if name not in ("", "."))
    if ".." in names:
        fail(errno.EACCES)
    return names


class MemoryArea:
    """Files that live as long as the process; at most `capacity` bytes in all."""

    def __init__(self, files: Mapping[Path, bytes] | None = None, capacity: int = 1 << 24) -> None:
        self._files = {path: bytearray(data) for path, data in (files or {}).items()}
        self._folders: set[Path] = {path[:k] for path in self._files for k in range(len(path))} | {()}
        self._capacity = capacity

    def entries(self, path: Path) -> list[Entry]:
        self._need_folder(path)
        found = [Entry(p[-1], len(data)) for p, data in self._files.items() if p[:-1] == path]
        return sorted(found + [Entry(p[-1], None) for p in self._folders if p and p[:-1] == path])

    def open(self, path: Path) -> OpenFile:
        return _MemoryFile(self, self._find(path))

    def create(self, path: Path, *, empty: bool) -> OpenFile:
        self._need_folder(path[:-1])
        if path in self._folders:
            fail(errno.EISDIR)
        data = self._files.setdefault(path, bytearray())
        if empty:
            data.clear()
        return _MemoryFile(self, data)

    def truncate(self, path: Path, size: int) -> None:
        self.resize(self._find(path), size)

    def remove(self, path: Path) -> None:
        self._find(path)
        del self._files[path]

    def make_folder(self, path: Path) -> None:
        self._need_folder(path[:-1])
        self._need_free(path)
        self._folders.add(path)

    def remove_folder(self, path: Path) -> None:
        if self.entries(path):
            fail(errno.ENOTEMPTY)
        self._folders.discard(path)

    def rename(self, path: Path, new: Path) -> None:
        self._need_folder(new[:-1])
        self._need_free(new)
        if path in self._folders:
            if new[: len(path)] == path:
                fail(errno.EINVAL)  # into itself
            inside = len(path)
            self._folders = {new + p[inside:] if p[:inside] == path else p for p in self._folders}
            self._files = {new + p[inside:] if p[:inside] == path else p: d for p, d in self._files.items()}
        else:
            self._files[new] = self._find(path)
            del self._files[path]

    def resize(self, data: bytearray, size: int) -> None:
        """Cut a file off or fill it up with zeros."""
        if size - len(data) > self._capacity - sum(map(len, self._files.values())):
            fail(errno.ENOSPC)
        data[size:] = bytes(max(0, size - len(data)))

    def _find(self, path: Path) -> bytearray:
        if path in self._folders:
            fail(errno.EISDIR)
        if path not in self._files:
            fail(errno.ENOENT)
        return self._files[path]

    def _need_folder(self, path: Path) -> None:
        if path not in self._folders:
            fail(errno.ENOTDIR if path in self._files else errno.ENOENT)

    def _need_free(self, path: Path) -> None:
        if path in self._files or path in self._folders:
            fail(errno.EEXIST)


class _MemoryFile:
    def __init__(self, area: MemoryArea, data: bytearray) -> None:
        self._area, self._data = area, data

    @property
    def size(self) -> int:
        return len(self._data)

    def read(self, offset: int, count: int) -> bytes:
        return bytes(self._data[offset : offset + count])

    def write(self, offset: int, data: bytes) -> None:
        if offset + len(data) > len(self._data):
            self._area.resize(self._data, offset + len(data))
        self._data[offset : offset + len(data)] = data

    def close(self) -> None:
        pass
