"""A sign of life: what is announced, and takes longer than two seconds, says so on the terminal;
and who has no patience may interrupt it.

Only a terminal is told, and only by the main thread of the main process: nothing is written where
stderr is a file or a pipe, by threads of ensembles and viewers, or by workers.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from math import inf
from multiprocessing.process import current_process
from threading import Thread, Timer, current_thread, main_thread
from typing import ClassVar

PATIENCE = 2.0  # how long nothing is said [s]
GLANCE = 0.25  # time between two looks of the clock at what goes on [s]
WORTH = 1.0  # how long something has taken that an interruption is not to throw away [s]
REST = 60.0  # how long the clock looks on where nothing goes on [s]

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
        with later(PATIENCE, lambda: _say(f"{what} ...")), hushed(), ongoing.held():
            yield
    finally:
        seconds = time.perf_counter() - started
        if seconds > PATIENCE:
            _say(f"{what} took {seconds:.1f} s")


class ongoing:
    """Say of a run what `announced` says of other things: a run may be too short for a timer of its
    own, so that one clock looks at all of them now and then.

    What is announced as part of it is said, too, and its time is not counted.
    """

    __slots__ = ("heard", "since", "told", "what")
    stack: ClassVar[list[ongoing]] = []
    clock: ClassVar[Thread | None] = None

    def __init__(self, what: str) -> None:
        self.what, self.told, self.heard, self.since = what, False, _heard(), inf

    def __enter__(self) -> None:
        if self.heard:
            self.stack.append(self)
            self.since = time.perf_counter()
            if ongoing.clock is None or not ongoing.clock.is_alive():
                ongoing.clock = Thread(target=ongoing.looked_at, daemon=True)
                ongoing.clock.start()

    def __exit__(self, *fault: object) -> None:
        if self.heard:
            self.stack.pop()
            if self.told:
                _say(f"{self.what} took {time.perf_counter() - self.since:.1f} s")

    @classmethod
    def looked_at(cls) -> None:
        """Look at the innermost run now and then, until there was none for long."""
        idle = 0.0
        while idle < REST:
            time.sleep(GLANCE)
            idle = 0.0 if cls.stack else idle + GLANCE
            for one in cls.stack[-1:]:
                if not one.told and time.perf_counter() - one.since > PATIENCE:
                    one.told = True
                    _say(f"{one.what} ...")

    @classmethod
    @contextmanager
    def held(cls) -> Iterator[None]:
        """Stop the time of the innermost run meanwhile."""
        if not cls.stack:
            yield
            return
        one, started = cls.stack[-1], time.perf_counter()
        since, one.since = one.since, inf
        try:
            yield
        finally:
            one.since = since + time.perf_counter() - started


@contextmanager
def interruptions_held() -> Iterator[Callable[[], bool]]:
    """Let what is done here come to its end although Ctrl-C is pressed; give what tells whether it
    was.

    Only Python's own way to interrupt, of the main thread, is held back.
    """
    own = current_thread() is main_thread()
    if not own or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield lambda: False
        return
    came: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    try:
        yield lambda: bool(came)
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


class Kept(ExitStack):
    """Keep what is done piece by piece from being thrown away by Ctrl-C, once it is worth that.

    What has taken a second since its first piece is worth keeping in any case; before that Ctrl-C
    ends it at once.
    """

    began: float | None = None
    came: Callable[[], bool] | None = None

    def interrupted(self, worth: bool) -> bool:
        """Tell after a piece, and whether that is worth keeping, if Ctrl-C was pressed since."""
        self.began = self.began or time.perf_counter()
        if self.came is None and (worth or time.perf_counter() - self.began > WORTH):
            self.came = self.enter_context(interruptions_held())
        return self.came is not None and self.came()


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
