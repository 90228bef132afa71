"""Sweeps on a Dask cluster: a scheduler and two workers, each a process; workers and schedulers
that are killed."""

from __future__ import annotations

import signal
import socket
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest
from distributed import Client

from linkwork.sweeps import Study, StudyError, runner, sweep

from tests.catalogue import WHOLE
from tests.processes import PATIENCE, python
from tests.sweeps.carts import count, file, finished, results


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def process(*words: object):
    return python("-m", "dask", *words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def listening(port: int) -> None:
    for _ in range(6000):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise AssertionError("no scheduler")


@contextmanager
def cluster(folder, workers=2):
    """Start a scheduler and workers; give the address and their processes."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    plain = ("--no-dashboard", "--host", "127.0.0.1")
    with ExitStack() as stack:
        scheduler = stack.enter_context(process("scheduler", *plain, "--port", port))
        listening(port)
        crew = [
            stack.enter_context(
                process(
                    "worker",
                    address,
                    *plain,
                    "--no-nanny",
                    "--nthreads",
                    2,
                    "--local-directory",
                    folder,
                )
            )
            for _ in range(workers)
        ]
        if crew:  # a busy machine takes longer to start them than a sweep waits
            with Client(address, timeout=PATIENCE) as known:
                known.wait_for_workers(workers, timeout=PATIENCE)
        yield address, scheduler, crew


@pytest.fixture
def patient(monkeypatch):
    """Wait as long for an answer as a busy machine may take to give it."""
    monkeypatch.setattr(runner, "PATIENCE", PATIENCE)


@pytest.fixture(scope="module")
def wanted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("here")
    path = file(folder)
    sweep(Study.load(path), folder / "out")
    return path, results(folder / "out")


def until(condition, run):
    for _ in range(30_000):
        if condition():
            return
        assert not run.done(), run.exception()
        time.sleep(0.01)
    raise AssertionError("too slow")


@pytest.mark.long
def test_a_worker_that_is_killed_and_a_scheduler_that_is_lost(wanted, tmp_path):
    path, here = wanted
    out = tmp_path / "out"
    with ThreadPoolExecutor(1) as pool, cluster(tmp_path) as (address, scheduler, crew):
        run = pool.submit(sweep, Study.load(path), out, scheduler=address)
        until(lambda: count(out) > 8, run)
        crew[0].send_signal(signal.SIGKILL)
        known = count(out)
        until(lambda: count(out) > known + 8, run)
        scheduler.send_signal(signal.SIGKILL)
        with pytest.raises(
            StudyError, match=f"the scheduler at {address} was lost .* goes on from there"
        ):
            run.result(PATIENCE)
    kept = finished(out)
    assert 16 < kept.sum() < kept.size
    with ExitStack() as stack:
        # Here, or on another cluster where all is tried.
        another = stack.enter_context(cluster(tmp_path, workers=1))[0] if WHOLE else None
        outcome = sweep(Study.load(path), out, scheduler=another)
    assert outcome.before == kept.sum()
    assert outcome.computed == kept.size - kept.sum()
    found = results(out)
    np.testing.assert_allclose(found["end"], here["end"], rtol=1e-13)
    assert found.drop_vars("checksum").identical(here.drop_vars("checksum"))


def test_a_scheduler_that_is_not_there(wanted, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "PATIENCE", 0.5)
    with pytest.raises(
        StudyError, match=r"there is no Dask scheduler at tcp://127\.0\.0\.1:9 .*start one"
    ):
        sweep(Study.load(wanted[0]), tmp_path, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(StudyError, match="there is no Dask scheduler at nonsense"):
        sweep(Study.load(wanted[0]), tmp_path, scheduler="nonsense://x")


@contextmanager
def service(answer: bytes | None):
    """Listen, and answer whatever is said; give the address."""
    with (
        ExitStack() as stack,
        socket.create_server(("127.0.0.1", 0)) as server,
        ThreadPoolExecutor(1) as pool,
    ):
        server.settimeout(10)

        def serve():
            caller, _ = server.accept()
            stack.enter_context(caller)
            caller.sendall(answer or b"")

        pool.submit(serve)
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"


@pytest.mark.parametrize(
    ("answer", "patience", "why"),
    [
        (None, 0.5, "no answer in 0.5 s"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", PATIENCE, "something else answers"),
    ],
)
def test_another_service_at_the_address(wanted, tmp_path, monkeypatch, answer, patience, why):
    """Dask's own handshake waits for ever for an answer, and takes the first bytes of one for its
    length."""
    monkeypatch.setattr(runner, "PATIENCE", patience)
    with (
        service(answer) as address,
        pytest.raises(StudyError, match=rf"no Dask scheduler at {address} \({why}\); start"),
    ):
        sweep(Study.load(wanted[0]), tmp_path, scheduler=address)


@pytest.mark.long
def test_a_worker_is_no_scheduler(wanted, tmp_path, patient):
    port = free_port()
    with cluster(tmp_path, workers=0) as (address, _, _):
        words = (
            "worker",
            address,
            "--no-dashboard",
            "--host",
            "127.0.0.1",
            "--no-nanny",
            "--worker-port",
            port,
        )
        with process(*words, "--local-directory", tmp_path):
            listening(port)
            with pytest.raises(StudyError, match=r"\(it is a worker\); start one"):
                sweep(Study.load(wanted[0]), tmp_path / "out", scheduler=f"tcp://127.0.0.1:{port}")


@pytest.mark.long
def test_a_scheduler_without_workers(wanted, tmp_path, monkeypatch, patient):
    wait = Client.wait_for_workers
    monkeypatch.setattr(
        Client, "wait_for_workers", lambda client, count, timeout: wait(client, count, timeout=0.5)
    )
    with (
        cluster(tmp_path, workers=0) as (address, _, _),
        pytest.raises(StudyError, match="has no workers; start some"),
    ):
        sweep(Study.load(wanted[0]), tmp_path / "out", scheduler=address)
