"""Processes that tests start beside themselves, and that end with them whatever happens."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

PATIENCE = 300.0  # time that any process may take on a busy machine [s]


@contextmanager
def python(*words: object, **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Start Python with some words; its output is text to be read, and ends when patience does."""
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    with subprocess.Popen([sys.executable, *map(str, words)], text=True, **given) as process:
        too_slow = threading.Timer(PATIENCE, process.kill)
        too_slow.start()
        try:
            yield process
        finally:
            too_slow.cancel()
            process.kill()


def finished(*words: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run Python with some words to its end, which has to come before patience ends."""
    given = {"capture_output": True, "text": True, "timeout": PATIENCE, "check": False, **options}
    return subprocess.run([sys.executable, *map(str, words)], **given)
