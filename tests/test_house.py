"""What may ask what: the laboratory asks the library, nothing of the library but the command line
asks the laboratory."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import pytest

import linkwork as lw

from tests.house import (
    CORE,
    SOURCE,
    WINGS,
    code_lines,
    core_files,
    imports,
    modules,
    oversized,
    package,
    part,
    strings,
    uncommented,
)
from tests.processes import finished

LAB = "linkwork.lab"


def test_only_the_command_line_asks_the_laboratory():
    asking = {
        package(path)
        for path, names in imports().items()
        if any(f"{name}.".startswith(f"{LAB}.") for name in names)
    }
    assert asking - {"__init__"} == {"lab", "cli"}


def test_the_laboratory_does_not_ask_the_command_line():
    asked = {name for path, names in imports().items() if package(path) == "lab" for name in names}
    assert not any(name.startswith("linkwork.cli") for name in asked)


def test_formats_alone_list_the_suffixes_of_model_files():
    """A new format is a package in `formats` and a line in its list."""
    listing = {
        path.relative_to(SOURCE).as_posix()
        for path, tree in modules()
        if strings(tree) & {*lw.formats.MODELS}
    }
    assert listing == {"formats/models.py"}


@pytest.mark.parametrize(("former", "name"), [("engines", "available"), ("textbook", "Textbook")])
def test_former_names_lead_to_the_laboratory_and_warn(former, name):
    here = getattr(importlib.import_module(f"{LAB}.{former}"), name)
    with pytest.warns(
        DeprecationWarning, match=rf"linkwork\.{former} is linkwork\.lab\.{former} now"
    ) as told:
        assert getattr(getattr(lw, former), name) is here
    assert told[0].filename == __file__
    with pytest.warns(DeprecationWarning), pytest.raises(ImportError, match="nothing"):
        exec(f"from linkwork.{former} import {name}, nothing")


def test_modules_of_the_engines_are_still_found_by_their_former_name():
    with pytest.warns(DeprecationWarning):
        interface = importlib.import_module("linkwork.engines.interface")
    assert issubclass(interface.EngineError, lw.LinkworkError)


def test_the_former_place_of_work_precision_diagrams_warns():
    from linkwork.lab.precision import plot_work_precision

    with pytest.warns(DeprecationWarning, match=r"linkwork\.lab\.precision now"):
        assert lw.views.plot_work_precision is plot_work_precision
    with pytest.raises(AttributeError, match=r"'linkwork\.views' has no attribute 'plot_nothing'"):
        _ = lw.views.plot_nothing


def test_lines_of_code_are_counted_without_docstrings_comments_and_blanks(tmp_path):
    text = (
        '"""Doc.\n\nMore."""\n\n# comment\nx = """a\nb"""\n\n\ndef f():\n    """Doc."""\n    '
        "return x  # why\n"
    )
    path = tmp_path / "module.py"
    path.write_text(text)
    assert code_lines(path, ast.parse(text)) == 4
    assert all((SOURCE / name).is_dir() for name in CORE)


def test_the_core_is_what_stands_in_no_wing():
    """Each wing has modules, and each module named there is one."""
    own = [path for path, _ in modules() if package(path) in CORE]
    stems = {path.stem for path in own} | {f"{package(path)}/{path.stem}" for path in own}
    named = [name for names in WINGS.values() for name in names if "*" not in name]
    assert {*named} <= stems and len(named) == len({*named})
    assert {*WINGS} <= {part(path) for path, _ in modules()}
    files = [name for name, _ in core_files()]
    assert files[0].startswith("mechanism/") and files[-1].startswith("robot/")
    assert not {Path(name).stem for name in files} & {*named}


def test_the_rooms_of_the_laboratory_are_opened_when_they_are_asked_for():
    asking = (
        "import linkwork as lw; print(sorted(lw.lab.__all__)); "
        "print(lw.lab.precision.plot_work_precision.__name__)"
    )
    told = finished("-c", asking, check=True).stdout
    assert told.split("\n")[1] == "plot_work_precision"
    with pytest.raises(AttributeError, match=r"'linkwork\.lab' has no attribute 'attic'"):
        _ = lw.lab.attic


def test_controllers_never_ask_for_the_robot_that_they_control():
    """Not for its type either: they ask what `control.plant` says, of whatever it is."""
    asked = {
        name for path, names in imports().items() if package(path) == "control" for name in names
    }
    higher = tuple(f"linkwork.{stage}." for stage in ("model", "runs", "robot"))
    assert not any(f"{name}.".startswith(higher) for name in asked)


MOST = 30
"""Lines of a function's body that are understood without a comment."""


def test_functions_of_many_lines_say_what_holds_in_them():
    """A comment above each block, or shorter functions whose names say it."""
    assert not {
        path.relative_to(SOURCE).as_posix(): names
        for path, tree in modules()
        if (names := uncommented(path, tree, MOST))
    }


@pytest.mark.parametrize(("comment", "found"), [("", ["f"]), ("    # Sums.\n", [])])
def test_a_long_function_without_comments_is_found(comment, found, tmp_path):
    path = tmp_path / "module.py"
    path.write_text(f'def f():\n    """Doc."""\n{comment}' + "    x = 1  # one\n" * 31)
    assert uncommented(path, ast.parse(path.read_text()), 30) == found
    assert uncommented(path, ast.parse(path.read_text()), 31) == []


def test_compiled_loops_are_told_in_steps():
    assert not {
        path.relative_to(SOURCE).as_posix(): names
        for path, tree in modules()
        if (names := oversized(path, tree, lines=60, arguments=12))
    }


@pytest.mark.parametrize(("lines", "arguments"), [(4, 12), (60, 1)])
def test_a_compiled_function_that_is_too_long_or_takes_too_much_is_found(
    lines, arguments, tmp_path
):
    path, body = tmp_path / "module.py", "    x = a\n" * 5
    path.write_text(f'@njit(**OPTIONS)\ndef f(a, b):\n    """Doc."""\n    # Sums.\n{body}')
    tree = ast.parse(path.read_text())
    assert oversized(path, tree, lines, arguments) == ["f: 5 lines, 2 arguments"]
    assert oversized(path, tree, 5, 2) == []
