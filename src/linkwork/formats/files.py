"""Model files written at once, or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from linkwork.mechanism import MechanismError


def write_file(path: Path, text: str) -> None:
    """Write a text in place of the file of that name, if there is one.

    Raises:
        MechanismError: the file cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise MechanismError(
            f"{path}: cannot be written: {(error.strerror or str(error)).lower()}"
        ) from None
