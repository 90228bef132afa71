"""What holds for all tests."""

import fcntl
import gc
import importlib
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest

from linkwork.kernels import kernel
from linkwork.simulation import compiled

from tests.house import SOURCE


def pytest_configure(config: pytest.Config) -> None:
    """Let Ctrl-C interrupt the processes that tests start, also where this one was started deaf to
    it, as by nohup."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(config, "workerinput"):
        share_compilation(config.workerinput)


def share_compilation(worker: dict[str, str]) -> None:
    """Compile what Numba compiles once per machine in turns with the other workers: each module by
    whoever comes first, every other worker from the last to the first, and none that another one
    compiles just now."""
    compiled._cached = one_at_a_time(compiled._cached)
    found = [
        path
        for path in sorted(SOURCE.rglob("*.py"))
        if "\n@compiled_once(" in path.read_text(encoding="utf-8")
    ]
    odd = int(worker["workerid"].removeprefix("gw")) % 2
    for busy_too in (False, True):
        for path in found[:: -1 if odd else 1]:
            if busy_too or is_free(path):
                name = path.relative_to(SOURCE.parent).with_suffix("")
                importlib.import_module(".".join(name.parts))


def is_free(path: Path) -> bool:
    """Tell whether no other worker compiles a function of a file."""
    with path.open() as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


def one_at_a_time(compile_or_load: Callable[..., Any]) -> Callable[..., Any]:
    """Return the same for functions of whose file, which is their lock, no other worker compiles
    one meanwhile, be it asked for by itself or by a module that needs it."""

    def locked(function: FunctionType, *given: object) -> Any:
        path = Path(function.__code__.co_filename)
        if not path.exists():  # nor is there anything kept of it
            return compile_or_load(function, *given)
        with path.open() as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            return compile_or_load(function, *given)

    return locked


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Look for no garbage among modules and tests, which stay to the end: neither while they are
    read nor in all the time after; and for that of the tests less often than Python does."""
    gc.disable()
    yield
    gc.freeze()
    gc.set_threshold(10_000, 5, 5)
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark as long what a sample stands for: of the cases of a test that is marked `sample(n)` all
    but n, which are evenly taken."""
    families: dict[str, list[pytest.Item]] = {}
    for item in items:
        families.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for cases in families.values():
        mark = cases[0].get_closest_marker("sample")
        if mark is not None:
            (few,) = mark.args
            taken = {j * len(cases) // few for j in range(few)}
            for number, case in enumerate(cases):
                if number not in taken:
                    case.add_marker(pytest.mark.long)


@pytest.fixture
def code_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels are compiled when they are first asked: none is interpreted, none evaluates the
    states of a stack one by one."""
    monkeypatch.setattr(kernel, "SCATTERED", 0)
    monkeypatch.setattr(kernel.Kernel, "_told", lambda self: None)
