"""What is said of a model that is not read whole: its caveats as warnings on stderr, or a refusal
by --strict."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from linkwork.errors import LinkworkError, ModelWarning

STRICT = "--strict"


@contextmanager
def told(strict: bool) -> Iterator[None]:
    """Print warnings on stderr, each in a sentence; with `strict` the first one of a model is a
    refusal."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: say("warning", str(message))
        warnings.simplefilter("error" if strict else "always", ModelWarning)
        try:
            yield
        except ModelWarning as caveat:
            raise LinkworkError(f"{caveat}; {STRICT} refuses what is warned of") from None


def tell(notes: Iterable[str]) -> None:
    """Print notes on stderr."""
    for note in notes:
        say("note", note)


def say(kind: str, sentence: str) -> None:
    print(f"linkwork: {kind}: {' '.join(sentence.split())}", file=sys.stderr)
