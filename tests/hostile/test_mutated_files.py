"""20,000 mutated mechanism files, MJCF and URDF: read or refused in one sentence, soon, in little
memory.

Every seed is a file, always the same; `python -m tests.hostile.reading 17 18` reads the one of seed
17 alone. A sample of them is read unless LINKWORK_HOSTILE=all.
"""

import json
import os
from pathlib import Path

import pytest

from tests.processes import PATIENCE, finished

FILES, SAMPLE, AT_ONCE = 20_000, 150, 2_500
MEMORY = 500  # MB of the process that reads
ALL = os.environ.get("LINKWORK_HOSTILE") == "all"
FIRST = range(0, FILES, AT_ONCE) if ALL else range(1)


@pytest.mark.long
@pytest.mark.parametrize("first", FIRST)
def test_mutated_files_are_read_or_refused(first):
    last = first + (AT_ONCE if ALL else SAMPLE)
    here = {"cwd": Path(__file__).parents[2], "timeout": (10 if ALL else 1) * PATIENCE}
    ended = finished("-m", "tests.hostile.reading", first, last, **here)
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    assert not found["faults"]
    assert min(found["read"], found["refused"]) > 0.1 * found["files"]
    assert found["memory"] < MEMORY
