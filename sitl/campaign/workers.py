"""Flying many: processes of this machine, each with one flight in work and one waiting, or a dask cluster.

What kills a worker process costs its flight an attempt; it is flown again by another. A flight that has taken down
ATTEMPTS processes is recorded as such.
"""

import contextlib
import multiprocessing
import signal
from collections import deque
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection, wait

from sitl.campaign.cases import Equipment
from sitl.campaign.flight import Flight, Job, fly, lost

ATTEMPTS = 3
AHEAD = 2  # jobs that a process holds, so that it never waits for the next


class WorkerError(RuntimeError):
    """The workers can't work at all: it is no flight's fault."""


def _serve(pipe: Connection, equipment: Equipment) -> None:
    """What a worker process does: jobs in, flights out, until whoever gave the jobs closes the other end."""
    with contextlib.suppress(EOFError, OSError):
        pipe.send(None)
        while True:
            pipe.send(fly(equipment, pipe.recv()))


class _Worker:
    def __init__(self, equipment: Equipment) -> None:
        # fresh processes: a fork would copy whatever threads and caches the caller has
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, equipment), daemon=True)
        with _uninterrupted():
            self.process.start()
        theirs.close()
        self.ready = False
        self.jobs: deque[Job] = deque()  # the first is in work

    def give(self, job: Job) -> None:
        self.jobs.append(job)
        with contextlib.suppress(OSError):  # one that is gone is noticed by its silence
            self.pipe.send(job)

    def end(self) -> None:
        self.pipe.close()
        self.process.kill()
        self.process.join()


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """A process started within never hears Ctrl-C, not even while it starts; this one hears it afterwards."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def local(equipment: Equipment, jobs: Sequence[Job], count: int) -> Iterator[Flight]:
    """The flights, as they are done, from `count` processes. Raises WorkerError where none can be started."""
    waiting, attempts = deque(jobs), dict[int, int]()
    workers = [_Worker(equipment) for _ in range(min(count, len(jobs)))]
    try:
        while any(w.jobs for w in workers) or waiting:
            for w in workers:
                while waiting and len(w.jobs) < AHEAD:
                    w.give(waiting.popleft())
            for pipe in wait([w.pipe for w in workers]):
                w = next(w for w in workers if w.pipe is pipe)
                try:
                    told = w.pipe.recv()
                except (EOFError, OSError):
                    workers[workers.index(w)] = _Worker(equipment)
                    yield from _bereft(w, waiting, attempts)
                    continue
                if told is None:
                    w.ready = True
                else:
                    w.jobs.popleft()
                    yield told
    finally:
        for w in workers:
            w.end()


def _bereft(w: _Worker, waiting: deque[Job], attempts: dict[int, int]) -> Iterator[Flight]:
    """A process is gone: its jobs go to others, unless the one in work has done so too often."""
    w.end()
    code = w.process.exitcode or 0
    how = signal.Signals(-code).name if code < 0 else f"exit status {code}"
    if not w.ready:
        raise WorkerError(f"a worker process ended before it could work ({how})")
    jobs = list(w.jobs)
    waiting.extendleft(reversed(jobs[1:]))
    if not jobs:
        return
    number = jobs[0].case.number
    attempts[number] = attempts.get(number, 0) + 1
    if attempts[number] < ATTEMPTS:
        waiting.appendleft(jobs[0])
    else:
        yield lost(jobs[0], f"took down {ATTEMPTS} worker processes ({how})")
