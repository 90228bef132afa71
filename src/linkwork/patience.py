"""A sign of life: what is announced, and takes longer than two seconds, says so on the terminal.

Only a terminal is told, and only by the main thread of the main process: nothing is written where
stderr is a file or a pipe, by threads of ensembles and viewers, or by workers.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from multiprocessing.process import current_process
from threading import Timer, current_thread, main_thread

PATIENCE = 2.0  # how long nothing is said [s]

_HUSHED = ContextVar("hushed", default=False)


@contextmanager
def announced(what: str) -> Iterator[None]:
    """Say what is being done once it has taken longer than two seconds, and at the end how long it
    took; what is done as part of it says nothing."""
    if not _heard():
        yield
        return
    started = time.perf_counter()
    try:
        with later(PATIENCE, lambda: _say(f"{what} ...")), hushed():
            yield
    finally:
        seconds = time.perf_counter() - started
        if seconds > PATIENCE:
            _say(f"{what} took {seconds:.1f} s")


@contextmanager
def later(seconds: float, act: Callable[[], object]) -> Iterator[None]:
    """Act once what is done here has taken longer than some seconds; acts no more when it ends."""
    timer = Timer(seconds, act)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


@contextmanager
def hushed() -> Iterator[None]:
    """Say nothing of what is done here: somebody else does."""
    token = _HUSHED.set(True)
    try:
        yield
    finally:
        _HUSHED.reset(token)


def _heard() -> bool:
    terminal = sys.stderr is not None and sys.stderr.isatty()
    alone = current_thread() is main_thread() and current_process().name == "MainProcess"
    return terminal and alone and not _HUSHED.get()


def _say(text: str) -> None:
    print(f"linkwork: {text}", file=sys.stderr, flush=True)
