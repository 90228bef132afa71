"""20,000 mutated mechanism files, MJCF and URDF: read or refused in one sentence, soon, in little
memory.

Every seed is a file, always the same; `python -m tests.hostile.reading 17 18` reads the one of seed
17 alone. A sample of them is read unless LINKWORK_HOSTILE=all.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

FILES, SAMPLE, AT_ONCE = 20_000, 300, 2_500
MEMORY = 500  # MB of the process that reads
ALL = os.environ.get("LINKWORK_HOSTILE") == "all"
FIRST = range(0, FILES, AT_ONCE) if ALL else range(1)


@pytest.mark.parametrize("first", FIRST)
def test_mutated_files_are_read_or_refused(first):
    words = (
        sys.executable,
        "-m",
        "tests.hostile.reading",
        str(first),
        str(first + (AT_ONCE if ALL else SAMPLE)),
    )
    ended = subprocess.run(
        words, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    assert not found["faults"]
    assert min(found["read"], found["refused"]) > 0.1 * found["files"]
    assert found["memory"] < MEMORY
