"""How many files a new thing touches: what a joint type, a shape or a drive is stands in few files.

Files that make joints or shapes of the types that they need (a reader or writer what its format
has, loops their fixed ends, engines links for rods) are no part of that: a new type leaves them as
they are.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from typing import get_args

import pytest

from linkwork.control import DRIVES
from linkwork.mechanism import PairJoint, Shape
from linkwork.mechanism.joints import TYPES

from tests.house import SOURCE, modules, nodes, package, strings

PAIRS = [kind for kind in TYPES.values() if issubclass(kind, PairJoint)]
SHAPES = get_args(get_args(Shape)[0])
MAKERS = {
    "equations/topology.py",
    "formats/drake.py",
    "formats/floating.py",
    "formats/mjcf/loops.py",
    "formats/sdf/joints.py",
    "formats/sdf/links.py",
    "formats/sdf/reader.py",
    "formats/sdf/writer.py",
    "formats/urdf/reader.py",
    "formats/urdf/shapes.py",
    "formats/urdf/sidecars.py",
    "formats/urdf/writer.py",
    "lab/engines/rewrite.py",
    "lab/textbook/kinematics.py",
}
TOLD_APART = {"lab/engines/joints.py"}
"""The engines' own words for joints, by their type: an independent check."""
OTHERWISE = {"fixed", "free", "planar", "rod", "screw", "gear"}
"""Types whose words mean something else as well: a motion, a part of a drawing, MJCF's own."""


def words_of(tree: ast.Module) -> Iterator[str]:
    """Yield the names that a file uses, and the strings that stand in it."""
    for node in nodes(tree):
        match node:
            case ast.Name(id=word) | ast.Attribute(attr=word) | ast.ClassDef(name=word):
                yield word
            case ast.alias(name=word) | ast.Constant(value=str(word)):
                yield word


@cache
def words() -> dict[str, set[str]]:
    """Return what stands in each file, robots aside."""
    return {
        path.relative_to(SOURCE).as_posix(): {*words_of(tree)}
        for path, tree in modules()
        if package(path) != "robots"
    }


def naming(name: str) -> set[str]:
    """Return the files, robots aside, that use a name."""
    return {file for file, found in words().items() if name in found}


@pytest.mark.parametrize("kind", PAIRS, ids=lambda kind: kind.__name__)
def test_a_joint_type_is_told_in_at_most_six_files(kind):
    room = f"equations/joints/{kind.model_fields['type'].default}.py"
    told = (naming(kind.__name__) | TOLD_APART) - MAKERS
    assert {"mechanism/joints.py", room} <= told and len(told) <= 6


def test_no_other_file_knows_a_joint_by_the_word_for_its_type():
    """Motions and rows say what a joint is; only the engines' own telling begins with the type."""
    types = {*TYPES} - OTHERWISE
    found = {
        path.relative_to(SOURCE).as_posix() for path, tree in modules() if strings(tree) & types
    }
    assert {name for name in found if not name.startswith(("formats/urdf/", "formats/sdf/"))} == {
        "mechanism/joints.py",
        *TOLD_APART,
    }


@pytest.mark.parametrize("kind", SHAPES, ids=lambda kind: kind.__name__)
def test_a_shape_is_told_in_at_most_three_files(kind):
    # Matplotlib's polygons, and Gymnasium's spaces.
    told = naming(kind.__name__) - MAKERS - {"views/canvas.py", "gym/environments.py"}
    assert "mechanism/shapes.py" in told and len(told) <= 3


@pytest.mark.parametrize("kind", DRIVES, ids=lambda kind: kind.__name__)
def test_a_drive_is_told_in_two_files(kind):
    told = naming(kind.__name__)
    assert "control/__init__.py" in told and len(told) <= 2 + (kind.__name__ == "Ideal") * 2
