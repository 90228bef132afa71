"""Exported C: how large it is, how quick beside the kernel for one state, and how far from it."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import linkwork as lw
from linkwork.kernels.machine import this_machine
from linkwork.model.checks import PIVOT_BOUND
from linkwork.robot import Robot

from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.timing import Contender, interleaved

STATES, TIMED, SPREAD = 10_000, 200, 0.2
COLUMNS = ("robot", "operations", "Cortex-M7", "kernel", "C", "ratio", "ulp", "own roundings")
ARM = ("arm-none-eabi-gcc", "-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "-mthumb")
METHOD = """
    `motion` of every robot, exported to C and compiled by gcc -O3 -march=native, beside the kernel
    for one state: a native loop calls either for 200 states in turn. Error: the largest
    difference over the largest entry of dv or dq, in units of 2^-52, at 10,000 states around home,
    also near singular ones (pivots from 1e-4 on); "own roundings": the same of C that is compiled
    without -march=native, where products and sums are rounded apart. Cortex-M7: text of `motion`
    alone, with its sines, by arm-none-eabi-gcc -Os.
    """
DRIVER = """
#include "{name}.h"
void exported(long count, const double *x, double *y);
void given(long count, const double *x, double *y, void (*f)(const double *, double *));
void exported(long count, const double *x, double *y)
{{
    for (; count > 0; --count, x += {n_in}, y += {n_out}) {{
        (void){name}_motion(x, x + {nq}, x + {u}, y, y + {nq});
    }}
}}
void given(long count, const double *x, double *y, void (*f)(const double *, double *))
{{
    for (; count > 0; --count, x += {n_in}, y += {n_out}) {{
        f(x, y);
    }}
}}
"""


@dataclass(frozen=True)
class ExportedMotion:
    """Hold what the exported motion of a robot took.

    text: on a Cortex-M7 [bytes], if there is a compiler; kernel, c: time of one state [ns]; ulp,
    apart: largest difference with and without products and sums of one rounding [2^-52]
    """

    name: str
    operations: int
    text: int | None
    kernel: float
    c: float
    ulp: float
    apart: float

    @property
    def row(self) -> tuple[str, ...]:
        """Return the row of the listing."""
        return (
            self.name,
            str(self.operations),
            "" if self.text is None else f"{self.text} B",
            quantity(self.kernel, "ns"),
            quantity(self.c, "ns"),
            quantity(self.c / self.kernel, ""),
            quantity(self.ulp, ""),
            quantity(self.apart, ""),
        )


def run(
    names: Sequence[str] = tuple(lw.robots.__all__), states: int = STATES, rounds: int = 30
) -> Section:
    """Measure robots of the catalogue."""
    if shutil.which("gcc") is None:
        return Section("Exported C", METHOD + " There is no gcc on this machine.")
    found = [measured(name, states, rounds) for name in names]
    small = next((each.text for each in found if each.name == "prr3"), None)
    note = "" if small else f"{ARM[0]} is not installed"
    ratio = max(each.c / each.kernel for each in found)
    figures = [
        Figure("largest difference, in ulp of the largest entry", max(e.ulp for e in found), "", 4),
        Figure("time of C over the kernel's, largest", ratio, "", 1.3),
        Figure("3-PRR: motion on a Cortex-M7", small, "bytes", 8192, note=note),
    ]
    raw = {each.name: vars(each) for each in found}
    rows = [each.row for each in found]
    return Section("Exported C", METHOD, figures, raw, listing=Listing(COLUMNS, rows))


def measured(name: str, states: int, rounds: int) -> ExportedMotion:
    """Return what the motion of a robot took."""
    robot = Robot(name)
    kernel = robot.kernel("motion")
    random, nq = np.random.default_rng(7), robot.equations.nq
    spread = SPREAD * robot.equations.tree.units * random.normal(size=(states, nq))
    rest = random.normal(size=(states, kernel.n_in - nq))
    x = np.concatenate([robot.home.q + spread, rest], axis=1)
    found = np.array([kernel.flat(row) for row in x])
    x, wanted = (each[np.abs(found[:, -1]) > PIVOT_BOUND] for each in (x, found[:, :-1]))
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        export = lw.export.c(robot, ["motion"], name="robot")
        export.write(place)
        sizes = {"nq": nq, "u": nq + robot.mobility, "n_in": x.shape[1], "n_out": kernel.n_out}
        (place / "driver.c").write_text(DRIVER.format(name="robot", **sizes))
        native = library(place, "native.so", "-march=native")
        apart = library(place, "apart.so")
        times = interleaved(contenders(native, kernel.address, x[:TIMED], kernel.n_out), rounds)
        return ExportedMotion(
            name,
            kernel.operations,
            text_on_arm(place),
            1e9 * float(times["kernel"].min()),
            1e9 * float(times["C"].min()),
            difference(native, x, wanted, kernel.n_out) if this_machine().has_fma else np.nan,
            difference(apart, x, wanted, kernel.n_out),
        )


def library(place: Path, name: str, *flags: str) -> ctypes.CDLL:
    """Return the export compiled by gcc, with the loop."""
    words = ["gcc", "-std=c99", "-O3", *flags, "-shared", "-fPIC", "-o", place / name]
    subprocess.run([*words, place / "driver.c", place / "robot.c", "-lm"], check=True, timeout=600)
    return ctypes.CDLL(str(place / name))


def contenders(own: ctypes.CDLL, address: int, x: np.ndarray, n_out: int) -> dict[str, Contender]:
    """Return the loop over states that calls the kernel, and that which calls C."""
    y, x = np.empty((len(x), n_out)), np.ascontiguousarray(x)
    states = ctypes.c_long(len(x)), *(ctypes.c_void_p(a.ctypes.data) for a in (x, y))
    kept, kernel = (x, y), ctypes.c_void_p(address)
    return {
        "kernel": Contender(lambda: (own.given(*states, kernel), kept), len(x)),
        "C": Contender(lambda: (own.exported(*states), kept), len(x)),
    }


def difference(own: ctypes.CDLL, x: np.ndarray, wanted: np.ndarray, n_out: int) -> float:
    """Return the largest difference over the largest entry of each state, in units of 2^-52."""
    y, x = np.empty((len(x), n_out)), np.ascontiguousarray(x)
    count, pointers = ctypes.c_long(len(x)), [ctypes.c_void_p(a.ctypes.data) for a in (x, y)]
    own.exported(count, *pointers)
    sound = np.isfinite(wanted).all(axis=1)
    apart = np.abs(y[sound, :-1] - wanted[sound]).max(axis=1) / np.abs(wanted[sound]).max(axis=1)
    return float(apart.max(initial=0.0) * 2**52)


def text_on_arm(place: Path) -> int | None:
    """Return the bytes of text of the motion on a Cortex-M7, None without a compiler."""
    if shutil.which(ARM[0]) is None:
        return None
    compiled = place / "arm.o"
    words = [*ARM, "-std=c99", "-Os", "-c", place / "robot.c", "-o", compiled]
    subprocess.run(words, check=True, timeout=600)
    told = subprocess.run(
        ["arm-none-eabi-size", compiled], check=True, timeout=60, capture_output=True, text=True
    )
    return int(told.stdout.splitlines()[1].split()[0])
