"""A folder on disk as an area of the link's files."""

import errno
import os
import stat
from collections.abc import Callable
from pathlib import Path as DiskPath

from sitl.mavlink.files import Entry, OpenFile, Path, fail

# no links, no waiting for somebody at a pipe's other end, no translation of line ends: as far as the system knows these
_FLAGS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


class FolderArea:
    """The files of `folder`, which is made when first written to. Links in it are not followed and not shown.

    capacity: bytes that may be in it in all. in_use: of a name in the folder itself, whether it must stay.
    """

    def __init__(
        self, folder: DiskPath, capacity: int = 1 << 24, in_use: Callable[[str], bool] = lambda _name: False
    ) -> None:
        self._folder = folder
        self._capacity = capacity
        self._in_use = in_use
        self._used: int | None = None  # bytes; None: to be counted

    def entries(self, path: Path) -> list[Entry]:
        place = self._place(path)
        if not path and not place.exists():
            return []
        found = []
        for item in os.scandir(place):
            s = item.stat(follow_symlinks=False)
            if stat.S_ISREG(s.st_mode):
                found.append(Entry(item.name, s.st_size, s.st_mtime))
            elif stat.S_ISDIR(s.st_mode):
                found.append(Entry(item.name, None, s.st_mtime))
        return sorted(found)

    def open(self, path: Path) -> OpenFile:
        return _DiskFile(self, self._place(path), os.O_RDONLY)

    def create(self, path: Path, *, empty: bool) -> OpenFile:
        if len(path) == 1:
            self._folder.mkdir(parents=True, exist_ok=True)
        file = _DiskFile(self, self._place(path), os.O_RDWR | os.O_CREAT)
        if empty:
            file.cut(0)
        return file

    def truncate(self, path: Path, size: int) -> None:
        file = _DiskFile(self, self._place(path), os.O_RDWR)
        try:
            file.cut(size)
        finally:
            file.close()

    def remove(self, path: Path) -> None:
        if self._in_use(path[0]):
            fail(errno.EBUSY)
        self._used = None
        self._place(path).unlink()

    def make_folder(self, path: Path) -> None:
        self._place(path).mkdir(parents=len(path) == 1)

    def remove_folder(self, path: Path) -> None:
        self._place(path).rmdir()

    def rename(self, path: Path, new: Path) -> None:
        place, new_place = self._place(path), self._place(new)
        if os.path.lexists(new_place):
            fail(errno.EEXIST)
        place.rename(new_place)

    def take(self, size: int) -> None:
        """Let a file grow by so many bytes (below zero: it shrinks), if there is room."""
        if self._used is None:
            self._used = sum(f.stat().st_size for f in self._folder.rglob("*") if f.is_file())
        if size > 0 and self._used + size > self._capacity:
            fail(errno.ENOSPC)
        self._used += size

    def _place(self, path: Path) -> DiskPath:
        """Where a path leads to: nowhere but into the folder."""
        if any(os.sep in name or (os.altsep or os.sep) in name or "\0" in name or ":" in name for name in path):
            fail(errno.EACCES)
        place = self._folder
        for name in path:
            place = place / name
            if place.is_symlink():
                fail(errno.EACCES)
        return place


class _DiskFile:
    def __init__(self, area: FolderArea, place: DiskPath, flags: int) -> None:
        self._area = area
        self._handle = os.open(place, flags | _FLAGS, 0o666)
        mode = os.fstat(self._handle).st_mode
        if not stat.S_ISREG(mode):
            os.close(self._handle)
            fail(errno.EISDIR if stat.S_ISDIR(mode) else errno.EACCES)

    @property
    def size(self) -> int:
        return os.fstat(self._handle).st_size

    def read(self, offset: int, count: int) -> bytes:
        os.lseek(self._handle, offset, os.SEEK_SET)
        return os.read(self._handle, count)

    def write(self, offset: int, data: bytes) -> None:
        self._area.take(max(0, offset + len(data) - self.size))
        os.lseek(self._handle, offset, os.SEEK_SET)
        os.write(self._handle, data)

    def cut(self, size: int) -> None:
        """To this length; filled up with zeros where it was shorter."""
        self._area.take(size - self.size)
        os.ftruncate(self._handle, size)

    def close(self) -> None:
        os.close(self._handle)
