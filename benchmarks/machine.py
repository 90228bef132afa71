"""The machine: what it is called, and what its arithmetic can do at most.

The clock is taken from a chain of integer operations of one cycle each, the peak from independent
fused multiply-adds on full vector registers: both are loops of LLVM instructions, compiled for this
processor like the kernels are.
"""

from __future__ import annotations

import ctypes
import os
import platform
import re
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import llvmlite.binding as llvm
import numpy as np

PACKAGES = (
    "linkwork",
    "numpy",
    "scipy",
    "casadi",
    "llvmlite",
    "numba",
    "pin",
    "mujoco",
    "exudyn",
    "mpmath",
)
CHAIN, ACCUMULATORS, ROUNDS = 16, 12, 200_000


@dataclass(frozen=True)
class Machine:
    """Describe the processor, what was installed, and when.

    clock: cycles per second of one busy core [GHz]; peak: floating-point operations per second of
    one core, an FMA counted as two [1e9 / s].
    """

    cpu: str
    architecture: str
    cores: int
    lanes: int
    clock: float
    peak: float
    system: str
    python: str
    packages: dict[str, str]
    date: str

    @property
    def has_avx512(self) -> bool:
        """Tell whether a vector register holds eight doubles."""
        return self.lanes == 8

    def lines(self) -> dict[str, str]:
        """Return the description as titled lines."""
        return {
            "processor": f"{self.cpu} ({self.architecture}), {self.cores} cores",
            "vector registers": f"{self.lanes} doubles ({64 * self.lanes} bits)",
            (
                "clock and peak of one core, measured"
            ): f"{self.clock:.2f} GHz, {self.peak:.1f} GFLOP/s in double precision",
            "system": self.system,
            "Python": f"{self.python}; "
            + ", ".join(f"{name} {number}" for name, number in self.packages.items()),
        }

    def as_dict(self) -> dict:
        """Return all fields."""
        return asdict(self)


def describe(lanes: int) -> Machine:
    """Look at this machine; lanes: doubles per vector register."""
    clock, peak = limits(lanes)
    return Machine(
        cpu=cpu_name(),
        architecture=llvm.get_host_cpu_name(),
        cores=len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1,
        lanes=lanes,
        clock=clock,
        peak=peak,
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        packages={name: found for name in PACKAGES if (found := installed(name))},
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )


def installed(package: str) -> str:
    try:
        return version(package)
    except ImportError:
        return ""


def cpu_name() -> str:
    """Return the processor's name as the system gives it."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return platform.processor() or platform.machine()
    found = re.search(r"model name\s*:\s*(.+)", text)
    return found[1].strip() if found else platform.machine()


def limits(lanes: int) -> tuple[float, float]:
    """Measure the clock [GHz] and the arithmetic peak [GFLOP/s] of one core: the best of many short
    runs."""
    engine = compiled(chain_loop() + peak_loop(lanes))
    prototype = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_int64, ctypes.c_double)
    chain, peak = (prototype(engine.get_function_address(name)) for name in ("chain", "peak"))
    cycles = CHAIN * ROUNDS / fastest(lambda: chain(ROUNDS, 0.0))
    operations = 2 * lanes * ACCUMULATORS * ROUNDS / fastest(lambda: peak(ROUNDS, 0.5))
    return 1e-9 * cycles, 1e-9 * operations


def fastest(call, repeats: int = 30) -> float:
    times = np.empty(repeats)
    for i in range(repeats):
        start = perf_counter()
        call()
        times[i] = perf_counter() - start
    return float(times.min())


def compiled(text: str):
    """Compile LLVM instructions for this processor."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2
    )
    return llvm.create_mcjit_compiler(llvm.parse_assembly(text), machine)


def loop(name: str, head: str, phis: list[str], body: list[str], tail: list[str]) -> str:
    """Return a function double name(int64_t rounds, double x) that repeats the body."""
    lines = [
        f"define double @{name}(i64 %rounds, double %x) {{",
        "entry:",
        head,
        "  br label %loop",
        "loop:",
    ]
    lines += ["  %i = phi i64 [0, %entry], [%next, %loop]", *phis, *body, "  %next = add i64 %i, 1"]
    lines += [
        "  %more = icmp slt i64 %next, %rounds",
        "  br i1 %more, label %loop, label %done",
        "done:",
        *tail,
        "}",
    ]
    return "\n".join(lines) + "\n"


def chain_loop() -> str:
    """Return the loop of CHAIN integer operations, each waiting for the one before: one cycle
    each."""
    body = []
    for k in range(CHAIN):
        operation = ("add", "xor")[k % 2]
        body.append(f"  %c{k + 1} = {operation} i64 %c{k}, %step")
    phis = [f"  %c0 = phi i64 [%rounds, %entry], [%c{CHAIN}, %loop]"]
    tail = [f"  %result = uitofp i64 %c{CHAIN} to double", "  ret double %result"]
    return loop("chain", "  %step = fptoui double %x to i64", phis, body, tail)


def peak_loop(lanes: int) -> str:
    """Return the loop of ACCUMULATORS independent fused multiply-adds on full registers: a <- a x +
    x."""
    vector, fma = f"<{lanes} x double>", f"@llvm.fma.v{lanes}f64"
    head = f"  %one = insertelement {vector} poison, double %x, i32 0\n"
    head += f"  %v = shufflevector {vector} %one, {vector} poison, <{lanes} x i32> zeroinitializer"
    phis, body, tail = [], [], []
    for k in range(ACCUMULATORS):
        start = ", ".join([f"double {k}.0"] * lanes)
        phis.append(f"  %a{k} = phi {vector} [<{start}>, %entry], [%b{k}, %loop]")
        body.append(f"  %b{k} = call {vector} {fma}({vector} %a{k}, {vector} %v, {vector} %v)")
        tail.append(f"  %e{k} = extractelement {vector} %b{k}, i32 0")
    total = "%e0"
    for k in range(1, ACCUMULATORS):
        tail.append(f"  %t{k} = fadd double {total}, %e{k}")
        total = f"%t{k}"
    declaration = f"declare {vector} {fma}({vector}, {vector}, {vector})\n"
    return declaration + loop("peak", head, phis, body, [*tail, f"  ret double {total}"])
