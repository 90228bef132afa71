"""Threads: deal a job in parts to the processors that may be used, and look at how far it is now
and then."""

import os
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue

from linkwork.checks import count

ONE = 1  # thread, the default: what is equal but another object is checked
GLANCE = 0.05  # time between two looks at how far the threads are [s]


def number_of(threads: object) -> int:
    """Return how many threads are asked for: all processors for None; refuse what is no number."""
    if threads is ONE:
        return ONE
    return usable_processors() if threads is None else count(threads, "threads")


def usable_processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_idle: defaultdict[int, list[ThreadPoolExecutor]] = defaultdict(list)  # by number of threads
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)  # threads do not live on in a child


@contextmanager
def crew(threads: int) -> Iterator[ThreadPoolExecutor]:
    """Lend so many threads to one job, which leaves none of its parts undone.

    Threads outlive their job for the next one, as starting them takes longer than a small job; jobs
    at the same time, or inside of each other, have their own.
    """
    waiting = _idle[threads]
    try:
        pool = waiting.pop()
    except IndexError:
        pool = ThreadPoolExecutor(threads)
    yield pool
    waiting.append(pool)


def dealt(
    run: Callable[[int], bool],
    parts: int,
    threads: int,
    report: Callable[[], None],
    cancel: Callable[[], None],
) -> None:
    """Do run(0) .. run(parts - 1) on so many threads, and report when a part has ended, and now and
    then.

    KeyboardInterrupt, from wherever, ends the job: the parts that are cancelled are to return
    early, and False. Where it came too late to cut anything short, it is raised. So is what a part
    raises, which ends the job, too.
    """
    interrupt = None
    with crew(threads) as pool:
        futures = [pool.submit(run, part) for part in range(parts)]
        ended: SimpleQueue[Future[bool]] = SimpleQueue()
        for future in futures:
            future.add_done_callback(ended.put)
        try:
            left = parts
            while left:
                with suppress(Empty):
                    ended.get(timeout=GLANCE).result()
                    left -= 1
                report()
        except KeyboardInterrupt as error:
            interrupt = error
        finally:
            cancel()
            wait(futures)
    if interrupt and all(not future.exception() and future.result() for future in futures):
        raise interrupt
