"""The same flights on a dask.distributed cluster, a few at a time in each task.

The scheduler flies again elsewhere what a lost worker had in work; what has cost it too many workers comes back, is
tried flight by flight, and then recorded.
"""

from collections.abc import Iterator, Sequence
from typing import Any

from sitl.campaign.cases import Equipment
from sitl.campaign.flight import Flight, Job, fingerprint, fly, lost
from sitl.campaign.workers import WorkerError
from sitl.strict_yaml import ConfigError

CHUNK = 8  # flights of a task
AHEAD = 2  # tasks that each thread of the cluster has before it
CONNECT_S = 10.0
WORKERS_S = 30.0  # patience with a scheduler that has no worker yet


def fly_all(equipment: Equipment, jobs: Sequence[Job], made_by: str) -> list[Flight]:
    """A task. made_by: whose flights these are to be; another version's would be others."""
    if fingerprint() != made_by:
        raise WorkerError("a worker of the cluster runs another version of the simulator")
    return [fly(equipment, job) for job in jobs]


def cluster(equipment: Equipment, jobs: Sequence[Job], address: str) -> Iterator[Flight]:
    """The flights, as they are done, from the cluster whose scheduler listens at `address`.

    Raises ConfigError where nobody answers, WorkerError where the cluster can't do the work.
    """
    from distributed import Client, as_completed
    from distributed.scheduler import KilledWorker

    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, ImportError) as error:
        raise ConfigError(f"--cluster {address}: no scheduler answers: {error or type(error).__name__}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError:
            raise WorkerError(f"the cluster at {address} has no workers") from None
        chunks = [jobs[k : k + CHUNK] for k in range(0, len(jobs), CHUNK)]
        chunks.reverse()
        running: dict[str, Sequence[Job]] = {}
        arriving = as_completed(loop=client.loop)

        def submit() -> None:
            chunk = chunks.pop()
            task: Any = client.submit(fly_all, equipment, list(chunk), fingerprint(), pure=False)
            running[task.key] = chunk
            arriving.add(task)

        while chunks or running:
            room = AHEAD * max(1, sum(client.nthreads().values()))
            while chunks and len(running) < room:
                submit()
            task = next(arriving)
            chunk = running.pop(task.key)
            try:
                yield from task.result()
            except KilledWorker:
                if len(chunk) > 1:
                    chunks.extend([job] for job in reversed(chunk))
                else:
                    yield lost(chunk[0], "took down several workers of the cluster")
            except WorkerError:
                raise
            except Exception as error:
                raise WorkerError(f"the cluster at {address}: {type(error).__name__}: {error}") from error
