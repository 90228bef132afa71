"""YAML text read safely: plain mappings, lists, numbers and text, with the line of every element.

The document is built from the parser's events, so that nothing can be constructed but plain data.
Numbers are those of YAML 1.2: 1e-3 is a number, 010 is ten, and 1:30 or a date is text. An alias
(`*name`) stands for what its anchor (`&name`) holds; entries count as if aliases were written out,
and too many are refused before anything is copied.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn

import yaml

from linkwork.mechanism.refusal import VANISHES, MechanismError

MAX_DEPTH = 16
MAX_ENTRIES = 300_000

NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\Z", re.ASCII)
NOT_FINITE = re.compile(r"[-+]?\.(?:inf|nan)\Z", re.IGNORECASE)
EMPTY = re.compile(r"(?:~|null|)\Z", re.IGNORECASE)
TRUTH = re.compile(r"(?:true|false|yes|no|on|off)\Z", re.IGNORECASE)
NO_TEXT = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

Parser: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
Where = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class DocumentNode:
    """Hold an element: its plain data, the line where it begins, and its parts by key or index."""

    data: Any
    line: int
    parts: Mapping[str, DocumentNode] = field(default_factory=dict)

    def line_of(self, where: Where) -> int:
        """Return the line of the element at a path, or of the nearest element around it that is
        there."""
        node = self
        for part in where:
            if part not in node.parts:
                break
            node = node.parts[part]
        return node.line


def read_document(text: str) -> DocumentNode:
    """Read the one document of a YAML text.

    Raises:
        MechanismError: text that is not YAML, holds no or several documents, tags, keys given twice
            or that are no names, more than MAX_DEPTH levels or MAX_ENTRIES entries; `place` is the
            line.
    """
    stray = NO_TEXT.search(text)
    if stray:
        line = text.count("\n", 0, stray.start()) + 1
        _refuse(
            line,
            (
                f"holds the character U+{ord(stray[0]):04X}, which no YAML text may; is it a "
                "binary file?"
            ),
        )
    try:
        return DocumentReader(text).document()
    except yaml.YAMLError as error:
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
        rows = text.split("\n")
        line = min(mark.line + 1, len(rows)) if mark else 1
        if re.match(" *\t", rows[line - 1]):
            _refuse(line, "is indented by a tab; indent by spaces")
        _refuse(line, f"is not YAML: {problem or ' '.join(str(error).split())}")


class DocumentReader:
    """Build nodes from the events of one text."""

    def __init__(self, text: str):
        self.events: Iterator[Any] = yaml.parse(text, Loader=Parser)
        self.anchors: dict[str, tuple[DocumentNode, int]] = {}
        self.entries = 0

    def document(self) -> DocumentNode:
        next(self.events)
        if isinstance(next(self.events), yaml.StreamEndEvent):
            return DocumentNode(None, 1)
        node = self.node(next(self.events), ())
        next(self.events)
        after = next(self.events)
        if isinstance(after, yaml.DocumentStartEvent):
            _refuse(
                after.start_mark.line + 1,
                "a second document begins here; a file holds one mechanism",
            )
        return node

    def node(self, event: Any, where: Where) -> DocumentNode:
        line = event.start_mark.line + 1
        if isinstance(event, yaml.AliasEvent):
            return self.alias(event.anchor, line, where)
        if event.tag:
            _refuse(
                line,
                f"the tag {event.tag!r} is not read; give plain numbers, text, lists and mappings",
                where,
            )
        if len(where) > MAX_DEPTH:
            _refuse(
                line,
                f"is nested deeper than {MAX_DEPTH} levels; a mechanism needs no more",
                where[:3],
            )
        before = self.entries
        self.count(1, line)
        if isinstance(event, yaml.MappingStartEvent):
            node = self.mapping(line, where)
        elif isinstance(event, yaml.SequenceStartEvent):
            node = self.sequence(line, where)
        else:
            node = DocumentNode(_scalar(event, where), line)
        if event.anchor:
            self.anchors[event.anchor] = node, self.entries - before
        return node

    def mapping(self, line: int, where: Where) -> DocumentNode:
        parts: dict[str, DocumentNode] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            _refuse_decimal_comma(event, parts, where)
            key, at = _key(event, where), event.start_mark.line + 1
            if key in parts:
                _refuse(
                    at,
                    f"is given twice, first in line {parts[key].line}; keep one of them",
                    (*where, key),
                )
            parts[key] = replace(self.node(next(self.events), (*where, key)), line=at)
        return DocumentNode({key: node.data for key, node in parts.items()}, line, parts)

    def sequence(self, line: int, where: Where) -> DocumentNode:
        items: list[DocumentNode] = []
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            items.append(self.node(event, (*where, str(len(items)))))
        return DocumentNode(
            [node.data for node in items],
            line,
            {str(index): node for index, node in enumerate(items)},
        )

    def alias(self, name: str, line: int, where: Where) -> DocumentNode:
        if name not in self.anchors:
            _refuse(
                line,
                f"the alias *{name} stands for nothing: no finished &{name} comes before it",
                where,
            )
        node, entries = self.anchors[name]
        self.count(entries, line)
        return node

    def count(self, entries: int, line: int) -> None:
        self.entries += entries
        if self.entries > MAX_ENTRIES:
            _refuse(line, f"holds more than {MAX_ENTRIES} entries, with aliases written out")


def vanishes(text: str) -> bool:
    """Tell whether the text of a number other than zero means one that a double does not hold in
    full."""
    mantissa = text.lower().partition("e")[0]
    return abs(float(text)) < sys.float_info.min and re.search("[1-9]", mantissa) is not None


def _scalar(event: Any, where: Where) -> float | str | None:
    """Return the number, text or nothing that a scalar means; what stands in quotes is text."""
    text = event.value
    if not event.implicit[0]:
        return text
    if TRUTH.match(text):
        fault = f"{text} without quotes means true or false, which nothing in a mechanism is"
        _refuse(
            event.start_mark.line + 1,
            f"{fault}; put it in quotes to use it as a name: '{text}'",
            where,
        )
    if EMPTY.match(text):
        return None
    if NUMBER.match(text):
        if vanishes(text):
            _refuse(event.start_mark.line + 1, f"{text} {VANISHES}", where)
        return int(text) if re.fullmatch(r"[-+]?\d{1,15}", text) else float(text)
    if NOT_FINITE.match(text):
        return float(text.replace(".", ""))
    return text


def _key(event: Any, where: Where) -> str:
    """Return the text of a key."""
    line = event.start_mark.line + 1
    if not isinstance(event, yaml.ScalarEvent) or event.tag or event.anchor:
        _refuse(line, "a key is not plain text; give a name before each colon", where)
    key = _scalar(event, where)
    if key is None:
        _refuse(line, "a key is empty; give a name before each colon", where)
    if not isinstance(key, str):
        _refuse(
            line,
            (
                f"the key {event.value} is a number; put it in quotes to use it as a name: "
                f"'{event.value}'"
            ),
            where,
        )
    if key == "<<" and event.implicit[0]:
        _refuse(line, "merging by << is not read; write the fields out", where)
    return key


def _refuse_decimal_comma(event: Any, before: dict[str, DocumentNode], where: Where) -> None:
    """Refuse {mass: 0,8}, which YAML reads as {mass: 0, 8: null}."""
    digits = getattr(event, "value", "")
    last = next(reversed(before), "")
    if last and isinstance(whole := before[last].data, int) and digits.isdecimal():
        fault = f"{whole},{digits} has a comma for the decimal point"
        _refuse(event.start_mark.line + 1, f"{fault}; write {whole}.{digits}", (*where, last))


def _refuse(line: int, what: str, where: Where = ()) -> NoReturn:
    raise MechanismError(what, where, f"line {line}")
