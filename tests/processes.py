"""Processes that tests start beside themselves, and that end with them whatever happens."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

PATIENCE = 300.0  # time that any process may take on a busy machine [s]


@contextmanager
def python(*words: object, **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Start Python with some words; its output is text to be read."""
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
    with subprocess.Popen([sys.executable, *map(str, words)], text=True, **given) as process:
        try:
            yield process
        finally:
            process.kill()
