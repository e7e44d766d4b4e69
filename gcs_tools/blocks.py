"""What has come of a file that arrives in blocks, in any order, some of them never or twice."""

from collections.abc import Callable, Iterator


class Blocks:
    """Takes blocks of `block` bytes from byte `start` on, the last one shorter; what is new goes to `place`."""

    def __init__(self, size: int, block: int, place: Callable[[int, bytes], None], start: int = 0) -> None:
        self.size, self.block, self.start = size, block, start
        self.left = max(0, -(-(size - start) // block))  # blocks that have not come
        self._have = bytearray(self.left)
        self._place = place
        self._first = 0  # all blocks before this one are there

    def take(self, offset: int, data: bytes) -> bool:
        """Whether it was a block that had not come yet. What is beyond the size, of a file that grows, is cut off."""
        number, remainder = divmod(offset - self.start, self.block)
        if remainder or not 0 <= number < len(self._have) or self._have[number]:
            return False
        size = min(self.block, self.size - offset)
        if len(data) < size:
            return False
        self._have[number] = 1
        self.left -= 1
        self._place(offset, data[:size])
        return True

    @property
    def complete_to(self) -> int:
        """Bytes from the file's begin that are there without a gap."""
        while self._first < len(self._have) and self._have[self._first]:
            self._first += 1
        return min(self.size, self.start + self._first * self.block) if self._have else self.size

    @property
    def share(self) -> float:
        """Of the whole file, 0 to 1."""
        return 1.0 - self.left * self.block / self.size if self.left else 1.0

    def gaps(self) -> Iterator[tuple[int, int]]:
        """(offset, bytes) of what is missing, block by block."""
        number = (self.complete_to - self.start) // self.block
        while (number := self._have.find(0, number)) >= 0:
            offset = self.start + number * self.block
            yield offset, min(self.block, self.size - offset)
            number += 1

    def runs(self) -> Iterator[tuple[int, int]]:
        """(offset, bytes) of what is missing, neighbouring blocks in one."""
        number = 0
        while (number := self._have.find(0, number)) >= 0:
            end = self._have.find(1, number)
            end = len(self._have) if end < 0 else end
            offset = self.start + number * self.block
            yield offset, min(self.size, self.start + end * self.block) - offset
            number = end
