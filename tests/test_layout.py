"""How the house stands: later stages ask earlier ones, no module asks itself by way of others, and
names are told once."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from functools import cache
from itertools import accumulate, pairwise
from pathlib import Path
from types import ModuleType

import networkx as nx
import pytest

import linkwork as lw

from tests.house import SOURCE, modules, nodes

STAGES = (
    "errors moved notebooks patience",
    "checks readonly",
    "ipopt",
    "threads",
    "solids",
    "math paths mechanism kernels",
    "equations robots",
    "simulation formats",
    "control",
    "model",
    "runs",
    "stepping",
    "gradients",
    "robot",
    "export",
    "autodiff analysis motions scene",
    "design jax torch",
    "views",
    "sweeps viewer lab gym",
    "cli",
)
"""The packages, and modules beside them, from the lowest stage to the highest; those of one stage
do not ask each other."""
FORMER = ("engines", "textbook")
"""Names of the root that lead to where things are now."""
LATER = {
    ("linkwork.mechanism.mechanism", "linkwork.mechanism.files"),
    ("linkwork.simulation.run", "linkwork.gradients.sensitivities"),
    ("linkwork.simulation.run", "linkwork.views.plots"),
    ("linkwork.simulation.run", "linkwork.model.state"),
    ("linkwork.notebooks", "linkwork.views.notebook"),
    ("linkwork.robot.facade", "linkwork.export"),
}
"""What may ask a later module, in a function: a class its own file format; a run its derivatives,
its plot, and the state in its file; objects their pictures in notebooks; a robot what it is
exported as."""


def name_of(path: Path) -> str:
    """Return the name of a module of the library."""
    return ".".join(path.relative_to(SOURCE.parent).with_suffix("").parts).removesuffix(".__init__")


def asked(tree: ast.Module, name: str, names: set[str]) -> Iterator[str]:
    """Yield the modules that a module imports: at once, in functions, for its types, or later by
    their name."""
    former = {
        id(argument)
        for node in nodes(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "leading_to"
        for argument in node.args
    }
    own = {".".join(parts) for parts in accumulate([each] for each in name.split("."))}
    for node in nodes(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in names else node.module
        elif isinstance(node, ast.Constant) and id(node) not in former:
            yield from {str(node.value)} - own


@cache
def graph() -> nx.DiGraph:
    """Return which module of the library asks which."""
    trees = {name_of(path): tree for path, tree in modules()}
    found = nx.DiGraph()
    found.add_nodes_from(trees)
    for name, tree in trees.items():
        found.add_edges_from(
            (name, other)
            for other in asked(tree, name, {*trees})
            if other in trees and other != name
        )
    return found


def package(name: str) -> str:
    """Return the package, or the module beside the packages, that a module belongs to."""
    return (*name.split("."), "")[1]


def test_no_module_asks_itself_by_way_of_others():
    """Imports in functions and those for types count; `LATER` alone is left out."""
    one_way = nx.restricted_view(graph(), (), LATER)
    circles = [
        sorted(circle) for circle in nx.strongly_connected_components(one_way) if len(circle) > 1
    ]
    assert not circles


def test_what_may_ask_a_later_module_does():
    assert {*graph().edges} >= LATER


def test_lower_stages_never_ask_higher_ones():
    stage = {name: number for number, names in enumerate(STAGES) for name in names.split()}
    packages = {package(name) for name in graph()} - {"", "__main__", *FORMER}
    assert packages == {*stage}
    upward = [
        (name, other)
        for name, other in {*graph().edges} - LATER
        for ours, theirs in [(package(name), package(other))]
        if ours in stage and theirs != ours and not stage.get(theirs, len(STAGES)) < stage[ours]
    ]
    assert not sorted(upward)


def test_a_robot_is_above_what_works_on_it():
    """Modules below the facade are typed by what they use."""
    assert {package(name) for name in graph().predecessors("linkwork.robot.facade")} == {"robot"}
    assert [*graph().predecessors("linkwork.robot.facade")] == ["linkwork.robot"]


PARTICULAR = {
    "linkwork.lab.reproduction",
    *(f"linkwork.gym.catalogue._{name}" for name in ("balancing", "reaching", "swinging_up")),
}
"""What is about a robot of the catalogue: the paper's study, and ready environments, in each of
which a robot and a task belong together."""


def test_few_know_a_particular_robot():
    """All else takes whichever it is given, by its description or its name in the catalogue."""
    knowing = {
        name_of(path)
        for path, tree in modules()
        for node in nodes(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "linkwork.robots"
        if {alias.name for alias in node.names} & {*lw.robots.__all__}
    }
    assert {name for name in knowing if package(name) != "robots"} == PARTICULAR


PACKAGES = sorted(name_of(path) for path in SOURCE.rglob("__init__.py"))


@pytest.mark.parametrize("name", PACKAGES)
def test_no_name_of_a_package_shadows_a_module_of_it(name):
    """`linkwork.package.module` is the module, whatever the package exports, at once or when it is
    first asked for."""
    package = importlib.import_module(name)
    shown = {*vars(package), *getattr(package, "__all__", ())}
    own = {other.rpartition(".")[2] for other in graph() if other.rpartition(".")[0] == name}
    assert not [each for each in own & shown if not isinstance(getattr(package, each), ModuleType)]


def test_the_library_shows_its_public_names_only():
    assert dir(lw) == sorted(lw.__all__)
    assert all(first != second for first, second in pairwise(dir(lw)))
    assert not [name for name in dir(lw) if name.startswith("_") and name != "__version__"]


def test_no_two_classes_of_the_library_have_one_name():
    named: dict[str, list[str]] = {}
    for path, tree in modules():
        for node in nodes(tree):
            if isinstance(node, ast.ClassDef):
                named.setdefault(node.name, []).append(name_of(path))
    assert not {name: places for name, places in named.items() if len(places) > 1}


UNTOLD = {
    *("alone", "bench", "cases", "choosing", "culprits", "measures", "plan", "readings", "rows"),
    *("led", "needs", "settled", "sides", "small", "tabled", "undefined"),
}
"""Names that tell no idea."""


def test_the_names_of_modules_tell_their_idea():
    assert not [name for name in graph() if name.rpartition(".")[2] in UNTOLD]


ROBOT_S = re.compile(r"\brobot\.([a-z_]+)")


def test_a_robot_shows_what_is_for_users():
    """What its docstrings and the documentation speak of, all of it told; nothing that modules ask
    of each other."""
    robot = lw.Robot(lw.robots.pendulum())
    shown, told = dir(robot), {*re.findall(r"[a-z_]+", lw.Robot.__doc__ or "")}
    assert all(hasattr(robot, name) and not name.startswith("_") for name in shown)
    assert all(name in told or getattr(type(robot), name).__doc__ for name in shown)
    assert not {"charts", "labels", "assembler", "own", "chart_of", "make_state"} & {*shown}
    pages = [SOURCE.parents[1] / "README.md", *(SOURCE.parents[1] / "docs").rglob("*.md")]
    used = {name for page in pages for name in ROBOT_S.findall(page.read_text(encoding="utf-8"))}
    assert used - {"yaml", "urdf"} <= {*shown}
