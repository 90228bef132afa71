"""Notes: sentences on what a reader or a writer left out, took otherwise, or decided, each with its
place.

Those by which the mechanism moves otherwise than the file says are its caveats.
"""

from __future__ import annotations

from typing import NamedTuple

from linkwork.formats.xml import Element

SHOWN = 4  # names of elements in one sentence


class Remark(NamedTuple):
    """Hold what elements of one tag share: what is said before and behind the words in which they
    differ, and whether it alters the motion."""

    tag: str
    before: str
    behind: str
    alters: bool


class Notes:
    """Gather sentences; elements of one tag share one where the same remark alters the motion of
    all of them, or of none."""

    def __init__(self) -> None:
        self._groups: dict[Remark, list[Element]] = {}
        self._words: dict[Remark, dict[str, None]] = {}
        self._alters: dict[str | Remark, bool] = {}  # in the order of the first remarks

    def say(self, sentence: str, alters: bool = False) -> None:
        """Add a sentence, once; `alters`: the motion is another than the file's."""
        self._alters[sentence] = alters or self._alters.get(sentence, False)

    def on(self, element: Element, remark: str, alters: bool = False, words: str = "") -> None:
        """Add a remark on an element, such as "is left out: a contact is no joint"; `alters` as for
        `say`; words: of the remark, in which it may differ from others that share a sentence."""
        before, _, behind = remark.partition(words) if words else (remark, "", "")
        key = Remark(element.tag, before, behind, alters)
        self._alters[key] = alters
        self._groups.setdefault(key, []).append(element)
        self._words.setdefault(key, {})[words] = None

    def sentences(self) -> tuple[str, ...]:
        """Return all sentences in the order of their first remarks."""
        return tuple(map(self._sentence, self._alters))

    def caveats(self) -> tuple[str, ...]:
        """Return the sentences on what alters the motion."""
        return tuple(self._sentence(item) for item, alters in self._alters.items() if alters)

    def _sentence(self, key: str | Remark) -> str:
        if isinstance(key, str):
            return key
        elements, words = self._groups[key], [*self._words[key]]
        more = ", ..." if len(words) > SHOWN else ""
        remark = f"{key.before}{', '.join(words[:SHOWN])}{more}{key.behind}"
        first = elements[0]
        if len(elements) == 1:
            return f"{first.place}: {first.label} {remark}"
        names = [
            repr(element.attributes["name"])
            for element in elements[:SHOWN]
            if element.attributes.get("name")
        ]
        shown = (
            f" ({', '.join(names)}{', ...' if len(elements) > len(names) else ''})" if names else ""
        )
        return f"{first.place} and {len(elements) - 1} more: <{key.tag}>{shown} {remark}"
