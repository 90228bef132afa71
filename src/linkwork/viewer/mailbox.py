"""Wishes of browsers, handed from their threads to the one that moves the robot.

Of several wishes about the same thing only the last one counts: a drag that is faster than the
robot skips poses.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Condition

Wish = Callable[[], None]


class Mailbox:
    """Collect wishes by what they are about, in the order in which these were first wished."""

    def __init__(self) -> None:
        self._wishes: dict[object, Wish] = {}
        self._changed = Condition()

    def post(self, wish: Wish, about: object = None) -> None:
        """Wish something; `about` replaces an earlier wish about the same, None none."""
        with self._changed:
            self._wishes[object() if about is None else about] = wish
            self._changed.notify()

    def take(self, wait: float) -> list[Wish]:
        """Return all wishes, waiting up to some seconds for the first one."""
        with self._changed:
            if not self._wishes:
                self._changed.wait(wait)
            wishes = list(self._wishes.values())
            self._wishes.clear()
            return wishes
