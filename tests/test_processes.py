"""No test waits for ever: neither for a process nor for a thread, a browser or a lock."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

WAITS = ("acquire", "communicate", "join", "result", "wait")
"""Methods that wait for ever unless they are told for how long."""


def waits(tree: ast.AST) -> list[int]:
    """Return the lines that wait without a limit."""
    calls = [
        (node, node.func)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
    ]
    return [
        call.lineno
        for call, asked in calls
        if (asked.attr in WAITS and not (call.args or call.keywords))
        or (
            asked.attr in ("run", "check_output")
            and ast.unparse(asked.value) == "subprocess"
            and not any(given.arg in (None, "timeout") for given in call.keywords)
        )
    ]


def test_every_wait_of_a_test_has_a_limit():
    folder, asking = Path(__file__).parent, re.compile(rf"\b({'|'.join(WAITS)}|subprocess)\b")
    texts = {
        path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8")
        for path in folder.rglob("*.py")
    }
    trees = {name: ast.parse(text) for name, text in texts.items() if asking.search(text)}
    assert {name: lines for name, tree in trees.items() if (lines := waits(tree))} == {}


@pytest.mark.parametrize(
    ("text", "without"),
    [
        ("thread.join()", True),
        ("thread.join(3.0)", False),
        ("subprocess.run(words, check=True)", True),
        ("subprocess.run(words, timeout=3)", False),
        ("process.wait(timeout=3)", False),
    ],
)
def test_what_waits_without_a_limit_is_found(text, without):
    assert waits(ast.parse(text)) == [1] * without
