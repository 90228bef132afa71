"""Names that a mechanism accepts for what a model file calls otherwise."""

from __future__ import annotations

from collections import Counter

from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element, shortened


class FreeNames:
    """Give names that a mechanism accepts: no dots, none twice."""

    def __init__(self, notes: Notes, taken: tuple[str, ...] = ()):
        self._notes, self._taken = notes, set(taken)
        self._tried: Counter[str] = Counter()  # numbers that were put behind a name

    def give(self, wanted: str, element: Element | None = None) -> str:
        """Return the wanted name, or the nearest to it that is free; a name of the file that
        changes is noted."""
        clean = (
            "".join(c if c.isprintable() else "_" for c in wanted.replace(".", "_")).strip() or "_"
        )
        name = clean
        while name in self._taken:
            self._tried[clean] += 1
            name = f"{clean}_{self._tried[clean] + 1}"
        self._taken.add(name)
        if name != wanted and element is not None:
            called = f"<{element.tag} {shortened(wanted)}> is called {shortened(name)} here"
            self._notes.say(f"{element.place}: {called}")
        return name
