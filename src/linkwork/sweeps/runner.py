"""The runner: compute the chunks of a study that are not finished, here or on a Dask cluster, and
write them as they come.

There is one writer, this process, and never more than a few chunks under way: memory does not grow
with the study.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.sweeps.chunk import Results, bench_of, compute
from linkwork.sweeps.store import Store, reason
from linkwork.sweeps.study import Study, StudyError

if TYPE_CHECKING:
    from distributed import Client

RESULTS = "results.zarr"
PATIENCE = 10.0  # how long a scheduler may take to answer, and a cluster to have a worker [s]
AHEAD = 2  # chunks under way for each worker
KEPT = "what is finished is kept: the same command goes on from there"
Progress = Callable[[int, int], None]
_ALONE = Lock()


@dataclass(frozen=True)
class Outcome:
    """Say what a sweep did: chunks that were finished before, corrupted ones among the computed,
    computed now."""

    store: Store
    before: int
    corrupted: int
    computed: int


def sweep(
    study: Study,
    folder: str | Path,
    *,
    scheduler: str | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcome:
    """Compute a study into folder/results.zarr; what is finished there already is not computed
    again.

    Args:
        study: what to compute.
        folder: where the results are written; it is made if it is not there.
        scheduler: address of a Dask scheduler, such as "tcp://host:8786"; left out, all is computed
            here.
        threads: to use here; all processors if left out.
        progress: called with the numbers of chunks finished and of all.

    Raises:
        StudyError: a study that does not fit the robot, a store that is another study's or cannot
            be written, a scheduler that is not there or is lost.
    """
    checks.needed(study, Study, "linkwork.sweeps.Study")
    place = checks.folder_path(folder, "the folder")
    if scheduler is not None and not isinstance(scheduler, str):
        raise LinkworkError(
            f'scheduler is {checks.shown(scheduler)}; give an address, such as "tcp://host:8786"'
        )
    if threads is not None:
        checks.count(threads, "threads")
    if progress is not None and not callable(progress):
        raise LinkworkError(
            f"progress is {checks.shown(progress)}; give a function of two numbers, done and all"
        )
    bench, report = bench_of(study), progress or (lambda done, total: None)
    store = Store.open(place / RESULTS, bench)
    states = [store.state(index) for index in range(study.chunks)]
    before = states.count("finished")
    pending = [index for index, state in enumerate(states) if state != "finished"]
    if pending:
        store.require_this_version()
    report(before, study.chunks)
    found = (
        here(study, pending, threads)
        if scheduler is None
        else on_cluster(study, pending, scheduler)
    )
    for count, (index, results) in enumerate(found, 1):
        store.write(index, results)
        report(before + count, study.chunks)
    return Outcome(store, before, states.count("corrupted"), len(pending))


def here(
    study: Study, pending: Iterable[int], threads: int | None
) -> Iterator[tuple[int, Results]]:
    """Yield chunks as they are computed in this process."""
    for index in pending:
        yield index, compute(study, index, threads)


def on_cluster(study: Study, pending: Iterable[int], address: str) -> Iterator[tuple[int, Results]]:
    """Yield chunks as workers return them; those of a worker that is lost are given to another."""
    from distributed import wait

    waiting, running = iter(pending), {}
    with connected(address) as client:
        for _ in range(AHEAD * require_workers(client, address)):
            start(client, study, waiting, running)
        while running:
            try:
                ended: Any = wait(list(running), timeout=PATIENCE, return_when="FIRST_COMPLETED")
            except TimeoutError:
                require_workers(client, address)
                continue
            except Exception as error:
                raise lost(address, error) from None
            for future in ended.done:
                index = running.pop(future)
                yield index, result(future, index, address)
                future.release()
                start(client, study, waiting, running)


def start(client: Client, study: Study, waiting: Iterator[int], running: dict[Any, int]) -> None:
    """Hand the next chunk to the cluster, if there is one."""
    index = next(waiting, None)
    if index is not None:
        running[client.submit(compute_there, study, index, pure=False)] = index


def compute_there(study: Study, index: int) -> Results:
    """Compute a chunk on a worker, one at a time with all of its threads."""
    from distributed import get_worker

    with _ALONE:
        return compute(study, index, get_worker().state.nthreads)


def result(future: Any, index: int, address: str) -> Results:
    """Return what a worker computed."""
    from distributed import CancelledError, KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        return future.result()
    except (CancelledError, CommClosedError, OSError) as error:
        raise lost(address, error) from None
    except KilledWorker:
        raise StudyError(
            f"chunk {index} ended several workers of {address}, most likely for want of memory; "
            f"{KEPT}"
        ) from None
    except ImportError as error:
        raise StudyError(
            f"the workers of {address} cannot compute: {error}; install the same linkwork there"
        ) from None


def connected(address: str) -> Client:
    """Connect to a scheduler."""
    from distributed import Client

    try:
        with ThreadPoolExecutor(
            1
        ) as pool:  # its thread has no event loop under way, as that of a notebook has
            kind = pool.submit(asyncio.run, introduced(address)).result()
        if kind != "Scheduler":
            raise ValueError(f"it is a {kind.lower()}")
        return Client(address, timeout=PATIENCE)
    except (OSError, ValueError, ImportError) as error:
        why = reason(error) or f"no answer in {PATIENCE:g} s"
    except Exception:  # whatever comes of reading what another service says
        why = "something else answers"
    raise StudyError(
        f"there is no Dask scheduler at {address} ({why}); start one ('dask scheduler'), or "
        "leave out --scheduler"
    )


async def introduced(address: str) -> str:
    """Return what a Dask process says that it is: Scheduler, Worker or Nanny."""
    from distributed import Security, rpc

    async with (
        asyncio.timeout(PATIENCE),
        rpc(address, connection_args=Security().get_connection_args("client")) as it,
    ):
        known: Any = await it.identity()
        return known["type"]


def require_workers(client: Client, address: str) -> int:
    """Return the number of workers; wait a while for the first."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except (TimeoutError, OSError):
        raise StudyError(
            f"the scheduler at {address} has no workers; start some ('dask worker {address}'); "
            f"{KEPT}"
        ) from None
    return len(client.scheduler_info(n_workers=-1)["workers"])


def lost(address: str, error: Exception) -> StudyError:
    """Return the refusal to go on without a scheduler."""
    return StudyError(
        f"the scheduler at {address} was lost ({reason(error) or type(error).__name__}); {KEPT}"
    )
