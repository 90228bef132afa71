"""Read garbled files, one after the other, in a process of its own:
`python -m tests.hostile.reading FIRST LAST`.

Prints JSON: what ended in anything but a mechanism or a refusal in one sentence, what took too
long, how many were read, and the most memory that the process ever had.
"""

from __future__ import annotations

import json
import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

from linkwork.errors import LinkworkError
from linkwork.formats import load

from tests.hostile.mutations import garbled, originals

MOST_LETTERS = 2000  # of a refusal
LONGEST = 2.0  # of one file [s of this process]


class Hung(BaseException):
    """Tell that a file took too long."""


def hang(*_: Any) -> None:
    raise Hung


READ, REFUSED = "read", "refused"


def outcome(path: Path) -> str:
    """Return READ, REFUSED (in one sentence that names the file), or what is wrong with how a file
    is read."""
    signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)
    try:
        load(path)
        return READ
    except LinkworkError as refusal:
        sentence = str(refusal)
        clear = (
            sentence.startswith(str(path)) and "\n" not in sentence and len(sentence) < MOST_LETTERS
        )
        return REFUSED if clear else f"is refused by {sentence[:300]!r}"
    except Hung:
        return f"takes more than {LONGEST:g} s"
    except Exception:
        return traceback.format_exc(limit=-3)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)


def most_memory() -> float:
    """Return the most memory that this process has held [MB]; what its parent held counts in
    `ru_maxrss` on Linux."""
    told = Path("/proc/self/status")
    if told.exists():
        (line,) = [line for line in told.read_text().splitlines() if line.startswith("VmHWM")]
        return float(line.split()[1]) / 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (
        1e6 if sys.platform == "darwin" else 1e3
    )


def main(first: int, last: int) -> None:
    signal.signal(signal.SIGVTALRM, hang)
    warnings.simplefilter("ignore")
    originals()
    faults: dict[str, str] = {}
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, last):
            name, content = garbled(seed)
            path = Path(folder) / name
            path.write_bytes(content)
            found = outcome(path)
            counts[found] += 1
            if found not in (READ, REFUSED):
                faults[f"{seed} ({name})"] = found
            path.unlink()
    ends = {READ: counts[READ], REFUSED: counts[REFUSED]}
    print(json.dumps({"faults": faults, "files": last - first, "memory": most_memory()} | ends))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
