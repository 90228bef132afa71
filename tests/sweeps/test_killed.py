"""A sweep that is killed at any moment goes on from the chunks that are finished, and comes to what
it comes to undisturbed."""

from __future__ import annotations

import signal
import time

import numpy as np
import pytest

from linkwork.sweeps import Study, sweep

from tests.catalogue import WHOLE
from tests.processes import PATIENCE, python
from tests.sweeps.carts import FILE, count, file, finished, results

# Many chunks: a busy machine looks at them late.
CHUNKS = FILE.replace("members: 1024", "members: 384").replace("chunk: 16", "chunk: 4")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    path = file(folder, CHUNKS)
    sweep(Study.load(path), folder / "out")
    return path, results(folder / "out")


def wait_for(condition, process):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert process.poll() is None, process.communicate(timeout=PATIENCE)
        assert time.monotonic() < end, "too slow"
        time.sleep(0.01)


def stamps(folder):
    """Return when the files of finished chunks were last written, by chunk."""
    arrays = [folder / "results.zarr" / name / "c" for name in ("checksum", "end", "status")]
    done = np.flatnonzero(finished(folder)).tolist()
    return {index: [(array / str(index)).stat().st_mtime_ns for array in arrays] for index in done}


@pytest.mark.long
def test_interrupted_again_and_again(undisturbed, tmp_path):
    path, wanted = undisturbed
    before = {}
    for how, status in (*[(signal.SIGKILL, -signal.SIGKILL)] * (1 + WHOLE), (signal.SIGINT, 130)):
        with python("-m", "linkwork", "sweep", path, "--out", tmp_path) as process:
            known = len(before)
            wait_for(lambda known=known: count(tmp_path) > known + 1, process)
            process.send_signal(how)
            process.communicate(timeout=PATIENCE)
        assert process.returncode == status
        after = stamps(tmp_path)
        assert len(before) < len(after) < finished(tmp_path).size
        assert all(
            after[index] == times for index, times in before.items()
        )  # what is finished is not touched again
        before = after
    outcome = sweep(Study.load(path), tmp_path)
    assert (outcome.before, outcome.corrupted) == (len(before), 0)
    assert results(tmp_path).identical(wanted)
