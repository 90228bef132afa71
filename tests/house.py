"""How large the house is: `python -m tests.house` counts the lines of code of each package, without
docstrings and blanks; with `core` it lists the files that a reader must know, in their order."""

from __future__ import annotations

import ast
import gc
import sys
import tokenize
from collections import Counter
from fnmatch import fnmatch
from functools import cache
from io import StringIO
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src" / "linkwork"
CORE = ("mechanism", "equations", "kernels", "simulation", "model", "runs", "robot")
"""What a reader must know, as CONTRIBUTING.md says: from a description to a state and a run."""
WINGS = {
    # What a description may hold, and how it is written.
    "files of mechanisms": ("document", "files", "json_schema"),
    "free numbers": ("number_patterns", "numbers", "parameter_units", "parameters", "places"),
    "named quantities": ("formulas", "mechanism/quantities"),
    "shapes, payloads": ("density", "payload", "shapes"),
    "further joints": ("cylindrical", "gears", "planar", "rod", "screw", "universal"),
    "springs, friction": ("effects", "powers"),
    "stops, contact, sticking": (
        *("boxes", "contact", "elastic", "impact", "limits", "meeting", "sticking", "surfaces"),
    ),
    "bearings": ("bearing", "bearing_loads", "bearings", "needed_wrenches", "rubbing"),
    "fluid": ("fluid",),
    "transmissions": ("cables", "displacements", "transmissions"),
    "refusals": ("admission", "checks", "consistency", "refusal"),
    # How equations begin, and which are chosen.
    "home": ("around_home", "homing", "nearest", "reference"),
    "mobility, spins": ("mobility", "reflections", "spins"),
    "changes of chart": (
        *("chart_choice", "chart_margins", "chart_transfer", "known_charts", "next_chart"),
        "reordering",
    ),
    "large mechanisms": (
        *("articulated", "uncharted", "bound", "unit_directions", "unit_rows", "partitioned"),
        *(
            "abreast",
            "by_sections",
            "called",
            "fixed_results",
            "partitioned_slopes",
            "repeats",
            "chart_tables",
        ),
        *("interpreter", "tape"),
    ),
    # How code becomes quick, and is kept.
    "quick deriving": ("operators",),
    "fewer operations": ("fused", "hinge_axes", "regrouping", "simplify", "turned_inertia"),
    "sines and cosines": ("angles", "elementary"),
    "stacks of states": ("dense", "stacks", "stored_states", "transposed"),
    "calls from Python": ("directly", "fastcall", "from_python"),
    "machine code, read and counted": ("listing",),
    "compiled by Numba": ("compiled", "pointers", "structures"),
    "kept and sent": ("cache", "derivations", "pickled"),
    # What a robot is asked at a state.
    "assembling": ("asked", "asked_rows", "assembling", "assembly", "closing"),
    "tool paths": (
        *(
            "following",
            "leading",
            "led_path",
            "modes",
            "passing",
            "path_following",
            "leg_sides",
            "spread",
            "task",
        ),
        *("tool_motion", "walking"),
    ),
    "whole turns": ("turning", "turns", "whole_turns"),
    "redundant drives": ("actuation",),
    "dexterity": ("dexterity",),
    "statics, linear": ("linear", "linear_model", "network", "reactions", "regressor"),
    # What a run may meet, and what is told of it.
    "ensembles": (
        *("lane_*", "lanes", "many", "vectors"),
        *(
            "ensemble",
            "measuring",
            "member_events",
            "members",
            "one_by_one",
            "saved_rows",
            "side_by_side",
        ),
    ),
    "events, stiffness": (
        *("bends", "cable_leaps", "events", "native_events", "native_occurrences", "native_search"),
        "native_watch",
        *("native_rosenbrock", "rosenbrock"),
    ),
    "further methods": ("eighth_order", "fixed_steps", "sharp_smart"),
    "sampled controllers": ("observing", "sampled_calls"),
    "singular poses": ("crossing",),
    "resuming": ("left_states", "resuming"),
    "accounts of runs": (
        *("accuracy", "endings", "fault_sources", "run_record", "runs/quantities", "saved_states"),
        *("stiff_sources", "stiff_trial", "work"),
        "not_finite",
    ),
    "datasets and files": ("awaited", "run_files", "variables"),
}
"""Modules of the core's packages that one needs for these only; they are counted apart."""


@cache
def modules() -> tuple[tuple[Path, ast.Module], ...]:
    """Return all source files with their syntax trees, a million objects that stay: garbage is
    not looked for among them."""
    gc.disable()
    found = tuple(
        (path, ast.parse(path.read_text(encoding="utf-8"))) for path in sorted(SOURCE.rglob("*.py"))
    )
    for _, tree in found:
        nodes(tree)
    gc.freeze()
    gc.enable()
    return found


@cache
def nodes(tree: ast.AST) -> tuple[ast.AST, ...]:
    """Return a syntax tree's nodes, walked through once."""
    return tuple(ast.walk(tree))


def package(path: Path) -> str:
    """Return the name of the package, or of the module beside the packages, that a source file
    belongs to."""
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


def part(path: Path) -> str:
    """Return what a source file is counted for: its package, or a wing of the core."""
    if package(path) not in CORE:
        return package(path)
    wings = (
        wing
        for wing, names in WINGS.items()
        for name in names
        if fnmatch(path.stem, name) or name == f"{package(path)}/{path.stem}"
    )
    return next(wings, package(path))


def statements(path: Path) -> int:
    """Return how many statements a file has, whatever the width of its lines; docstrings not."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return sum(
        isinstance(node, ast.stmt)
        and not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
        for node in ast.walk(tree)
    )


def code_lines(path: Path, tree: ast.Module) -> int:
    """Return how many lines of a file are code: not blank, no comment, no string that stands
    alone."""
    told = {
        line
        for node in nodes(tree)
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    lines = enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    return sum(
        number not in told and not line.lstrip().startswith("#") and bool(line.strip())
        for number, line in lines
    )


def uncommented(path: Path, tree: ast.Module, most: int) -> list[str]:
    """Return the functions whose bodies have more than so many lines of code, and no comment on a
    line of its own."""
    text = path.read_text(encoding="utf-8")
    lines, long = text.splitlines(), []
    for node in nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            told = ast.get_docstring(node) is not None
            begin = (node.body[0].end_lineno or 0) + 1 if told else node.body[0].lineno
            own = range(begin, (node.end_lineno or begin) + 1)
            if sum(bool(lines[number - 1].strip()) for number in own) > most:
                long.append((node.name, own))
    # Comments are looked for where there are such functions.
    tokens = tokenize.generate_tokens(StringIO(text * bool(long)).readline)
    comments = {
        token.start[0]
        for token in tokens
        if token.type == tokenize.COMMENT and token.line.lstrip().startswith("#")
    }
    return [name for name, own in long if not comments & {*own}]


def oversized(path: Path, tree: ast.Module, lines: int, arguments: int) -> list[str]:
    """Return the compiled functions whose bodies have more lines of code, comments not counted, or
    that take more arguments."""
    text, found = path.read_text(encoding="utf-8").splitlines(), []
    for node in nodes(tree):
        if not isinstance(node, ast.FunctionDef):
            continue
        by = {
            name.id
            for each in node.decorator_list
            for name in ast.walk(each)
            if isinstance(name, ast.Name)
        }
        if not by & {"njit", "compiled_once"}:
            continue
        told = ast.get_docstring(node) is not None
        body = text[
            (node.body[0].end_lineno if told else node.body[0].lineno - 1) : node.end_lineno
        ]
        count = sum(bool(line.strip()) and not line.lstrip().startswith("#") for line in body)
        if count > lines or len(node.args.args) > arguments:
            found.append(f"{node.name}: {count} lines, {len(node.args.args)} arguments")
    return found


def sizes() -> tuple[Counter[str], Counter[str]]:
    """Return the lines of code, and the statements, by package and wing."""
    lines: Counter[str] = Counter()
    stated: Counter[str] = Counter()
    for path, tree in modules():
        lines[part(path)] += code_lines(path, tree)
        stated[part(path)] += statements(path)
    return lines, stated


@cache
def imports() -> dict[Path, set[str]]:
    """Return the modules that each file imports, at once or later, with the names taken from
    packages."""
    found: dict[Path, set[str]] = {}
    for path, tree in modules():
        own = found.setdefault(path, set())
        for node in nodes(tree):
            if isinstance(node, ast.Import):
                own |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                own |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def strings(tree: ast.Module) -> set[str]:
    """Return the strings that a file holds."""
    return {
        node.value
        for node in nodes(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }


def core_files() -> list[tuple[str, int]]:
    """Return the files of the core with their lines of code, package by package, the largest
    first."""
    found = [(path, code_lines(path, tree)) for path, tree in modules() if part(path) in CORE]
    found.sort(key=lambda each: (CORE.index(package(each[0])), -each[1]))
    return [(path.relative_to(SOURCE).as_posix(), lines) for path, lines in found]


def main(asked: list[str]) -> str | None:
    """Print what is asked for; return what is wrong with that, if anything."""
    if asked == ["core"]:
        for name, count in core_files():
            print(f"{count:6}  {name}")
        return None
    if asked:
        return f"there is no table {' '.join(asked)!r}; give core, or nothing for all packages"
    lines, stated = sizes()
    print(f"{'':20} {'lines':>6} {'statements':>10}")
    for name, count in lines.most_common():
        print(f"{name:20} {count:6} {stated[name]:10}{'  core' if name in CORE else ''}")
    core = [sum(counted[name] for name in CORE) for counted in (lines, stated)]
    print(f"{'core':20} {core[0]:6} {core[1]:10}")
    print(f"{'all':20} {lines.total():6} {stated.total():10}")
    return None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
