"""Notes: sentences on what a reader or a writer left out, took otherwise, or decided, each with its place."""

from __future__ import annotations

from linkwork.formats.xml import Element

SHOWN = 4  # names of elements in one sentence


class Notes:
    """Gather sentences; elements of one tag with the same remark share a sentence."""

    def __init__(self) -> None:
        self._groups: dict[tuple[str, str], list[Element]] = {}
        self._sentences: list[str | tuple[str, str]] = []

    def say(self, sentence: str) -> None:
        """Add a sentence, once."""
        if sentence not in self._sentences:
            self._sentences.append(sentence)

    def on(self, element: Element, remark: str) -> None:
        """Add a remark on an element, such as "is left out: a contact is no joint"."""
        key = element.tag, remark
        if key not in self._groups:
            self._groups[key] = []
            self._sentences.append(key)
        self._groups[key].append(element)

    def sentences(self) -> tuple[str, ...]:
        """Return all sentences in the order of their first remarks."""
        return tuple(item if isinstance(item, str) else self._sentence(item) for item in self._sentences)

    def _sentence(self, key: tuple[str, str]) -> str:
        tag, remark = key
        elements = self._groups[key]
        first = elements[0]
        if len(elements) == 1:
            return f"{first.place}: {first.label} {remark}"
        names = [repr(element.attributes["name"]) for element in elements[:SHOWN] if element.attributes.get("name")]
        shown = f" ({', '.join(names)}{', ...' if len(elements) > len(names) else ''})" if names else ""
        return f"{first.place} and {len(elements) - 1} more: <{tag}>{shown} {remark}"
