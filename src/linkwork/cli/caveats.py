"""What is said of a model that is not read whole: its caveats as warnings on stderr, or a refusal
by --strict."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from linkwork.errors import LinkworkError, ModelWarning

STRICT = "--strict"


@contextmanager
def told(strict: bool) -> Iterator[None]:
    """Print warnings of models on stderr; with `strict` the first one is a refusal."""
    with warnings.catch_warnings():
        usual = warnings.showwarning

        def show(message: Any, category: type[Warning], *place: Any, **more: Any) -> None:
            if issubclass(category, ModelWarning):
                say("warning", str(message))
            else:
                usual(message, category, *place, **more)

        warnings.showwarning = show
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
