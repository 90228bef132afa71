"""Versions of formats, of which 1.11 is later than 1.5, and elements that a file gives again, of
which the first one counts."""

from __future__ import annotations

from collections.abc import Iterable

from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element


def numbered(version: str) -> tuple[int, int] | None:
    """Return the numbers of a version, such as 1.11 or 2; None where there are none."""
    major, _, minor = version.strip().partition(".")
    known = major.isdecimal() and (minor or "0").isdecimal()
    return (int(major), int(minor or 0)) if known else None


def tell_repeats(element: Element, once: Iterable[str], notes: Notes, alters: bool = False) -> None:
    """Note the children of some tags that stand in an element again; `alters` as for notes."""
    for tag in once:
        for other in list(element.each(tag))[1:]:
            remark = f"in a <{element.tag}> is left out: the first counts"
            notes.on(other, remark, alters=alters)
