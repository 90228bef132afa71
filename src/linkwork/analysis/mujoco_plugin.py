"""What makes a tree without loops move as the closed robot does, as a plug-in of MuJoCo in C.

The equations are written by the writer of exported C, what asks them stands in
`templates/mujoco_plugin.c`.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from hashlib import sha256
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

import casadi as ca
import numpy as np

from linkwork.analysis.tree_map import CLOSED, SHORTEST, STEPS, TreeMap
from linkwork.errors import LinkworkError
from linkwork.export.as_casadi import static_functions
from linkwork.model.checks import PIVOT_BOUND

PATIENCE = 600  # of the compiler [s]


def name_of(of: TreeMap) -> str:
    """Return the plug-in's name, which tells trees apart: a process registers each name once."""
    return name_told(of, static_functions(of.functions))


def name_told(of: TreeMap, equations: str) -> str:
    """Return the name of the plug-in with equations in C."""
    told = sha256((equations + tables(of)).encode()).hexdigest()[:8]
    return f"linkwork.{re.sub(r'[^A-Za-z0-9_]', '_', of.tree.mechanism.name)}.{told}"


def source(of: TreeMap) -> str:
    """Return the plug-in as C."""
    equations = static_functions(of.functions)
    template = files("linkwork.analysis").joinpath("templates/mujoco_plugin.c").read_text("utf-8")
    given = {
        "name": name_told(of, equations),
        "equations": equations,
        "tables": tables(of),
        "closed": repr(CLOSED),
        "steps": str(STEPS),
        "shortest": repr(SHORTEST),
        "pivot": repr(PIVOT_BOUND),
    }
    for key, value in given.items():
        template = template.replace(f"@{key}@", value)
    return template


def tables(of: TreeMap) -> str:
    """Return sizes and names as C."""
    moves = of.tree.moves
    sizes = {
        "JOINTS": len(moves),
        "X": len(of.coordinates),
        "N": len(of.tree.names),
        "M": len(of.motors),
        "Q": of.equations.nq,
    }
    coupled = np.array(ca.DM(of.terms[0].sparsity(), 1)).astype(int)
    home = [*of.x_home, *of.tree.about.q.tolist()]
    lines = [f"enum {{ {', '.join(f'{name} = {size}' for name, size in sizes.items())} }};"]
    lines += [
        f"static const char* const JOINT[] = {{{quoted(move.name for move in moves)}}};",
        f"static const char* const MOTOR[] = {{{quoted([*of.motors, ''])}}};",
        f"static const int FREE[] = {{{row(int(move.kind == 'free') for move in moves)}}};",
        f"static const int COUPLED[] = {{{row(coupled.ravel().tolist())}}};",
        f"static const double HOME[] = {{{row(map(repr, home))}}};",
    ]
    return "\n".join(lines)


def quoted(names: Iterable[str]) -> str:
    """Return names as C's strings."""
    kept = (re.sub(r'(["\\])', r"\\\1", name) for name in names)
    return row(f'"{name}"' for name in kept)


def row(values: Iterable[object]) -> str:
    return ", ".join(map(str, values))


def built(text: str, target: Path) -> Path:
    """Compile a plug-in for the MuJoCo that is installed; return the library's path.

    Raises:
        LinkworkError: no MuJoCo, no compiler, a folder that is not there, what the compiler says.
    """
    include, library = engine()
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc")
    if not compiler or not shutil.which(compiler):
        raise LinkworkError(
            "there is no C compiler; install one, or write the plug-in by write_plugin and compile "
            "it elsewhere"
        )
    if not target.parent.is_dir():
        raise LinkworkError(f"the library is to go into '{target.parent}', which is no folder")
    with tempfile.TemporaryDirectory() as folder:
        written = Path(folder) / "plugin.c"
        written.write_text(text, encoding="utf-8")
        command = [compiler, "-O2", "-shared", "-fPIC", "-I", include, written, "-o", target]
        command += [library, "-lm", f"-Wl,-rpath,{library.parent}"]
        run = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    if run.returncode:
        said = next((line for line in run.stderr.splitlines() if "error" in line), run.stderr)
        raise LinkworkError(f"the compiler {compiler!r} does not make the plug-in: {said.strip()}")
    return target


def engine() -> tuple[Path, Path]:
    """Return the folder of MuJoCo's headers and its library."""
    found = find_spec("mujoco")
    if found is None or found.origin is None:
        raise LinkworkError(
            "the plug-in needs MuJoCo's headers; install it with 'pip install mujoco'"
        )
    home = Path(found.origin).parent
    libraries = sorted(home.glob("libmujoco*"))
    if not (home / "include").is_dir() or not libraries:
        raise LinkworkError(f"MuJoCo in {home} has no headers or no library; install its wheel")
    return home / "include", libraries[-1]
