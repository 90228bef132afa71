"""The page of the notation speaks of what is there: every code name of its dictionary is a name of
the library."""

import ast
import re
from pathlib import Path

import pytest

from tests.house import modules, nodes

PAGE = Path(__file__).parents[1] / "docs" / "notation.md"


def names(tree: ast.AST) -> set[str]:
    """Return what a module defines or sets: classes, functions, variables, attributes,
    arguments."""
    return {
        getattr(node, "name", None) or getattr(node, "id", None) or getattr(node, "attr", "")
        for node in nodes(tree)
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.Name | ast.Attribute)
    }


@pytest.fixture(scope="module")
def known():
    return {name for _, tree in modules() for name in names(tree)}


def rows() -> list[list[str]]:
    """Return the dictionary's rows, cell by cell."""
    section = PAGE.read_text(encoding="utf-8").partition("## Our own terms")[2]
    found = [line.strip("| ").split(" | ") for line in section.splitlines() if line[:1] == "|"]
    return found[2:]


def test_the_dictionary_names_what_is_in_the_code(known):
    assert len(rows()) > 20
    for term, code, meaning in rows():
        asked = re.findall(r"`([^`]+)`", code)
        assert asked and meaning, term
        assert not [name for name in asked if name not in known], term


def test_no_term_is_told_twice():
    terms = [term for row in rows() for term in row[0].split(", ")]
    assert len(terms) == len({*terms})
