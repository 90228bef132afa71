"""What holds for all tests."""

import fcntl
import gc
import importlib
import signal
from collections.abc import Iterator

import pytest

from linkwork.kernels import kernel

from tests.house import SOURCE


def pytest_configure(config: pytest.Config) -> None:
    """Let Ctrl-C interrupt the processes that tests start, also where this one was started deaf to
    it, as by nohup."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(config, "workerinput"):
        share_compilation(config.workerinput)


def share_compilation(worker: dict[str, str]) -> None:
    """Compile what Numba compiles once per machine in turns with the other workers: each module,
    whose file is its lock, by whoever comes first, every other worker from the last to the
    first."""
    found = [
        path
        for path in sorted(SOURCE.rglob("*.py"))
        if "\n@compiled_once(" in path.read_text(encoding="utf-8")
    ]
    odd = int(worker["workerid"].removeprefix("gw")) % 2
    for locking in (fcntl.LOCK_EX | fcntl.LOCK_NB, fcntl.LOCK_EX):
        for path in found[:: -1 if odd else 1]:
            with path.open() as lock:
                try:
                    fcntl.flock(lock, locking)
                except BlockingIOError:  # another worker compiles it just now
                    continue
                name = path.relative_to(SOURCE.parent).with_suffix("")
                importlib.import_module(".".join(name.parts))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Look for no garbage among modules and tests, which stay to the end: neither while they are
    read nor in all the time after; and for that of the tests less often than Python does."""
    gc.disable()
    yield
    gc.freeze()
    gc.set_threshold(10_000, 5, 5)
    gc.enable()


@pytest.fixture
def code_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels are compiled when they are first asked: none is interpreted, none evaluates the
    states of a stack one by one."""
    monkeypatch.setattr(kernel, "SCATTERED", 0)
    monkeypatch.setattr(kernel.Kernel, "_told", lambda self: None)
