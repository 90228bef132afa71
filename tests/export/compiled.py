"""Exports as functions that can be called: compiled by a C compiler that is found."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from linkwork.export import CExport
from linkwork.export.calls import CALLS, Argument
from linkwork.export.layout import layouts
from linkwork.kernels.machine import this_machine
from linkwork.robot import Robot

from tests.processes import PATIENCE

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]


SERVER = """
#include "{name}.h"
#include <stdio.h>
int main(int count, char **words)
{{
    double in[256], out[1024];
    (void)count;
    switch (words[1][0] - '0') {{
{cases}
    }}
    return 0;
}}
"""
CASE = """
    case {k}:
        while (fread(in, sizeof in[0], {n_in}, stdin) == {n_in}) {{
            out[{n_out}] = (double){name}_{function}({arguments});
            (void)fwrite(out, sizeof out[0], {n_out} + 1, stdout);
        }}
        break;
"""
"""A program that reads what its function number k takes, row after row, and writes what that gives,
and the status after it."""


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

    def __call__(self, name: str, *given: object) -> tuple[int, list[Any]]:
        """Call a function; return its status and what it gives or changes. Free numbers follow what
        it takes, then what it changes."""
        arguments = [each for each in CALLS[name].arguments if each.role != "out"]
        taken = iter(given)
        ins = [self._given(next(taken), each) for each in arguments if each.role == "in"]
        count = len(given) - len(arguments)
        free = [np.ascontiguousarray(next(taken), self.real) for _ in range(count)]
        changed = [self._changed(next(taken), each) for each in arguments if each.role == "inout"]
        outs = [self._empty(each) for each in CALLS[name].arguments if each.role == "out"]
        function = getattr(self.own, f"{self.name}_{name}")
        status = function(*map(pointer, [*ins, *free, *changed, *outs]))
        return status, [*changed, *outs]

    def _given(self, value: Any, argument: Argument) -> Any:
        kind = ctypes.c_double if self.real is float else ctypes.c_float
        if not argument.sizes:
            return kind(value)
        return np.ascontiguousarray(value, self.real)

    def _changed(self, value: Any, argument: Argument) -> Any:
        return value if argument.kind == "state" else np.array(value, self.real)

    def _empty(self, argument: Argument) -> Any:
        if argument.kind == "state":
            return self.state()
        return np.empty(
            int(np.prod([len(self.layouts[size]) for size in argument.sizes])), self.real
        )

    @cached_property
    def state(self) -> type[ctypes.Structure]:
        """The structure of a state."""
        kind = ctypes.c_double if self.real is float else ctypes.c_float
        q, w = kind * len(self.layouts["Q"]), kind * len(self.layouts["W"])
        numbers = [("t", kind), ("q", q), ("w", w), ("next", kind)]
        fields = [*numbers, ("own", ctypes.c_int), ("changes", ctypes.c_int)]
        return type("State", (ctypes.Structure,), {"_fields_": fields})


class Program:
    """An export compiled to a program for another processor, with the roundings of this machine's
    kernels, which answers for many rows at a time."""

    def __init__(
        self, robot: Robot, export: CExport, folder: Path, compiling: list[str], running: list[str]
    ):
        self.layouts, self.functions = layouts(robot), export.functions
        self.command = [*running, str(folder / "server")]
        export.write(folder)
        cases = [self._case(k, export.name, each) for k, each in enumerate(export.functions)]
        server = folder / "server.c"
        server.write_text(SERVER.format(name=export.name, cases="".join(cases)))
        same = [f"-D{export.name.upper()}_SAME_NUMBERS"] if this_machine().has_fma else []
        sources = [server, folder / f"{export.name}.c"]
        run([*compiling, *STRICT, "-O1", *same, *sources, "-o", self.command[-1], "-lm"])

    def __call__(self, name: str, rows: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Call a function for rows of what it takes; return the statuses and what it gives."""
        given = np.ascontiguousarray(np.concatenate(rows, axis=1), float)
        done = subprocess.run(
            [*self.command, str(self.functions.index(name))],
            input=given.tobytes(),
            stdout=subprocess.PIPE,
            timeout=PATIENCE,
            check=True,
        )
        found = np.frombuffer(done.stdout).reshape(len(given), -1)
        return found[:, -1], found[:, :-1]

    def _case(self, k: int, name: str, function: str) -> str:
        words, counts = [], {"in": 0, "out": 0}
        for each in CALLS[function].arguments:
            words.append(f"{each.role} + {counts[each.role]}")
            counts[each.role] += int(np.prod([len(self.layouts[size]) for size in each.sizes]))
        return CASE.format(
            k=k,
            name=name,
            function=function,
            arguments=", ".join(words),
            n_in=counts["in"],
            n_out=counts["out"],
        )


def pointer(value: object) -> object:
    """Return what C is given for a value."""
    if isinstance(value, np.ndarray):
        return value.ctypes.data_as(ctypes.c_void_p)
    return ctypes.byref(value) if isinstance(value, ctypes.Structure) else value
