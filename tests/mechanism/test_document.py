"""YAML text is read as plain data with lines; what could harm or mislead is refused at once."""

import math
import tracemalloc

import pytest

from linkwork.mechanism import MechanismError, document
from linkwork.mechanism.document import MAX_DEPTH, MAX_ENTRIES, read_document


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *(
            ("1", 1),
            ("-7", -7),
            ("+3", 3),
            ("1.5", 1.5),
            (".5", 0.5),
            ("5.", 5.0),
            ("1e-3", 1e-3),
            ("1E3", 1e3),
        ),
        *(
            ("010", 10),
            ("-.5e+2", -50.0),
            (".inf", math.inf),
            ("-.INF", -math.inf),
            ("9" * 400, math.inf),
        ),
        *(("~", None), ("null", None), ("", None), ("'~'", "~"), ("'1'", "1"), ('"on"', "on")),
        *(
            ("1:30", "1:30"),
            ("2024-01-01", "2024-01-01"),
            ("1_000", "1_000"),
            ("0x1F", "0x1F"),
            ("e3", "e3"),
        ),
        *(("٣", "٣"), ("a b", "a b"), ('"\\t"', "\t"), ("=", "="), ("1e", "1e"), (".", ".")),
        *(("[1, [a], {}]", [1, ["a"], {}]), ("- 1\n  - 2", ["1 - 2"])),
    ],
)
def test_values(text, value):
    assert read_document(f"x: {text}" if text[:2] != "- " else text).data in ({"x": value}, value)


def test_whole_numbers_stay_whole():
    assert str(read_document("[1, 1.0, 1e0]").data) == "[1, 1.0, 1.0]"


def test_lines_of_elements():
    root = read_document(
        "# first\na: 1\n\nb:\n  c: [1,\n    2]\n  d:\n    - x\n    - y: 1\n'e.f': {g: 1}\n"
    )
    lines = {
        (): 2,
        ("a",): 2,
        ("b",): 4,
        ("b", "c"): 5,
        ("b", "c", "0"): 5,
        ("b", "c", "1"): 6,
        ("b", "d"): 7,
        ("b", "d", "0"): 8,
        ("b", "d", "1", "y"): 9,
        ("e.f", "g"): 10,
        ("b", "d", "missing"): 7,
        ("b", "d", "1", "missing", "deeper"): 9,
        ("missing",): 2,
    }
    assert {where: root.line_of(where) for where in lines} == lines


def test_aliases_stand_for_what_their_anchors_hold():
    root = read_document("a: &x {m: [1, 2]}\nb: *x\nc: [*x, *x]\n")
    assert root.data == {"a": {"m": [1, 2]}, "b": {"m": [1, 2]}, "c": [{"m": [1, 2]}] * 2}
    assert root.line_of(("b",)) == 2
    assert root.line_of(("b", "m")) == 1


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "a: 1\nb: on",
            (
                "line 2: b: on without quotes means true or false, which nothing in a mechanism "
                "is; put it in"
            ),
        ),
        ("a:\n  yes: 1", "line 2: a: yes without quotes means true or false"),
        ("a: [x, False]", "line 1: a.1: False without quotes means true or false"),
        (
            "a:\n  1: 2",
            "line 2: a: the key 1 is a number; put it in quotes to use it as a name: '1'",
        ),
        (
            "a:\n  1e3: 2",
            "line 2: a: the key 1e3 is a number; put it in quotes to use it as a name: '1e3'",
        ),
        ("a: {m: 0,8}", "line 1: a.m: 0,8 has a comma for the decimal point; write 0.8"),
        ("{~: 1}", "line 1: a key is empty; give a name before each colon"),
        ("? [a]\n: 1", "line 1: a key is not plain text; give a name before each colon"),
        ("a: &x b\n*x : 1", "line 2: a key is not plain text"),
        (
            "a:\n  b: 1\n  c: 2\n  b: 3",
            "line 4: a.b: is given twice, first in line 2; keep one of them",
        ),
        (
            "a: &x {b: 1}\nc:\n  <<: *x",
            "line 3: c: merging by << is not read; write the fields out",
        ),
        ("a: 1\nb:\n\tc: 2", "line 3: is indented by a tab; indent by spaces"),
        ("a: 1\nb: [1, 2", "line 2: is not YAML: "),
        ("a: b: c", "line 1: is not YAML: mapping values are not allowed"),
        ("a: 1\n---\nb: 2", "line 2: a second document begins here; a file holds one mechanism"),
        (
            "a: !!python/object/apply:os.system [ls]",
            "line 1: a: the tag 'tag:yaml.org,2002:python/object/apply:os.syst",
        ),
        ("a: !!python/name:os.system", "line 1: a: the tag "),
        (
            "a: !mine 1",
            "line 1: a: the tag '!mine' is not read; give plain numbers, text, lists and mappings",
        ),
        ("!!map {a: 1}", "line 1: the tag "),
        ("a: *x", "line 1: a: the alias *x stands for nothing: no finished &x comes before it"),
        ("a: &x [*x]", "line 1: a.0: the alias *x stands for nothing"),
        (
            "a: 1\nb: x\0y",
            "line 2: holds the character U+0000, which no YAML text may; is it a binary file?",
        ),
        ("a: \x1b[0m", "line 1: holds the character U+001B"),
        ("a: '\ud800'", "line 1: holds the character U+D800"),
    ],
)
def test_refusals(text, sentence):
    with pytest.raises(MechanismError) as refusal:
        read_document(text)
    assert str(refusal.value).startswith(sentence), str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_deep_nesting_is_read_to_its_limit():
    assert read_document("[" * MAX_DEPTH + "]" * MAX_DEPTH).data
    with pytest.raises(MechanismError, match=f"is nested deeper than {MAX_DEPTH} levels"):
        read_document("[" * (MAX_DEPTH + 1) + "x" + "]" * (MAX_DEPTH + 1))


LAUGHS = "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 30))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "a0: &a0 [ha, ha]\n" + LAUGHS,
            f"holds more than {MAX_ENTRIES} entries, with aliases written out",
        ),
        ("[" * 3_000_000, "is nested deeper"),
        ("- " * 1_000_000, "is nested deeper"),
        ("".join(" " * i + "a:\n" for i in range(2000)), "is nested deeper"),
        ("? " * 1_000_000, "a key is not plain text"),
        ("a: '" + "b" * 2_000_000, "is not YAML: found unexpected end of stream"),
        ("a:" * 300_000, "is not YAML"),
    ],
    ids=["laughs", "flow", "block", "steps", "keys", "quote", "colons"],
)
def test_bombs_are_refused(text, sentence):
    with pytest.raises(MechanismError, match=sentence):
        read_document(text)


def test_entries_are_counted(monkeypatch):
    monkeypatch.setattr(document, "MAX_ENTRIES", 10)
    assert read_document("[&x [1, 2], *x, *x]").data == [[1, 2]] * 3
    assert read_document("{a: [1, 2, 3, 4, 5, 6, 7, 8]}").data
    for text in ("[&x [1, 2], *x, *x, 1]", "{a: [1, 2, 3, 4, 5, 6, 7, 8, 9]}"):
        with pytest.raises(
            MechanismError, match="line 1: holds more than 10 entries, with aliases written out"
        ):
            read_document(text)


def test_laughs_take_no_memory():
    tracemalloc.start()
    try:
        with pytest.raises(MechanismError, match="entries"):
            read_document("a0: &a0 [ha, ha]\n" + LAUGHS)
        assert tracemalloc.get_traced_memory()[1] < 5e6
    finally:
        tracemalloc.stop()
