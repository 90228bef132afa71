"""Threads: deal a job in parts to the processors that may be used, and look at how far it is now
and then."""

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait

GLANCE = 0.05  # time between two looks at how far the threads are [s]


def usable_processors() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


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
    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(run, part) for part in range(parts)]
        left = set(futures)
        try:
            while left:
                ended, left = wait(left, timeout=GLANCE, return_when=FIRST_COMPLETED)
                for future in ended:
                    future.result()
                report()
        except KeyboardInterrupt as error:
            interrupt = error
        finally:
            cancel()
    if interrupt and all(not future.exception() and future.result() for future in futures):
        raise interrupt
