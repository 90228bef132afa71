"""Exports as functions that can be called: compiled by a C compiler that is found."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from linkwork.export import CExport
from linkwork.export.calls import CALLS
from linkwork.export.layout import layouts
from linkwork.kernels.machine import this_machine
from linkwork.robot import Robot

from tests.processes import PATIENCE

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]


def compiler(name: str) -> list[str]:
    """Return the command of a compiler, nothing where it is not there."""
    if name == "zig":
        return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else []
    found = shutil.which(name)
    return [found] if found else []


def run(command: Sequence[str | Path], **options: object) -> str:
    """Run a program to its end; return what it prints, and show that where it fails."""
    done = subprocess.run(
        [*map(str, command)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=PATIENCE,
        check=False,
        **options,  # pyright: ignore[reportArgumentType, reportCallIssue]
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


class Library:
    """An export compiled to a shared library by gcc, with the roundings of this machine's
    kernels."""

    def __init__(self, robot: Robot, export: CExport, folder: Path, *flags: str):
        export.write(folder)
        library = folder / f"{export.name}.so"
        same = [f"-D{export.name.upper()}_SAME_NUMBERS"] if this_machine().has_fma else []
        given = ["-O0", "-shared", "-fPIC", *same, *flags, "-o", library]
        run([*compiler("gcc"), *STRICT, *given, folder / f"{export.name}.c", "-lm"])
        self.own = ctypes.CDLL(str(library))
        self.name, self.layouts = export.name, layouts(robot)
        self.real = np.float32 if "typedef float" in export.files[f"{export.name}.h"] else float

    def __call__(self, name: str, *given: np.ndarray) -> tuple[int, list[np.ndarray]]:
        """Call a function; return its status and what it gives. Free numbers are its last input."""
        outputs = [
            np.full(int(np.prod([len(self.layouts[size]) for size in each.sizes])), 7e77, float)
            if self.real is float
            else np.empty(int(np.prod([len(self.layouts[size]) for size in each.sizes])), self.real)
            for each in CALLS[name].arguments
            if each.role == "out"
        ]
        arrays = [np.ascontiguousarray(each, self.real) for each in given] + outputs
        function = getattr(self.own, f"{self.name}_{name}")
        status = function(*(each.ctypes.data_as(ctypes.c_void_p) for each in arrays))
        return status, outputs
