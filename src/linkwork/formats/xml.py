"""XML read safely: a plain tree of elements that know their file and line, and refuse what they
cannot make sense of.

A document type with its entities ("billion laughs"), a file that is too large, too deep or has too
many elements is refused while it is read; nothing outside the file is ever opened here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import inf, isfinite, isinf
from pathlib import Path
from typing import Any, TypeVar
from xml.parsers import expat

from linkwork.formats.mending import mended
from linkwork.mechanism import MechanismError
from linkwork.mechanism.document import vanishes
from linkwork.mechanism.record import HUGE, Record
from linkwork.mechanism.refusal import VANISHES

LARGEST = 20_000_000  # bytes
DEEPEST = 250  # elements inside one another
MOST = 400_000  # elements
ATTRIBUTES = 200  # of one element
FLAGS = {"true": True, "1": True, "false": False, "0": False}
MACROS = ("${", "$(")  # what begins as xacro's do
LONGEST = 600  # letters of what is wrong with an element

R = TypeVar("R", bound=Record)


@dataclass(frozen=True, slots=True)
class Element:
    """Hold an element: its tag, attributes and children, and where it stands.

    line: of the file; 0 where the text is not the file's own
    scope: which one it comes from, of several models that a reader put together
    """

    tag: str
    attributes: Mapping[str, str]
    file: Path
    line: int
    children: list[Element] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    scope: str = ""

    @property
    def content(self) -> str:
        """Return the text between the tags, without spaces at its ends."""
        return "".join(self.texts).strip()

    @property
    def label(self) -> str:
        """Return what a user calls the element: <joint 'hip'>."""
        name = self.attributes.get("name")
        return f"<{self.tag} {shortened(name)}>" if name else f"<{self.tag}>"

    @property
    def place(self) -> str:
        """Return what a note begins with: the file, and the line in it if there is one."""
        return f"{self.file.name}, line {self.line}" if self.line else self.file.name

    def refusal(self, what: str) -> MechanismError:
        """Return a refusal of this element: file, line, element, and the sentence."""
        what = what if len(what) <= LONGEST else f"{what[: LONGEST - 4]} ..."
        line = f" line {self.line}:" if self.line else ""
        return MechanismError(f"{self.file}:{line} {self.label}: {what}")

    def each(self, *tags: str) -> Iterator[Element]:
        """Yield the children of some tags."""
        return (child for child in self.children if child.tag in tags)

    def first(self, tag: str) -> Element | None:
        """Return the first child of a tag, or None."""
        return next(self.each(tag), None)

    def named(self, name: str) -> Element:
        """Return the first child of a tag; one that is missing is refused."""
        child = self.first(name)
        if child is None:
            raise self.refusal(f"holds no <{name}>; add one")
        return child

    def inner(self, tag: str) -> Element | None:
        """Return the first child of a tag with its text as the attribute of that name, so that it
        is read and refused as attributes are; None where there is none."""
        child = self.first(tag)
        return child and replace(child, attributes={**child.attributes, tag: child.content})

    def inner_number(self, tag: str, default: float, most: float = HUGE) -> float:
        """Return the number that is the text of a child; one without text says nothing."""
        child = self.inner(tag)
        if child is None or not child.attributes[tag]:
            return default
        return child.number(tag, most=most)

    def inner_flag(self, tag: str, default: bool = False) -> bool:
        """Return the truth value that is the text of a child: true or 1, false or 0; one without
        text says nothing."""
        child = self.first(tag)
        word = "" if child is None else child.content.lower()
        if child is not None and word and word not in FLAGS:
            raise child.refusal(f"holds {shortened(child.content)}; give true or false")
        return FLAGS.get(word, default)

    def with_attributes(self, attributes: Mapping[str, str]) -> Element:
        return replace(self, attributes=attributes)

    def text(self, name: str) -> str:
        """Return an attribute; one that is missing is refused."""
        if name not in self.attributes:
            raise self.refusal(f"has no attribute {name!r}; add it")
        return self.attributes[name]

    def choice(self, name: str, choices: tuple[str, ...], default: str) -> str:
        """Return an attribute that must be one of some words."""
        word = self.attributes.get(name, default)
        if word not in choices:
            raise self.refusal(f"{name} {shortened(word)} is not one of {', '.join(choices)}")
        return word

    def numbers(
        self,
        name: str,
        counts: tuple[int, ...],
        default: tuple[float, ...] | None = None,
        most: float = HUGE,
    ) -> tuple[float, ...]:
        """Return the numbers of an attribute; another count than those allowed, or a number that is
        not finite, is refused. An attribute of blanks gives nothing, as in MuJoCo.

        most: the largest number of either sign, which may be infinite itself
        """
        if default is not None and not self.attributes.get(name, "").strip():
            return default
        text = self.text(name)
        if any(mark in text for mark in MACROS):
            what = f"{name} holds {shortened(text)}, which is a macro"
            raise self.refusal(f"{what}; expand the file with xacro first")
        words = text.split()
        if len(words) not in counts:
            wanted = " or ".join(map(str, counts))
            raise self.refusal(f"{name} holds {len(words)} numbers; give {wanted}")
        return tuple(self._number(name, word, most) for word in words)

    def number(self, name: str, default: float | None = None, most: float = HUGE) -> float:
        """Return the number of an attribute."""
        return self.numbers(name, (1,), None if default is None else (default,), most)[0]

    def vector(
        self, name: str, default: tuple[float, float, float] | None = None
    ) -> tuple[float, float, float]:
        """Return the three numbers of an attribute."""
        x, y, z = self.numbers(name, (3,), default)
        return x, y, z

    def make(self, record: type[R], **fields: Any) -> R:
        """Make a record from what the element says; its refusal names the element."""
        try:
            return record(**fields)
        except MechanismError as error:
            raise self.refusal(str(error)) from None

    def _number(self, name: str, word: str, most: float) -> float:
        try:
            value = float(word.replace("_", "?"))
        except ValueError:
            what = "which is not a number"
            raise self.refusal(f"{name} holds {shortened(word)}, {what}") from None
        if not isfinite(value) and not (most == inf and isinf(value)):
            raise self.refusal(
                f"{name} holds {shortened(word, quoted=False)}, which is not a finite number"
            )
        if abs(value) > most:
            raise self.refusal(
                f"{name} holds {shortened(word, quoted=False)}; give numbers up to {most:g}"
            )
        if vanishes(word):
            raise self.refusal(f"{name}: {shortened(word, quoted=False)} {VANISHES}")
        return value


def shortened(text: str, quoted: bool = True) -> str:
    """Return a text, in quotation marks, cut to a length that fits a sentence."""
    text = text if len(text) <= 60 else text[:57] + "..."
    return repr(text) if quoted else text


def read(path: Path) -> Element:
    """Read an XML file as a tree of elements.

    Raises:
        MechanismError: the file cannot be read, is larger than 20 MB, nested deeper than 250
            elements, has more than 400 000 elements, an element with more than 200 attributes, or a
            document type that says more than a name, or is not well-formed and not read by others
            either (the line is named).
    """
    return parsed(contents(path), path)


def parsed(data: bytes, path: Path, lined: bool = True) -> Element:
    """Read XML from bytes as `read` does; lined: they are the file's own, and so are the lines that
    the elements know.

    What is not well-formed but read by others all the same is mended first.
    """
    try:
        return _built(data, path, lined)
    except _BrokenError as broken:
        better = mended(data)
        if better is None or better == data:
            raise
        try:
            return _built(better, path, lined)
        except _BrokenError:
            raise broken from None


class _BrokenError(MechanismError):
    """Say that a text is no XML."""


def _built(data: bytes, path: Path, lined: bool) -> Element:
    """Read well-formed XML."""
    parser, building = expat.ParserCreate(), _Building(path)
    parser.buffer_text = True
    parser.StartElementHandler = lambda tag, attributes: building.start(
        tag, attributes, parser.CurrentLineNumber if lined else 0
    )
    parser.EndElementHandler = building.end
    parser.CharacterDataHandler = building.say
    parser.StartDoctypeDeclHandler = building.refuse_doctype
    parser.EntityDeclHandler = building.refuse_entities
    try:
        parser.Parse(data, True)
    except MechanismError:
        raise
    except expat.ExpatError as error:
        if not building.complete:
            what = expat.errors.messages[error.code]
            wrong = f"{path}: line {error.lineno}: is not well-formed XML: {what}"
            raise _BrokenError(wrong) from None
        building.pass_over(data[parser.ErrorByteIndex :], error.lineno if lined else 0)
    except (LookupError, ValueError):
        raise MechanismError(
            f"{path}: is in an encoding that is not known; save it as UTF-8"
        ) from None
    return building.open[0].children[0]


def contents(path: Path) -> bytes:
    """Return the bytes of a file; one that is no file, cannot be read or is larger than 20 MB is
    refused."""
    try:
        if path.exists() and not path.is_file():
            raise MechanismError(f"{path}: is not a file; name a model file")
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
    except OSError as error:
        raise MechanismError(
            f"{path}: cannot be read: {(error.strerror or str(error)).lower()}"
        ) from None
    if len(data) > LARGEST:
        raise MechanismError(
            f"{path}: is larger than {LARGEST // 1_000_000} MB; a mechanism's file is not"
        )
    return data


class _Building:
    """Build the tree from the parser's events; `open` holds the elements that are not closed
    yet."""

    def __init__(self, path: Path):
        self.path, self.count = path, 0
        self.open = [Element("", {}, path, 0)]

    @property
    def complete(self) -> bool:
        """Return whether the root has ended."""
        return len(self.open) == 1 and bool(self.open[0].children)

    def start(self, tag: str, attributes: dict[str, str], line: int) -> None:
        self.count += 1
        if self.count > MOST:
            raise MechanismError(
                f"{self.path}: line {line}: holds more than {MOST} elements; a mechanism's file "
                "does not"
            )
        if len(self.open) > DEEPEST:
            raise MechanismError(
                f"{self.path}: line {line}: elements are nested deeper than {DEEPEST}; that is "
                "refused"
            )
        element = Element(tag, attributes, self.path, line)
        if len(attributes) > ATTRIBUTES:
            raise element.refusal(
                f"holds more than {ATTRIBUTES} attributes; no element of a model does"
            )
        self.open[-1].children.append(element)
        self.open.append(element)

    def say(self, text: str) -> None:
        """Keep text between tags, but for the spaces before it."""
        if self.open[-1].texts or not text.isspace():
            self.open[-1].texts.append(text)

    def end(self, tag: str) -> None:
        self.open.pop()

    def pass_over(self, behind: bytes, line: int) -> None:
        """Keep that elements stand behind the end of the root, which others never read: as one that
        no reader knows, so that it is told; comments and spare end tags are nothing."""
        if re.search(rb"<\w", re.sub(rb"<!--.*?-->", b"", behind, flags=re.DOTALL)):
            root = self.open[0].children[0]
            what = f"what stands behind </{root.tag}>"
            root.children.append(Element(what, {}, self.path, line))

    def refuse_doctype(
        self, name: str, system: str | None, public: str | None, inside: bool
    ) -> None:
        """Pass over the name of the root, as of <!DOCTYPE robot>; what says more is refused."""
        if system or public or inside:
            self.refuse_entities()

    def refuse_entities(self, *declaration: Any) -> None:
        raise MechanismError(
            f"{self.path}: declares a document type or entities, which are not read; remove "
            "<!DOCTYPE ...>"
        )
